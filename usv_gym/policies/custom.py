"""Controllers of the user's own, from ``module:Class`` or ``path.py:Class``."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import sys
import traceback
from pathlib import Path
from types import ModuleType
from typing import Any

from ..config import ConfigError, suggestion
from .base import Controller


def load_custom(spec: str) -> Controller:
    """Make the controller that ``spec`` names; a class without arguments, a function that makes one, or the object.

    The directory of a file (the present one for a module) is on the path while and after it is imported, as when Python
    runs it.

    Raises
    ------
    ConfigError
        if the file or name is missing, importing or making it raises, or it has no ``reset`` and ``act``.
    """
    source, _, name = spec.partition(":")
    module = _module(spec, source)
    if not name:
        raise ConfigError(f"policy {spec}: expected {source}:CLASS; it has {_classes(module) or 'no class'}")
    try:
        made = getattr(module, name)
    except AttributeError:
        raise ConfigError(f"policy {spec}: {source} has no {name!r}{suggestion(name, _controllers(module))}") from None
    if isinstance(made, type) or (callable(made) and not hasattr(made, "act")):
        try:
            made = made()
        except Exception as error:
            raise ConfigError(f"policy {spec}: making it: {cause(error)}") from error
    missing = [method for method in ("reset", "act") if not callable(getattr(made, method, None))]
    if missing:
        raise ConfigError(f"policy {spec}: a {type(made).__name__} has no {' and no '.join(missing)}; "
                          "a controller has reset(info) and act(observation)")  # fmt: skip
    controller: Controller = made
    return controller


def _module(spec: str, source: str) -> ModuleType:
    try:
        if not source.endswith(".py"):
            _on_path(Path.cwd())
            return importlib.import_module(source)
        path = Path(source).resolve()
        if not path.is_file():
            near = [str(other) for other in sorted(Path(source).parent.glob("*.py"))] if Path(source).parent.is_dir() else []
            raise ConfigError(f"policy {spec}: {source}: no such file{suggestion(source, near)}")
        _on_path(path.parent)
        unique = f"usv_gym_policy_{hashlib.sha256(str(path).encode()).hexdigest()[:12]}"
        found = importlib.util.spec_from_file_location(unique, path)
        assert found is not None
        assert found.loader is not None
        module = importlib.util.module_from_spec(found)
        sys.modules[unique] = module  # dataclasses and pickle look there
        found.loader.exec_module(module)
        return module
    except ConfigError:
        raise
    except ModuleNotFoundError as error:
        if error.name == source.partition(".")[0]:
            raise ConfigError(f"policy {spec}: no module named {source!r}; a file is written path.py:Class") from None
        raise ConfigError(f"policy {spec}: importing it: {cause(error)}") from error
    except Exception as error:
        raise ConfigError(f"policy {spec}: importing it: {cause(error)}") from error


def _on_path(directory: Path) -> None:
    if str(directory) not in sys.path:
        sys.path.insert(0, str(directory))


def _controllers(module: ModuleType) -> list[str]:
    return [name for name, value in vars(module).items() if isinstance(value, type) and hasattr(value, "act")]


def _classes(module: ModuleType) -> str:
    return ", ".join(_controllers(module))


def cause(error: BaseException) -> str:
    """An exception in one line: its type, what it says, and the last line of code that is not this package's."""
    said = " ".join(str(error).split())
    where = ""
    package = str(Path(__file__).resolve().parents[1])
    for frame in traceback.extract_tb(error.__traceback__):
        if not frame.filename.startswith((package, "<frozen")):
            where = f" ({Path(frame.filename).name}:{frame.lineno})"
    return f"{type(error).__name__}{': ' if said else ''}{said}{where}"


def source_of(spec: str) -> Any:
    """Bytes of the file that a policy comes from, or None for a built-in one."""
    source = spec.partition(":")[0]
    if source.endswith(".py") or Path(source).is_file():
        return Path(source).read_bytes()
    found = importlib.util.find_spec(source) if ":" in spec else None
    return Path(found.origin).read_bytes() if found and found.origin and Path(found.origin).is_file() else None
