"""What is installed: every file of the package that is not Python is named in the packaging."""

from __future__ import annotations

import re
import runpy
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]


def test_files_beside_the_code_are_packaged() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    for name, patterns in project["tool"]["setuptools"]["package-data"].items():
        check(ROOT / "src" / name, patterns)


def check(package: Path, patterns: list[str]) -> None:
    packaged = {file for pattern in patterns for file in package.glob(pattern)}
    files = {file for file in package.rglob("*") if file.is_file() and "__pycache__" not in file.parts}
    assert {file for file in files if file.suffix not in (".py", ".pyc")} == packaged


def test_a_package_index_shows_no_link_that_leads_nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    setuptools = pytest.importorskip("setuptools", reason="builds the package")
    told: dict[str, Any] = {}
    monkeypatch.setattr(setuptools, "setup", lambda **values: told.update(values))
    runpy.run_path(str(ROOT / "setup.py"))
    text = told["long_description"]
    assert re.findall(r"\]\((?!https?:)", text) == []
    assert text.startswith("# evplace\n\nVisual place recognition")
    assert "Five-minute start, your own recording" in text
    readme = (ROOT / "README.md").read_text("utf-8")
    for link in re.findall(r"\]\((?!https?:)([^)#]*)", readme):
        assert (ROOT / link).exists(), link
