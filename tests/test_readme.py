"""The README is a promise: its Python runs, its links lead somewhere, and its two commands are where CI looks for them."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), ROOT / "benchmarks" / "README.md"]


def test_python_blocks_run():
    blocks = re.findall(r"```python\n(.*?)```", README, re.S)
    assert blocks
    for block in blocks:
        done = subprocess.run([sys.executable, "-c", block], capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


@pytest.mark.parametrize("name", ["main job", "tests"])
def test_the_two_commands_are_marked(name):
    block = re.search(rf"<!-- {name} -->\n```bash\n(.*?)```", README, re.S)
    assert block
    assert "pip install" in block[1]


def test_commands_that_the_readme_names_exist():
    help_text = subprocess.run(
        [sys.executable, "-m", "usv_gym.cli", "--help"], capture_output=True, text=True, check=True
    ).stdout
    named = set(re.findall(r"usv-gym ([a-z]+)", README))
    assert named
    assert all(re.search(rf"\b{command}\b", help_text) for command in named)
