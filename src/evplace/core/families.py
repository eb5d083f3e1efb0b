"""Families of interchangeable parts: readers, tracks, scorers, matchers and so on.

A family is a folder; a file in it is one part, and its name is the part's name. Other packages add parts by
entry points in the group `evplace.FAMILY`. No list anywhere names the parts. In some families a part is a
module of functions (a reader); in the others it is a class, a frozen dataclass of settings, found in its file
as the class with the file's name (`Local` in `local.py`).
"""

from __future__ import annotations

import functools
import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from typing import Any, NamedTuple

from evplace.core import settings
from evplace.core.errors import EvplaceError, PartError, SettingsError, UnsupportedError

MODULES = {
    "readers": "evplace.sources.readers",
    "writers": "evplace.sources.writers",
    "exports": "evplace.exports",
    "tracks": "evplace.sources.tracks",
    "datasets": "evplace.drives.datasets",
    "doctor": "evplace.doctor",
    "reproduction": "evplace_lab.reproduction",
}
"""Family -> folder, where a part is a module."""
CLASSES = {
    "live": "evplace.sources.live",
    "representations": "evplace.imaging.representations",
    "searchers": "evplace.searchers",
    "scorers": "evplace.scorers",
    "matchers": "evplace.matchers",
}
"""Family -> folder, where a part is a class."""
OURS = "evplace"


class Entry(NamedTuple):
    """A part as a list shows it."""

    name: str
    package: str
    """The package that it comes from."""
    about: str
    """The first paragraph of its description."""
    fault: str | None = None
    """Why it cannot be used."""


def names(family: str) -> list[str]:
    """The parts of a family, for example `names("matchers")`, sorted; our own and those of other packages."""
    return sorted({*_own(family), *_others(family)})


def load(family: str, name: str) -> Any:
    """The part `name` of a family: a module, or a class.

    SettingsError, with the known names, where there is none; PartError where another package's part cannot
    be loaded.
    """
    if name in _own(family):
        module = importlib.import_module(f"{_folder(family)}.{name.replace('-', '_')}")
        return module if family in MODULES else _class_of(module, name)
    if name in _others(family):
        return _load_other(family, _others(family)[name])
    raise SettingsError(f"'{name}' is none of the {family}: known are {', '.join(names(family))}")


def class_called(family: str, name: str) -> Any:
    """Our own class of that name, such as "Local" of the matchers; AttributeError where there is none."""
    for own in _own(family):
        if own.replace("-", "") == name.lower() and load(family, own).__name__ == name:
            return load(family, own)
    raise AttributeError(f"module '{_folder(family)}' has no attribute '{name}'")


def loadable(family: str) -> Iterator[tuple[str, Any]]:
    """Name and part of all that can be loaded, our own first: one that cannot does not stop the others."""
    for name in [*_own(family), *sorted(_others(family))]:
        try:
            yield name, load(family, name)
        except PartError:
            continue


def recognising(family: str, asks: Callable[[Any], bool], faults: list[EvplaceError]) -> Iterator[str]:
    """The names of the parts that `asks` is true of, our own first.

    One that cannot be loaded, or fails, stops no other; why it did goes into `faults`. UnsupportedError where
    a part of our own knows what is given, and that it cannot be used.
    """
    own = _own(family)
    for name in [*own, *sorted(_others(family))]:
        try:
            part = load(family, name)
            with blaming(family, part):
                found = asks(part)
        except EvplaceError as error:
            if name in own and isinstance(error, UnsupportedError):
                raise
            faults.append(error)
            continue
        if found:
            yield name


def besides(faults: Sequence[EvplaceError]) -> str:
    """What is added to "nothing recognises it" where some parts could not say."""
    return f"; besides, {faults[0]}" if faults else ""


def make(family: str, given: object, preset: str | None = None, values: Mapping[str, object] = {}) -> Any:
    """The part that is `given` by name, with `values` over the settings of its `preset`; or an object itself.

    SettingsError for an unknown name, preset or setting, and where an object comes with settings beside it.
    """
    if not isinstance(given, str):
        if preset is not None or values:
            raise SettingsError(
                f"settings beside the object {given!r}: put them into the object, or give its name"
            )
        return given
    kind, presets = settings_of(family, given)
    base = settings.preset_of(f"the {family.removesuffix('s')} '{given}'", presets, preset)
    return settings.make(kind, values, base)


def settings_of(family: str, name: str) -> tuple[type[Any], Mapping[str, Any]]:
    """The settings of a part, a dataclass, and its presets; SettingsError as `load`."""
    part = load(family, name)
    if family in CLASSES:
        return part, getattr(part, "presets", {})
    return part.Settings, getattr(part, "PRESETS", {})


