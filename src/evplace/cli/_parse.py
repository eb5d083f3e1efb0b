"""The words of a command line -> a command's Args.

A flag wins over the settings file, the file over the preset, the preset over the defaults: all that no flag
says is put together in one default object, and the flags are read over it.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType, NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import tyro
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from evplace.cli._settings import SettingsFlags
from evplace.core import settings
from evplace.core.errors import SettingsError

NOT_IN_FILES = ("given", "settings", "show_settings")
"""Fields of Args that no settings file can hold."""
NO_SETTINGS = ("out", "output", "overwrite", "json", *NOT_IN_FILES)
"""Fields of Args that change nothing about how things are done."""


@dataclass(frozen=True)
class _First:
    """The flags that decide what the defaults of all others are."""

    settings: Path | None = None
    preset: str | None = None
    show_settings: bool = False


@dataclass(frozen=True)
class Parsed:
    """The Args of a command, and where their values came from."""

    args: Any
    only_shown: bool
    """Whether the settings are to be printed, and nothing else done."""
    file: Path | None
    values: dict[str, Any]
    """What the settings file says."""
    given: set[str]
    """The fields that flags gave, as `windows.dt`."""

    def in_force(self) -> dict[str, tuple[object, str]]:
        """Setting -> its value and its source: default, input, preset NAME, the file's name, or flag."""
        preset = getattr(self.args, "preset", None)
        sources = dict.fromkeys(self._of_preset(preset), f"preset {preset}")
        sources |= dict.fromkeys(_keys(self.values), str(self.file)) | dict.fromkeys(self.given, "flag")
        brought = {name: (value, "input") for name, value in _flat_tables(self.args.brought()).items()}
        found = {
            name: (value, sources[name]) if name in sources else brought.get(name, (value, "default"))
            for name, value in _flat(self.args).items()
        }
        for part in self.args.PARTS:
            del found[part.pairs]
            found |= part.in_force(self.args, self.values.get(part.pairs, {}), str(self.file))
        left_out = (*NO_SETTINGS, *_positionals(type(self.args)))
        return {name: setting for name, setting in found.items() if name not in left_out}

    def _of_preset(self, name: str | None) -> list[str]:
        """The settings in tables that a preset changes."""
        presets = {table: its[name] for table, its in self.args.TABLE_PRESETS.items() if name is not None}
        return [f"{table}.{key}" for table, preset in presets.items() for key in settings.changed(preset)]


def parse(module: ModuleType, name: str, arguments: list[str]) -> Parsed:
    """Read a command's words; where its Args have a field `given`, that holds the names of what was set.

    Prints the help and exits with `--help`; SettingsError for a wrong flag, and for a settings file, a preset
    or a name=value that does not fit.
    """
    kind = module.Args
    first = _first(kind, name, arguments)
    values = settings.from_toml(first.settings) if first.settings is not None else {}
    default = _default(kind, first, values)
    args = _read(kind, name, arguments, default=default, description=module.__doc__)
    _check_numbers(args)
    given = _given(arguments, args, default)
    for part in getattr(kind, "PARTS", ()):
        by_file = any(name in values and name not in given - {part.pairs} for name in part.fields)
        with _named(first.settings if by_file else None):
            part.resolved(args, values.get(part.pairs, {}))
        part.resolved(args, dict(getattr(args, part.pairs)))
    if hasattr(args, "given"):
        named = sorted(name.rpartition(".")[2] for name in {*given, *_keys(values)})
        args = dataclasses.replace(args, given=tuple(named))
    return Parsed(args, first.show_settings, first.settings, values, given)


def _first(kind: type[Any], name: str, arguments: list[str]) -> _First:
    """The flags that come first; none where the command takes no settings file."""
    if not issubclass(kind, SettingsFlags):
        return _First()
    first, _ = _read(_First, name, arguments, return_unknown_args=True, add_help=False)
    assert isinstance(first, _First)
    return first


def _default(kind: type[Any], first: _First, values: dict[str, Any]) -> Any:
    """What Args are without any flag: the defaults, under the preset, under the file."""
    fields, hints = dataclasses.fields(kind), get_type_hints(kind)
    base: dict[str, Any] = {
        # Where settings are only shown, it does not matter what would be worked on.
        field.name: _nothing(hints[field.name]) if first.show_settings else tyro.MISSING
        for field in fields
        if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
    }
    with _named(first.settings):
        settings.check_keys(values, {name: hints[name] for name in _names(kind) if name not in NOT_IN_FILES})
        of_file = settings.make(kind, values, kind(**base))
    preset = first.preset if first.preset is not None else getattr(of_file, "preset", None)
    for table, presets in getattr(kind, "TABLE_PRESETS", {}).items():
        base |= {table: presets[preset]} if preset in presets else {}
    with _named(first.settings):
        return settings.make(kind, values, kind(**base))


