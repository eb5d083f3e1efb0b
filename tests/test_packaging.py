"""What is installed: every file of the package that is not Python is named in the packaging."""

from __future__ import annotations

import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_files_beside_the_code_are_packaged() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    for name, patterns in project["tool"]["setuptools"]["package-data"].items():
        check(ROOT / "src" / name, patterns)


def check(package: Path, patterns: list[str]) -> None:
    packaged = {file for pattern in patterns for file in package.glob(pattern)}
    files = {file for file in package.rglob("*") if file.is_file() and "__pycache__" not in file.parts}
    assert {file for file in files if file.suffix not in (".py", ".pyc")} == packaged
