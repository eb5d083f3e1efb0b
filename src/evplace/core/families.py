"""Families of interchangeable parts: a folder is a family, a file in it is one part, its name is its name.

Adding a part touches its own file and its test, nothing else: the folder itself is the list.
"""

from __future__ import annotations

import functools
import importlib
import pkgutil
from collections.abc import Mapping
from types import ModuleType
from typing import Any

from evplace.core.errors import SettingsError


def names(family: str) -> list[str]:
    """The parts of a family, for example `names("matchers")`: the public files of its folder, sorted.

    A family of another package is named with its package: `names("evplace_lab.reproduction")`.
    """
    return list(_names(family))


@functools.cache
def _names(family: str) -> tuple[str, ...]:
    """Looked up once: telling a recording's format asks for every reader, and a folder is slow to list."""
    package = importlib.import_module(_package(family))
    found = (module.name for module in pkgutil.iter_modules(package.__path__))
    return tuple(sorted(name for name in found if not name.startswith("_")))


def load(family: str, name: str) -> ModuleType:
    """The part `name` of a family; SettingsError, with the known names, where there is none."""
    known = names(family)
    if name not in known:
        raise SettingsError(
            f"'{name}' is none of the {family.rpartition('.')[2]}: known are {', '.join(known)}"
        )
    return importlib.import_module(f"{_package(family)}.{name}")


def settings_of(family: str, name: str) -> tuple[type[Any], Mapping[str, Any]]:
    """The settings of a part, a dataclass, and its presets; SettingsError as `load`."""
    part = load(family, name)
    return part.Settings, getattr(part, "PRESETS", {})


def _package(family: str) -> str:
    """Where the files of a family lie."""
    if "." in family:
        return family
    group = {"readers": "sources.", "writers": "sources.", "tracks": "sources.", "datasets": "drives."}
    return f"evplace.{group.get(family, '')}{family}"