def _nothing(hint: Any) -> Any:
    """An empty value of a type: an empty path, text or tuple."""
    return (get_origin(hint) or hint)()


@contextlib.contextmanager
def _named(file: Path | None) -> Iterator[None]:
    """Names the settings file in what is wrong with it."""
    try:
        yield
    except SettingsError as error:
        raise SettingsError(f"{file}: {error}" if file is not None else str(error)) from error


def _names(kind: type[Any]) -> list[str]:
    return [field.name for field in dataclasses.fields(kind)]


def _positionals(kind: type[Any]) -> list[str]:
    """The fields that stand by themselves on the command line."""
    hints = get_type_hints(kind, include_extras=True)
    return [name for name in _names(kind) if tyro.conf.Positional in getattr(hints[name], "__metadata__", ())]


def _read(kind: type[Any], name: str, arguments: list[str], **more: Any) -> Any:
    """The arguments as a `kind`; SettingsError, one line, where they are wrong."""
    said = io.StringIO()
    registry = ConstructorRegistry()
    registry.primitive_rule(_without_none)
    try:
        with contextlib.redirect_stderr(said), registry:
            return tyro.cli(kind, prog=f"evplace {name}", args=arguments, **more)
    except SystemExit as stop:
        if not stop.code:
            raise
        message = _plain(said.getvalue())
        hint = _greedy(kind, arguments) if message.startswith("Missing from") else ""
        raise SettingsError(f"{message}{hint}; see evplace {name} --help") from None


def _without_none(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    """`tuple[int, int] | None` takes two words, as `tuple[int, int]` does: None is said by no flag at all."""
    options = [option for option in get_args(info.type) if option is not NoneType]
    if get_origin(info.type) not in (Union, UnionType) or len(options) != 1:
        return None
    spec = ConstructorRegistry.get_primitive_spec(PrimitiveTypeInfo.make(options[0], info.markers))
    if not isinstance(spec, PrimitiveConstructorSpec):
        return None
    return dataclasses.replace(
        spec,
        is_instance=lambda value: value is None or spec.is_instance(value),
        str_from_instance=lambda value: ["none"] if value is None else spec.str_from_instance(value),
    )


def _plain(message: str) -> str:
    """Tyro's framed message as one line, without its title and the help that it adds."""
    lines = (line.strip("│╭╮╰╯─ \n") for line in message.splitlines())
    _, *said = [line for line in lines if line.strip("-")] or [""]
    ends = ("Argument helptext", "For full helptext")
    kept = itertools.takewhile(lambda line: not line.startswith(ends), said)
    return " ".join(kept).rstrip(".") or "the flags cannot be read"


def _greedy(kind: type[Any], arguments: list[str]) -> str:
    """A hint where a flag that takes any number of words may have taken those that stand by themselves."""
    hints = {name: get_args(hint) for name, hint in get_type_hints(kind).items()}
    lists = [name for name, inner in hints.items() if Ellipsis in inner and isinstance(inner[0], type)]
    taken = sorted(_flag(name) for name in lists if _is_given(name, arguments))
    return f"; {taken[0]} takes all words after it: put what stands by itself before it" if taken else ""


def _check_numbers(given: object) -> None:
    """SettingsError where a flag is a float that is no number."""
    for name, value in _flat(given).items():
        if isinstance(value, float) and math.isnan(value):
            raise SettingsError(f"{_flag(name.rpartition('.')[2])} cannot be nan: it takes a number")


def _flat(given: object) -> dict[str, Any]:
    """The fields of a dataclass by name, those of one within it as `windows.dt`."""
    names = [field.name for field in dataclasses.fields(given)]  # type: ignore[arg-type]  # Args are dataclasses
    return _flat_tables({name: getattr(given, name) for name in names})


def _flat_tables(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values by name, those of a dataclass among them as `windows.dt`."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        inner = _flat(value) if dataclasses.is_dataclass(value) else None
        found |= {name: value} if inner is None else {f"{name}.{key}": inner[key] for key in inner}
    return found


def _keys(values: Mapping[str, Any]) -> list[str]:
    """The names in a settings file, those in its tables as `windows.dt`."""
    found = []
    for key, value in values.items():
        found += [f"{key}.{name}" for name in value] if isinstance(value, Mapping) else [key]
    return found


def _given(arguments: list[str], args: object, default: object) -> set[str]:
    """The settings that flags gave, those among them that gave the very default."""
    now, before = _flat(args), _flat(default)
    return {
        name for name in now if now[name] != before[name] or _is_given(name.rpartition(".")[2], arguments)
    }


def _is_given(name: str, arguments: list[str]) -> bool:
    """Whether a field's long flag is among the arguments; no value of another flag can look like it."""
    words = itertools.takewhile(lambda word: word != "--", arguments)
    heads = {word.partition("=")[0].replace("_", "-") for word in words if word.startswith("--")}
    return not heads.isdisjoint((_flag(name), _flag(f"no_{name}")))


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"
