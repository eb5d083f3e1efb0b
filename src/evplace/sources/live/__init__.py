"""Live sources: events as they come, from a camera, a network, or a file at its own pace. One file a kind.

A source is given as an address, KIND:WHERE, such as `udp:0.0.0.0:3333`; a path alone is a replay, and `-` is
standard input. A file holds a frozen dataclass of the file's name, whose first field is `where` and whose
other fields are settings, each with a default. Its `open(size)`, where `size` is the sensor's if that is
known, gives a `Live`: an object with two methods.

- `blocks()` yields events as they come, decoded, not checked: a `Block`; `None` at least every WAIT_S in
  which none came, so that its caller can look at the clock; ANEW where the times begin anew. It ends with
  the source, and raises DamagedRecordingError or RecordingError where the source cannot go on.
- `close()` may be called from another thread: `blocks()` ends soon after.

It may say more of itself, as attributes; where it does not, those of `Facts` are taken.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Protocol

from evplace.core import families, settings
from evplace.core.errors import PartError, SettingsError
from evplace.core.events import Size
from evplace.sources.readers import Block

__all__ = ["ANEW", "WAIT_S", "Anew", "Facts", "Item", "Live", "Source", "address", "open_live", "source_of"]

WAIT_S = 0.05
"""Seconds after which a source that has nothing says so."""


class Anew(Enum):
    """A mark between events."""

    ANEW = "the sensor's times begin anew"


ANEW = Anew.ANEW
Item = Block | Anew | None
"""What a source gives: events; that times begin anew; that nothing came."""


class Live(Protocol):
    """An opened source."""

    def blocks(self) -> Iterator[Item]:
        """Events as they come: see the docstring of this package."""

    def close(self) -> None:
        """Have `blocks` end soon."""


@dataclass(frozen=True)
class Facts:
    """What a source may say of itself, and what is taken where it does not."""

    size: Size | None = None
    """(width, height) of the sensor, where the source knows it."""
    pace: float = 1.0
    """Seconds of the sensor's time that pass in one second; 0 where the two have nothing to do with each
    other, as in a file that is read as fast as it goes."""
    waits: bool = False
    """Whether events wait until they are taken, as a file's do; others that come too fast are dropped."""
    lost: int = 0
    """How often the source itself has lost events, and how many network packets could not be used."""
    notes: Sequence[str] = ()
    """What was guessed, a sentence each."""

    @classmethod
    def of(cls, live: Live) -> Facts:
        """What it says by now."""
        names = [field.name for field in dataclasses.fields(cls)]
        return cls(**{name: getattr(live, name) for name in names if hasattr(live, name)})


class Source(Protocol):
    """A kind of source with its settings."""

    def open(self, size: Size | None) -> Live:
        """Begin; RecordingError where that cannot be, MissingExtraError where a package is missing."""


def address(text: str) -> tuple[str, str]:
    """The kind and the place that an address names: `udp:0.0.0.0:3333` -> ("udp", "0.0.0.0:3333")."""
    if text == "-":
        return "stdin", ""
    kind, colon, where = text.partition(":")
    if colon and kind in families.names("live") and not Path(text).exists():
        return kind, where.removeprefix("//")
    if "://" in text or (colon and len(kind) > 1 and kind.isalpha() and not Path(text).exists()):
        raise SettingsError(
            f"'{kind}' of {text} is no kind of live source, and there is no such file: known are "
            f"{', '.join(families.names('live'))}"
        )
    return "replay", text


def source_of(text: str, values: Mapping[str, object] = {}) -> Source:
    """The source at an address, with its settings; SettingsError for an unknown setting."""
    kind, where = address(text)
    part: type[Any] = families.load("live", kind)
    made: Source = settings.make(part, {"where": where, **values})
    return made


def open_live(text: str, size: Size | None = None, **values: object) -> Live:
    """Open the source at an address, for a sensor of `size` where that is known, with its settings."""
    source = source_of(text, values)
    with families.blaming("live", source):
        live = source.open(size)
    missing = [name for name in ("blocks", "close") if not callable(getattr(live, name, None))]
    if missing:
        raise PartError(f"{families.described('live', source)} must open an object that has {missing[0]}()")
    return live