def name_of(family: str, part: object) -> str:
    """The name of a module, a class, or an object's class in its family; its own name where it is in none."""
    module, kind = _origin(part)
    folder, _, file = module.rpartition(".")
    if folder == _folder(family):
        return file.replace("_", "-") if family in CLASSES else file
    for name, entry in _others(family).items():
        if entry.module == module and entry.attr in (None, kind):  # None: the part is the module itself
            return name
    return kind or file


def package_of(part: object) -> str:
    """The package that a module, a class, or an object's class comes from."""
    return _origin(part)[0].partition(".")[0]


def entries(family: str) -> list[Entry]:
    """All parts of a family as a list shows them, with those that cannot be loaded or are hidden, and why."""
    return [_entry(family, name) for name in names(family)] + [
        _hidden_entry(family, entry) for entry in _entry_points(family)[1]
    ]


@contextmanager
def blaming(family: str, part: object, *passed: type[Exception]) -> Iterator[None]:
    """Whatever another package's part raises within the block becomes one PartError that names it.

    Errors that evplace raises on purpose stay as they are, and those of the kinds `passed`.
    """
    ours: tuple[type[Exception], ...] = (EvplaceError, *passed)
    try:
        yield
    except ours:
        raise
    except Exception as error:
        if package_of(part).startswith(OURS):
            raise
        raise PartError(f"{described(family, part)} failed: {type(error).__name__}: {error}") from error


def described(family: str, part: object) -> str:
    """How a message names a part: what it is, its name, and the package where this is not ours."""
    package = package_of(part)
    origin = "" if package.startswith(OURS) else f" of the package {package}"
    return f"the {family.removesuffix('s')} '{name_of(family, part)}'{origin}"


def _folder(family: str) -> str:
    return MODULES.get(family) or CLASSES[family]


@functools.cache
def _own(family: str) -> tuple[str, ...]:
    """Looked up once: recognising a format asks for every reader, and a folder is slow to list."""
    package = importlib.import_module(_folder(family))
    found = (module.name for module in pkgutil.iter_modules(package.__path__))
    public = (name for name in found if not name.startswith("_"))
    return tuple(sorted(name.replace("_", "-") if family in CLASSES else name for name in public))


def _others(family: str) -> dict[str, EntryPoint]:
    """Parts of other packages."""
    return _entry_points(family)[0]


def installed(group: str) -> EntryPoints:
    """The entry points of all packages in a group such as "evplace.matchers"."""
    found: EntryPoints = _read_once().select(group=group)
    return found


@functools.cache
def _read_once() -> Any:  # before Python 3.12 they are no EntryPoints yet
    """To find those of one group opens a file of every package, as those of all groups do."""
    return entry_points()


@functools.cache
def _entry_points(family: str) -> tuple[dict[str, EntryPoint], list[EntryPoint]]:
    """Those of other packages by their names; and those whose name is ours, or a package's before them."""
    found: dict[str, EntryPoint] = {}
    hidden = []
    for entry in sorted(installed(f"evplace.{family}"), key=_distribution):
        if entry.name in _own(family) or entry.name in found:
            hidden.append(entry)
        else:
            found[entry.name] = entry
    return found, hidden


def _origin(part: object) -> tuple[str, str]:
    """The module that a part comes from, and the name of its class or function there; "" for a module."""
    if inspect.ismodule(part):
        return part.__name__, ""
    named: Any = part if inspect.isclass(part) or inspect.isroutine(part) else type(part)
    return str(named.__module__), str(named.__qualname__)


def _class_of(module: Any, name: str) -> Any:
    wanted = name.replace("-", "")
    return next(kind for key, kind in vars(module).items() if key.lower() == wanted and inspect.isclass(kind))


def _load_other(family: str, entry: EntryPoint) -> Any:
    try:
        return entry.load()
    except Exception as error:  # whatever another package's import may raise
        raise PartError(
            f"the {family.removesuffix('s')} '{entry.name}' of the package {_distribution(entry)} cannot be "
            f"loaded: {type(error).__name__}: {error}"
        ) from error


def _distribution(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else entry.module.partition(".")[0]


def _entry(family: str, name: str) -> Entry:
    other = _others(family).get(name)
    package = OURS if other is None else _distribution(other)
    try:
        part = load(family, name)
    except PartError as error:
        return Entry(name, package, "", str(error))
    # A class's own description is of its settings; that of its file says what the part is.
    about = inspect.getmodule(part) if family in CLASSES and other is None else part
    summary = (inspect.getdoc(about) or "").split("\n\n")[0].replace("\n", " ")
    needs = f" Needs {part.NEEDS}." if family == "datasets" else ""
    return Entry(name, package, summary + needs)


def _hidden_entry(family: str, entry: EntryPoint) -> Entry:
    package, other = _distribution(entry), _others(family).get(entry.name)
    first = "evplace's own" if other is None else f"that of the package {_distribution(other)}"
    fault = f"hidden by {first}: the package {package} must give its {family.removesuffix('s')} another name"
    return Entry(f"{entry.name} ({package})", package, "", fault)
