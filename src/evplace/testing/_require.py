"""What all checks have in common."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator
from typing import Any

from evplace.core import families, settings
from evplace.core.errors import EvplaceError, PartError, SettingsError


def require(held: object, sentence: str) -> None:
    """AssertionError with the sentence where something does not hold; unlike `assert`, under -O too."""
    if not held:
        raise AssertionError(sentence)


@contextlib.contextmanager
def refusing(kind: type[EvplaceError], sentence: str) -> Iterator[None]:
    """AssertionError with the sentence where the block does not raise a `kind` of one line."""
    try:
        yield
    except kind as error:
        require(str(error) and "\n" not in str(error), f"{sentence}, in one line, not: {error}")
        return
    except Exception as error:
        raise AssertionError(f"{sentence}; it raised {type(error).__name__}: {error}") from error
    raise AssertionError(sentence)


@contextlib.contextmanager
def held_to_it() -> Iterator[None]:
    """A PartError, which says what a part breaks, as AssertionError."""
    try:
        yield
    except PartError as error:
        raise AssertionError(str(error)) from error


def check_settings(family: str, part: Any) -> None:
    """That a part is a frozen dataclass of settings that survive a file; so are its presets."""
    who, kind = families.described(family, part), type(part)
    require(dataclasses.is_dataclass(kind), f"{who} must be a dataclass of its settings")
    for field in dataclasses.fields(kind):
        try:
            setattr(part, field.name, getattr(part, field.name))
        except dataclasses.FrozenInstanceError:
            continue
        raise AssertionError(f"{who} must be frozen: its setting '{field.name}' can be changed")
    try:
        kind()
    except TypeError as error:
        raise AssertionError(f"each setting of {who} must have a default: {error}") from error
    presets = getattr(kind, "presets", {})
    for made in (part, *presets.values()):
        require(isinstance(made, kind), f"the presets of {who} must be objects of its class")
        values = settings.to_dict(made)
        require(
            settings.make(kind, values) == made, f"the settings of {who} do not come back from JSON: {values}"
        )
    with refusing(SettingsError, f"{who} must refuse a setting that it does not have"):
        settings.make(kind, {"no such setting": 0})
