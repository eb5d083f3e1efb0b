"""What several tests share: where the real recordings are, and small things made by code."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("evplace", deadline=None)  # the first call of a numba loop compiles it
settings.load_profile("evplace")


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real recordings; the test is skipped where there is none."""
    folder = Path(os.environ.get("EVPLACE_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real recordings at {folder}: set EVPLACE_DATA to a folder that has them")
    return folder


@pytest.fixture(scope="session")
def golden(data: Path) -> Path:
    """The folder of the original matchers' outputs; the test is skipped where there is none."""
    folder = data.parent / "golden"
    if not folder.is_dir():
        pytest.skip(f"no golden outputs at {folder}")
    return folder
