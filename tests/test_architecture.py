"""One import direction, and a light front door."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import importlib.util
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_type_hints

import pytest

from evplace.cli import _modules
from evplace.cli._output import ARGUMENT, in_flags
from evplace.core import families

SRC = Path(__file__).parents[1] / "src"

ORDER = {
    "evplace": (
        "core sources imaging drives places torch searchers scorers matchers placemap localizer "
        "exports serving evaluation doctor testing cli"
    ),
    "evplace.core": (
        "errors folders events grey zscores settings families storage state workers cluster drawing"
    ),
    "evplace.sources": "frames readers live writers cleaning tracks film simulators",
    "evplace.imaging": (
        "windows _resampling representations tones images activity averaging recipe stream store spacing "
        "traverse sheets"
    ),
    "evplace.drives": "datasets to_traverse",
    "evplace.searchers": "_loops _turned exact int8 bits faiss",
    "evplace.scorers": "_reduction _compressed _indexed _distances _seqslam_images _network",
    "evplace.scorers._network": "network_onnx network augmentation checkpoint training",
    "evplace.localizer": "_regions _drive",
    "evplace.evaluation": "truth sweeps",
    "evplace_lab": "city descriptor reproduction report demonstration benchmark cli",
}
"""Package -> its parts in the order of the data: a part imports only parts before it, or files of its own."""


def imports(file: Path) -> set[str]:
    """The modules that a file imports, by their full names, `from a import b` as a.b."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return found


def later(file: Path, package: str) -> set[str]:
    """What a file of `package` imports of it that comes after its own part."""
    parts = ORDER[package].split()
    own = file.relative_to(SRC / Path(*package.split("."))).parts[0].removesuffix(".py")
    if own not in parts:
        return set()
    inside = {
        name.removeprefix(f"{package}.").split(".")[0]
        for name in imports(file)
        if name.startswith(f"{package}.")
    }
    return inside & set(parts[parts.index(own) + 1 :])


@pytest.mark.parametrize("package", ORDER)
def test_a_part_imports_only_parts_before_it(package: str) -> None:
    for file in sorted((SRC / Path(*package.split("."))).rglob("*.py")):
        assert not later(file, package), file


@pytest.mark.parametrize("package", ["evplace", "evplace_lab"])
def test_every_part_of_a_package_has_its_place_in_the_order(package: str) -> None:
    parts = {
        path.name.removesuffix(".py") for path in (SRC / package).iterdir() if path.name != "__pycache__"
    }
    assert parts - {"__init__", "__main__", "py.typed"} == set(ORDER[package].split())


def test_the_laboratory_is_never_imported() -> None:
    for file in sorted((SRC / "evplace").rglob("*.py")):
        assert not [name for name in imports(file) if name.startswith("evplace_lab")], file


def test_import_loads_numpy_and_nothing_heavier() -> None:
    heavy = "torch onnx onnxruntime numba h5py faery matplotlib PIL rosbags tyro rich scipy cv2 utm".split()
    code = f"import sys, evplace; print([name for name in {heavy} if name in sys.modules])"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"


def texts(file: Path) -> Iterator[str]:
    """The texts of a file that are no docstrings; values in them are 0."""
    tree = ast.parse(file.read_text())
    parts = {part for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    alone = {node.value for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in parts | alone:
            yield node.value
        elif isinstance(node, ast.JoinedStr):
            yield "".join(str(part.value) if isinstance(part, ast.Constant) else "0" for part in node.values)


def test_only_the_command_line_speaks_of_flags() -> None:
    """The library names arguments in backquotes, and each of them is a flag of some command."""
    flags = {
        in_flags(f"`{name}`")
        for module in _modules().values()
        for name in _flat_fields(importlib.import_module(module).Args)
    }
    for file in (file for file in SRC.rglob("*.py") if "cli" not in file.relative_to(SRC).parts):
        for text in texts(file):
            assert not re.search(r"(?<![\w-])--[a-z]", text), (file, text)
            for argument in ARGUMENT.finditer(text):
                assert in_flags(argument[0]).split()[0] in flags, (file, argument[0])


def _flat_fields(kind: type[Any]) -> Iterator[str]:
    hints = get_type_hints(kind)
    for field in dataclasses.fields(kind):
        inner = hints[field.name]
        yield from _flat_fields(inner) if dataclasses.is_dataclass(inner) else (field.name,)


FAMILIES = {**families.MODULES, **families.CLASSES}.values()


DOORS = ("evplace.torch",)
"""Modules that users import by themselves."""


def used_only_inside() -> list[str]:
    """Modules without an underscore that no other package of ours imports; parts of families have no user."""
    files = {
        ".".join(file.relative_to(SRC).with_suffix("").parts): file
        for file in SRC.rglob("*.py")
        if not file.name.startswith("_")
    }
    named = [(".".join(file.relative_to(SRC).parts[:-1]), imports(file)) for file in SRC.rglob("*.py")]
    found = []
    for module in files:
        package = module.rpartition(".")[0]
        private = any(part.startswith("_") for part in module.split("."))
        if (
            private
            or module in DOORS
            or package in FAMILIES
            or package.startswith("evplace_lab")
            or package.endswith(".cli")
        ):
            continue
        users = {user for user, names in named if any(f"{name}.".startswith(f"{module}.") for name in names)}
        if not any(not f"{user}.".startswith(f"{package}.") for user in users):
            found.append(module)
    return found


def test_a_module_that_only_its_package_uses_begins_with_an_underscore() -> None:
    assert used_only_inside() == []


def test_the_modules_for_parts_of_other_packages_are_there() -> None:
    text = (SRC.parent / "CONTRIBUTING.md").read_text("utf-8")
    named = set(re.findall(r"`(evplace(?:\.[a-z]+)+)`", text))
    assert len(named) > 15
    for module in named:
        assert importlib.util.find_spec(module) is not None, module
