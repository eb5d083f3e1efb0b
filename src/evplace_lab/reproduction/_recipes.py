"""The recipes: TOML files, one a row or a curve, and the inputs and methods that they name."""

from __future__ import annotations

import dataclasses
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from evplace.core import settings
from evplace.core.errors import SettingsError
from evplace_lab.reproduction._cases import Input, Method

R = TypeVar("R")
FOLDER = Path(__file__).parent / "recipes"


@cache
def inputs() -> dict[str, Input]:
    """Name -> input, in the order of the file."""
    return {name: settings.make(Input, values) for name, values in _toml("inputs.toml").items()}


@cache
def methods() -> dict[str, Method]:
    """Name -> method of the city's tables, in the order of the file."""
    return read_methods(FOLDER / "methods.toml")


@cache
def real_methods() -> dict[str, Method]:
    """Name -> method on real sets: the tables' own on every image, and some besides."""
    own = {name: dataclasses.replace(method, every=1) for name, method in methods().items()}
    return own | read_methods(FOLDER / "real" / "methods.toml")


def recipes(family: str, kind: type[R]) -> list[R]:
    """The recipes of a table or figure as `kind`, a dataclass with a field `order`, in that order."""
    found = [
        _recipe(file, kind) for file in sorted((FOLDER / family).glob("*.toml")) if file.stem != "methods"
    ]
    return sorted(found, key=lambda recipe: int(recipe.order))  # type: ignore[attr-defined] # kind has it


def _recipe(file: Path, kind: type[R]) -> R:
    try:
        return settings.make(kind, settings.from_toml(file))
    except SettingsError as error:
        raise SettingsError(f"the recipe {file.name}: {error}") from error


def read_methods(path: Path) -> dict[str, Method]:
    """Name -> method, in the order of a TOML file with a table for each; SettingsError where one is none."""
    found = {}
    for name, values in settings.from_toml(path).items():
        if not isinstance(values, dict):
            raise SettingsError(
                f"{path}: '{name}' is no method, which is a table with a scorer and a matcher"
            )
        try:
            found[name] = settings.make(Method, values)
        except (SettingsError, TypeError) as error:
            raise SettingsError(f"the method '{name}' in {path}: {error}") from error
    return found


def _toml(name: str) -> dict[str, dict[str, Any]]:
    return settings.from_toml(FOLDER / name)
