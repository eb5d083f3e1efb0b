"""The public face, pinned."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import evplace

PUBLIC = [
    "CleaningSettings", "Events", "EvplaceError", "ImageSettings", "Localizer", "Match", "PlaceGrid",
    "PlaceMap", "PlaceRuns", "Recipe", "Recording", "Result", "SpacingSettings", "Track", "TrainSettings",
    "Traverse", "WindowSettings", "__version__", "compare", "evaluate", "event_image", "open_recording",
    "matchers", "open_track", "open_traverse", "scorers", "train",
]  # fmt: skip


def test_the_public_names_are_these() -> None:
    assert sorted(evplace.__all__) == sorted(PUBLIC)
    assert dir(evplace) == evplace.__all__


def test_each_is_what_its_name_says_whatever_was_imported_before() -> None:
    code = (
        "import evplace, importlib, pkgutil\n"
        "for module in pkgutil.iter_modules(evplace.__path__):\n"
        "    if module.name != '__main__': importlib.import_module(f'evplace.{module.name}')\n"
        "print([n for n in evplace.__all__ if type(getattr(evplace, n)).__name__ == 'module'])"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "['matchers', 'scorers']"


def test_type_checkers_see_the_same_names() -> None:
    tree = ast.parse(Path(evplace.__file__).read_text())
    block = next(node for node in tree.body if isinstance(node, ast.If))
    seen = {
        alias.name: node.module
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == evplace._PUBLIC | dict.fromkeys(evplace._PACKAGES, "evplace")
