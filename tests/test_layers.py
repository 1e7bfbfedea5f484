"""The architecture, as a test: what imports what (docs/design.md)."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import usv_gym

PACKAGE = Path(usv_gym.__file__).parent

#: from the ground up.  A module imports from the layers below, and within its own layer from what stands left of it
LAYERS = (
    "units resources config jit atomic trig rng",  # no domain knowledge
    "world",  # truth
    "sensors traffic",  # the picture; how ships move
    "events engine scenarios",  # one tick; where worlds come from
    "metrics colregs tasks policies",  # the decision problem, how it is judged, who decides
    "render.palette replay render envs",  # archive and outputs, map, faces
    "voyage run play live sb3 train traffic_v0 campaign hil",  # jobs and further faces
    "cli",
)
PLACE = {name: (layer, k) for layer, row in enumerate(LAYERS) for k, name in enumerate(row.split())}
FILES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")
IDS = [path.relative_to(PACKAGE).as_posix() for path in FILES]


def dotted(path: Path) -> tuple[str, ...]:
    """Name of a file as a module of the package: ("world", "state")."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return parts[:-1] if parts[-1] == "__init__" else parts


def place(module: tuple[str, ...]) -> tuple[int, int]:
    """Where a module stands: by its own name, else by that of its package."""
    name = ".".join(module[:2])
    assert name in PLACE or module[0] in PLACE, f"{name} has no layer yet: give it one"
    return PLACE.get(name, PLACE.get(module[0], (-1, -1)))


def imports(path: Path) -> Iterator[tuple[tuple[str, ...], int]]:
    """Modules of this package that a file imports, anywhere in the file, each with the line."""
    package = path.relative_to(PACKAGE).parent.parts
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name.split(".") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            start = ["usv_gym", *package[: len(package) - node.level + 1]] if node.level else []
            module = [*start, *(node.module.split(".") if node.module else [])]
            names = [[*module, alias.name] for alias in node.names]
        else:
            continue
        for name in names:
            if name[0] == "usv_gym" and name[1:] != ["__version__"]:  # a constant, not a module above
                yield tuple(name[1:]), node.lineno


@pytest.mark.parametrize("path", FILES, ids=IDS)
def test_a_module_imports_only_from_below(path):
    own = dotted(path)
    for module, line in imports(path):
        if module[0] != own[0] or place(module) != place(own):
            assert place(module) < place(own), f"{path.name}:{line}: {'.'.join(module)} is not below {'.'.join(own)}"


@pytest.mark.parametrize("path", FILES, ids=IDS)
def test_only_faces_and_tasks_know_gymnasium_and_only_faces_of_training_know_torch(path):
    text = path.read_text(encoding="utf-8")
    if place(dotted(path)) < PLACE["tasks"]:
        assert "gymnasium" not in text
    if dotted(path) not in {("policies", "learned"), ("policies", "networks"), ("train",)}:
        assert "import torch" not in text


def test_imports_are_found():
    found = {module[:2] for module, _ in imports(PACKAGE / "scenarios" / "build.py")}
    assert {("world", "vessel"), ("config", "ConfigError"), ("scenarios", "schema")} <= found
    lazy = {module[:2] for module, _ in imports(PACKAGE / "envs" / "single.py")}
    assert ("render", "scene") in lazy
