"""Settings are frozen dataclasses: at once Python arguments, TOML keys and command-line flags.

Each field has a docstring under it with its unit, default and source. An unknown key is an error that
lists the known ones; the resolved settings are saved with every map and result.
"""

from __future__ import annotations

import dataclasses
import difflib
import json
import math
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from evplace.core.errors import SettingsError

S = TypeVar("S")


def make(kind: type[S], values: Mapping[str, object], base: S | None = None) -> S:
    """`kind` with `values` over the fields of `base` (its defaults if None).

    Raises SettingsError for an unknown key or a value of the wrong type; `kind`'s own
    `__post_init__` raises it for values out of range.
    """
    # `kind` is a dataclass, which a TypeVar cannot say: hence the three exceptions to the types below.
    known = {field.name for field in dataclasses.fields(kind)}  # type: ignore[arg-type]
    for key in values:
        if key not in known:
            close = difflib.get_close_matches(key, known, n=1)
            hint = f"did you mean '{close[0]}'? " if close else ""
            raise SettingsError(f"unknown setting '{key}': {hint}known are {', '.join(sorted(known))}")
    hints = get_type_hints(kind)
    checked = {key: _as(hints[key], value, key) for key, value in values.items()}
    return kind(**checked) if base is None else dataclasses.replace(base, **checked)  # type: ignore[type-var]


def check_numbers(given: object) -> None:
    """SettingsError where a field of a dataclass, or of one within it, is a float that is no number."""
    for field in dataclasses.fields(given):  # type: ignore[arg-type]
        value = getattr(given, field.name)
        if dataclasses.is_dataclass(value):
            check_numbers(value)
        _check_number(field.name, value)


def to_dict(settings: object) -> dict[str, Any]:
    """The resolved settings as plain values, ready for JSON."""
    plain: dict[str, Any] = json.loads(json.dumps(dataclasses.asdict(settings)))  # type: ignore[call-overload]
    return plain


def from_pairs(pairs: Iterable[str]) -> dict[str, object]:
    """`["K=5", "tau1=0.9"]` as a mapping; values are read as TOML, or as text where they are not TOML."""
    values: dict[str, object] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not equals or not key:
            raise SettingsError(f"cannot read the setting '{pair}': write it as name=value, for example K=5")
        try:
            values[key] = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            values[key] = text
    return values


def from_toml(path: Path) -> dict[str, Any]:
    """The tables and keys of a TOML file."""
    try:
        return tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        raise SettingsError(f"cannot read the settings file {path}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"{path} is not TOML: {error}") from error


def _as(hint: Any, value: object, key: str) -> object:
    """`value` as the type `hint`; an int is a fine float, a list is a fine tuple, a table is a dict."""
    options = getattr(hint, "__args__", ()) if not isinstance(hint, type) else ()
    origin = getattr(hint, "__origin__", None)
    _check_number(key, value)
    if dataclasses.is_dataclass(hint) and isinstance(value, Mapping):
        return make(hint, value)  # type: ignore[arg-type]  # a dataclass is a type
    if origin is tuple and isinstance(value, list | tuple):
        return tuple(value)
    if isinstance(value, Mapping) and dict in (
        origin,
        *(getattr(one, "__origin__", None) for one in options),
    ):
        return dict(value)
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    allowed = tuple(option for option in (options or (hint,)) if isinstance(option, type))
    if float in allowed and isinstance(value, int) and not isinstance(value, bool) and int not in allowed:
        return float(value)
    literal = [option for option in options if not isinstance(option, type)]
    if (literal and value in literal) or (allowed and _is(value, allowed)):
        return value
    wanted = ", ".join([repr(option) for option in literal] + [option.__name__ for option in allowed])
    raise SettingsError(f"the setting '{key}' cannot be {value!r}: it takes {wanted}")


def _check_number(key: str, value: object) -> None:
    if isinstance(value, float) and math.isnan(value):
        raise SettingsError(f"the setting '{key}' cannot be nan: it takes a number")


def _is(value: object, allowed: tuple[type, ...]) -> bool:
    """isinstance, but True is not an int."""
    return isinstance(value, allowed) and (not isinstance(value, bool) or bool in allowed)
