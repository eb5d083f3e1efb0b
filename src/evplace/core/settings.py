"""Settings are frozen dataclasses: at once Python arguments, TOML keys and command-line flags.

Each field has a docstring under it with its unit, default and source. An unknown key is an error that
lists the known ones; the resolved settings are saved with every map and result.
"""

from __future__ import annotations

import contextlib
import dataclasses
import difflib
import json
import math
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from evplace.core.errors import SettingsError

S = TypeVar("S")
WORDS = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "text",
    Path: "a path",
    NoneType: "",
}
"""What a type is called in a message; an empty word is left out."""


def make(kind: type[S], values: Mapping[str, object], base: S | None = None, table: str = "") -> S:
    """`kind` with `values` over the fields of `base` (its defaults if None).

    A field that is a dataclass takes a mapping, as a TOML table is. `table` is the name under which `kind`
    itself stands in messages. Raises SettingsError for an unknown key or a value of the wrong type; `kind`'s
    own `__post_init__` raises it for values out of range.
    """
    # `kind` is a dataclass, which a TypeVar cannot say: hence the exceptions to the types below.
    hints = get_type_hints(kind)
    # A dataclass, which mypy cannot know here.
    known = {field.name: hints[field.name] for field in dataclasses.fields(kind)}  # type: ignore[arg-type]
    check_keys(values, known, table)
    checked: dict[str, Any] = {}
    for key, value in values.items():
        name = f"{table}.{key}" if table else key
        if not dataclasses.is_dataclass(known[key]) or isinstance(value, known[key]):
            checked[key] = _as(known[key], value, name)
        elif isinstance(value, Mapping):
            checked[key] = make(known[key], value, getattr(base, key, None), name)
        else:
            raise SettingsError(f"the setting '{name}' cannot be {value!r}: it is a table, [{name}]")
    # A dataclass, which mypy cannot know here.
    return kind(**checked) if base is None else dataclasses.replace(base, **checked)  # type: ignore[type-var]


def check_keys(keys: Iterable[str], known: Mapping[str, Any], table: str = "") -> None:
    """SettingsError for a key that is not `known` (name -> type), with a guess of what was meant."""
    for key in keys:
        if key in known:
            continue
        inside = [name for name, hint in known.items() if key in getattr(hint, "__dataclass_fields__", ())]
        close = [f"{name}.{key}" for name in inside] or difflib.get_close_matches(key, known, n=1)
        hint = f"did you mean '{close[0]}'? " if close else ""
        name = f"{table}.{key}" if table else key
        listed = ", ".join(sorted(known)) or "none"
        raise SettingsError(f"unknown setting '{name}': {hint}known are {listed}")


def preset_of(what: str, presets: Mapping[str, S], name: str | None) -> S | None:
    """The preset of that name, None for None; SettingsError, with the known names, where there is none.

    `what` has the presets, in words: "the matcher 'local'".
    """
    if name is not None and name not in presets:
        raise SettingsError(
            f"{what} has no preset '{name}': known are {', '.join(sorted(presets)) or 'none'}"
        )
    return None if name is None else presets[name]


def changed(settings: object) -> list[str]:
    """The fields of a dataclass that differ from its defaults."""
    plain = type(settings)()  # a dataclass, which `object` does not say
    names = [field.name for field in dataclasses.fields(plain)]  # type: ignore[arg-type]  # a dataclass
    return [name for name in names if getattr(settings, name) != getattr(plain, name)]


def to_dict(settings: object) -> dict[str, Any]:
    """The resolved settings, a dataclass of any kind, as plain values, ready for JSON."""
    # A dataclass, which mypy cannot know here.
    plain: dict[str, Any] = json.loads(json.dumps(dataclasses.asdict(settings)))  # type: ignore[call-overload]
    return plain


def from_toml(path: Path) -> dict[str, Any]:
    """The tables and keys of a TOML file."""
    try:
        if path.exists() and not path.is_file():
            raise SettingsError(f"cannot read the settings file {path}: it is no file")
        return tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        raise SettingsError(f"cannot read the settings file {path}: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SettingsError(f"{path} is not TOML: {error}") from error


def _as(hint: Any, value: object, key: str) -> object:
    """`value` as the type `hint`; SettingsError that names `key` where it cannot be."""
    try:
        return _fitted(hint, value)
    except (TypeError, OverflowError):
        raise SettingsError(f"the setting '{key}' cannot be {value!r}: it takes {_words(hint)}") from None


def _fitted(hint: Any, value: Any) -> object:
    """An int is a fine float, a list a fine tuple, text a fine path, a table fine pairs; else TypeError."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        for option in inner:
            with contextlib.suppress(TypeError):
                return _fitted(option, value)
    elif origin is tuple:
        items = list(value.items()) if isinstance(value, Mapping) else value
        if isinstance(items, list | tuple):
            kinds = inner[:1] * len(items) if Ellipsis in inner else inner
            return tuple(_fitted(kind, item) for kind, item in _pairs(kinds, items))
    elif origin is dict and isinstance(value, Mapping):
        return dict(value)
    elif origin is Literal:
        if value in inner:
            return value
    elif hint is Path and isinstance(value, str):
        return Path(value)
    elif hint is float and type(value) is int:
        return float(value)
    elif _is(value, hint) and not (isinstance(value, float) and math.isnan(value)):
        return value
    raise TypeError


def _pairs(kinds: tuple[Any, ...], items: list[Any] | tuple[Any, ...]) -> list[tuple[Any, Any]]:
    """One kind an item; TypeError where there are too many or too few."""
    if len(kinds) != len(items):
        raise TypeError
    return list(zip(kinds, items, strict=True))


def _is(value: object, hint: Any) -> bool:
    """isinstance, but True is not an int; anything is an object."""
    if hint in (object, Any):
        return True
    return (
        isinstance(hint, type) and isinstance(value, hint) and (hint is bool or not isinstance(value, bool))
    )


def _words(hint: Any) -> str:
    """What a type takes, for people."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return " or ".join(filter(None, map(_words, inner)))
    if origin is Literal:
        return ", ".join(map(repr, inner))
    if origin is dict or (origin is tuple and get_origin(inner[0]) is tuple):
        return "a table"
    if origin is tuple:
        size = "" if Ellipsis in inner else f" of {len(inner)}"
        return f"a list{size}, each {_words(inner[0])}"
    return WORDS.get(hint, getattr(hint, "__name__", str(hint)))
