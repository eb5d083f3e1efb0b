"""Flags -> a command's Args. A settings file is flags written down: those on the command line win over it."""

from __future__ import annotations

import contextlib
import dataclasses
import io
from pathlib import Path
from types import ModuleType
from typing import Any, get_type_hints

import tyro

from evplace.core import settings
from evplace.core.errors import SettingsError


def parse(module: ModuleType, name: str, arguments: list[str]) -> Any:
    """The Args of a command; where these have a field `given`, it holds the names of the flags.

    Prints the help and exits with `--help`; SettingsError for a wrong flag.
    """
    said = io.StringIO()
    values, where = _from_file(arguments)
    flags = _flags(module.Args, values, where) + arguments
    try:
        with contextlib.redirect_stderr(said):
            args = tyro.cli(
                module.Args,
                prog=f"evplace {name}",
                description=module.__doc__,
                args=flags,
                config=(tyro.conf.FlagCreatePairsOff,),
            )
    except SystemExit as stop:
        if not stop.code:
            raise
        raise SettingsError(f"{_plain(said.getvalue())}; see evplace {name} --help") from None
    settings.check_numbers(args)
    given = (*_names(flags), *_keys(values))
    return dataclasses.replace(args, given=given) if hasattr(args, "given") else args


def _keys(values: dict[str, Any]) -> list[str]:
    """The names in a settings file, those in its tables among them."""
    inner = [key for table in values.values() if isinstance(table, dict) for key in _keys(table)]
    return [*values, *inner]


def _names(flags: list[str]) -> tuple[str, ...]:
    """The fields that the flags set."""
    said = (flag[2:].partition("=")[0].replace("-", "_") for flag in flags if flag.startswith("--"))
    return tuple(name.removeprefix("no_") for name in said)


def _plain(message: str) -> str:
    """Tyro's framed message as one line."""
    lines = (line.strip("│╭╮╰╯─ \n") for line in message.splitlines())
    kept = [line for line in lines if line and not line.startswith(("Parsing error", "For full helptext"))]
    return " ".join(kept) or "the flags cannot be read"


def _from_file(arguments: list[str]) -> tuple[dict[str, Any], str]:
    """What the file after `--settings` says, and the file's name."""
    if "--settings" not in arguments[:-1]:
        return {}, ""
    file = Path(arguments[arguments.index("--settings") + 1])
    return settings.from_toml(file), str(file)


def _flags(kind: type[Any], values: dict[str, Any], where: str) -> list[str]:
    hints = get_type_hints(kind)
    fields = {field.name: field for field in dataclasses.fields(kind) if field.name != "given"}
    known = sorted(fields)
    flags: list[str] = []
    for key, value in values.items():
        if key not in known:
            raise SettingsError(f"unknown setting '{key}' in {where}: known are {', '.join(known)}")
        if dataclasses.is_dataclass(hints[key]):
            if not isinstance(value, dict):
                raise SettingsError(f"'{key}' in {where} cannot be {value!r}: it is a table, [{key}]")
            flags += _flags(hints[key], value, f"[{key}] of {where}")
        elif hints[key] is bool:
            flags += _switch(key, value, fields[key].default, where)
        else:
            flags += _flag(key, value)
    return flags


def _switch(key: str, value: object, default: object, where: str) -> list[str]:
    """The flag of a boolean, which only says what differs from its default."""
    if not isinstance(value, bool):
        raise SettingsError(f"'{key}' in {where} cannot be {value!r}: it takes true or false")
    if value == default:
        return []
    name = key.replace("_", "-")
    return [f"--{name}" if value else f"--no-{name}"]


def _flag(key: str, value: object) -> list[str]:
    name = key.replace("_", "-")
    if isinstance(value, dict):
        return [word for pair in value.items() for word in (f"--{name}", "=".join(map(_text, pair)))]
    if isinstance(value, list):
        return [f"--{name}", *map(_text, value)]
    return [f"--{name}", _text(value)]


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
