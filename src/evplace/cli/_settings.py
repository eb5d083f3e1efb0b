"""What commands that take settings have in common: a settings file, name=value flags, choices of parts."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

import tyro
from tyro.constructors import PrimitiveConstructorSpec

from evplace.core import families, settings
from evplace.core.errors import SettingsError

NAME = "{name}"
"""In the path of a log, a mask and so on: the name of that of many drives to which it belongs."""


def pair(text: str) -> tuple[str, object]:
    """`K=5` as ("K", 5): the value is read as TOML, or as text where it is not TOML."""
    key, equals, value = text.partition("=")
    if not equals or not key:
        raise SettingsError(f"cannot read the setting '{text}': write it as name=value, for example K=5")
    try:
        return key, tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return key, value


_PAIR = PrimitiveConstructorSpec(
    nargs=1,
    metavar="NAME=VALUE",
    instance_from_str=lambda words: pair(words[0]),
    is_instance=lambda value: isinstance(value, tuple),
    str_from_instance=lambda value: [f"{value[0]}={value[1]}"],
)
Pairs = Annotated[
    tuple[Annotated[tuple[str, object], _PAIR], ...],
    tyro.conf.UseAppendAction,
    tyro.conf.arg(help_behavior_hint="(repeatable; a table in a settings file)"),
]
"""Settings by name, given one a flag; those of a file come first."""


def a_part_of(family: str) -> object:
    """The marker of a flag that names a part of a family: its help shows all of them."""
    return tyro.conf.arg(metavar=f"{{{','.join(families.names(family))}}}")


def a_preset_of(family: str | Mapping[str, object]) -> object:
    """The marker of a flag that names a preset, of any part of a family or of these: its help shows all."""

    def shown(default: str) -> str:  # called only for the help: a family's presets take time to look up
        presets = _presets_of(family) if isinstance(family, str) else list(family)
        return f"({', '.join(presets)}; default: {default})"

    return tyro.conf.arg(metavar="NAME", help_behavior_hint=shown)


def _presets_of(family: str) -> list[str]:
    """The presets of a family's parts, each with its part: `paper (local)`."""
    parts: dict[str, list[str]] = {}
    for name, _ in families.loadable(family):
        for preset in families.settings_of(family, name)[1]:
            parts.setdefault(preset, []).append(name)
    return [f"{preset} ({', '.join(names)})" for preset, names in sorted(parts.items())]


@dataclass(frozen=True)
class Part:
    """Settings that are given as name=value: those of a part that other flags choose."""

    pairs: str
    """The field of Args that holds them."""
    preset: str
    """The field that names the preset; empty where the part has none."""
    chooser: str
    """The field that chooses the part; empty where there is but one."""
    chosen: Callable[[Any], tuple[str, type[Any], Mapping[str, Any]] | None]
    """Args -> the part in words, its settings' dataclass and its presets; None where no part is chosen."""

    @property
    def fields(self) -> tuple[str, str, str]:
        """The fields of Args that say what the part's settings are."""
        return self.pairs, self.preset, self.chooser

    @classmethod
    def of(
        cls,
        family: str,
        word: str,
        pairs: str = "set",
        preset: str = "",
        usual: Callable[[Any], str] | None = None,
    ) -> Part:
        """The part of a family that the flag `word` names, or where it names none, `usual` of the Args."""

        def chosen(args: Any) -> tuple[str, type[Any], Mapping[str, Any]]:
            name = getattr(args, word) or (usual(args) if usual is not None else "")
            return (f"the {word} '{name}'", *families.settings_of(family, name))

        return cls(pairs, preset, word, chosen)

    def resolved(self, args: Any, values: Mapping[str, object]) -> object | None:
        """The part's settings, `values` over its preset; SettingsError for a wrong preset, name or value."""
        found = self.chosen(args)
        if found is None:
            return None
        made: object = settings.make(found[1], values, self._preset(args))
        return made

    def in_force(self, args: Any, of_file: Mapping[str, object], file: str) -> dict[str, tuple[object, str]]:
        """Setting, as `set.K` -> its value and source; `of_file` are those that the settings file gave."""
        given = getattr(args, self.pairs)
        made, preset = self.resolved(args, dict(given)), self._preset(args)
        if made is None:
            return {}
        changed = settings.changed(preset) if preset is not None else []
        sources = dict.fromkeys(changed, f"preset {getattr(args, self.preset, None)}")
        sources |= dict.fromkeys(of_file, file) | {name: "flag" for name, _ in given[len(of_file) :]}
        # What is made of settings is a dataclass, which its type does not say.
        names = [field.name for field in dataclasses.fields(made)]  # type: ignore[arg-type]  # a dataclass
        return {f"{self.pairs}.{name}": (getattr(made, name), sources.get(name, "default")) for name in names}

    def _preset(self, args: Any) -> object | None:
        found = self.chosen(args)
        if found is None or not self.preset:
            return None
        preset: object | None = settings.preset_of(found[0], found[2], getattr(args, self.preset))
        return preset


@dataclass(frozen=True, kw_only=True)
class SettingsFlags:
    """Where settings come from, besides the flags themselves."""

    PARTS: ClassVar[tuple[Part, ...]] = ()
    TABLE_PRESETS: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    """Table of settings -> its presets, of which the flag --preset names one."""

    settings: Path | None = None
    """A TOML file with any of these settings, named as --show-settings names them; flags win over it."""
    show_settings: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Print every setting and where it came from, and do nothing else."""

    def brought(self) -> dict[str, Any]:
        """Tables of settings that the input brings with it, in place of the defaults."""
        return {}
