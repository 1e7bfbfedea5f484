"""Shared by all tests: where the recordings are, and how to skip without them."""

from __future__ import annotations

from pathlib import Path

import pytest

#: real recordings; not part of the repository
DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def data() -> Path:
    if not DATA.is_dir():
        pytest.skip("the recordings of ../shared/data are not here")
    return DATA
