"""NMEA 0183 logs: RMC sentences (dates, status, course), or GGA where a log has no RMC.

Each sentence's checksum, RMC's status and mode and GGA's quality are checked: without a fix a sentence
parses happily.
"""

from __future__ import annotations

import datetime
import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evplace.core.errors import TrackError
from evplace.sources.tracks._fixes import Fix, Fixes, unroll_days

_SENTENCE = re.compile(rb"\$[A-Z]{2}(?:RMC|GGA),[^\r\n$]*")
_START = re.compile(rb"^\s*\$[A-Z]{2}[A-Z]{3},", re.MULTILINE)
_MIN_KNOTS = 2.0
"""A receiver's course below 1 m/s is noise."""
_EPOCH = datetime.date(1970, 1, 1)


@dataclass(frozen=True, slots=True)
class Settings:
    """NMEA needs none."""


PRESETS: dict[str, Settings] = {}


def recognises(head: bytes) -> bool:
    """Whether a line starts like a sentence and one of them carries positions."""
    return bool(_START.search(head)) and bool(_SENTENCE.search(head))


def read(path: Path, settings: Settings) -> Fixes:
    """All fixes of the log; sentences without one, and damaged ones, are counted."""
    del settings
    dropped: Counter[str] = Counter()
    sentences = list(_sentences(path.read_bytes(), dropped))
    dated = [sentence for sentence in sentences if sentence.msgID == "RMC"]
    without = {sentence.time for sentence in sentences if sentence.msgID == "GGA" and not sentence.quality}
    if not dated:
        return _undated(sentences, dropped)
    fixes = []
    for sentence in dated:
        valid = sentence.status == "A" and getattr(sentence, "posMode", "A") != "N"
        if valid and sentence.time not in without and _complete(sentence) and sentence.date:
            fixes.append(_fix(sentence, (sentence.date - _EPOCH).days))
        else:
            dropped["no fix"] += 1
    return Fixes.of(fixes, dict(dropped))


def _sentences(text: bytes, dropped: Counter[str]) -> Iterator[Any]:
    """The RMC and GGA sentences whose checksum is right."""
    from pynmeagps import VALCKSUM, VALMSGID, NMEAReader
    from pynmeagps.exceptions import NMEAMessageError, NMEAParseError, NMEAStreamError, NMEATypeError

    for found in _SENTENCE.finditer(text):
        try:
            yield NMEAReader.parse(found.group(), validate=VALCKSUM | VALMSGID)
        except (NMEAMessageError, NMEAParseError, NMEAStreamError, NMEATypeError, ValueError):
            dropped["damaged sentence"] += 1


def _undated(sentences: list[Any], dropped: Counter[str]) -> Fixes:
    """GGA sentences; their times count from the midnight before the first."""
    if not sentences:
        raise TrackError(f"no RMC or GGA sentence can be read, {dropped['damaged sentence']} are damaged")
    good = [sentence for sentence in sentences if sentence.quality and _complete(sentence)]
    dropped["no fix"] += len(sentences) - len(good)
    fixes = Fixes.of([_fix(sentence, 0) for sentence in good], dict(+dropped))
    t_us = unroll_days(fixes.t_us)
    return Fixes(t_us, fixes.latitude, fixes.longitude, fixes.heading_deg, fixes.dropped)


def _complete(sentence: Any) -> bool:
    """An empty field arrives as ''."""
    numbers = isinstance(sentence.lat, float) and isinstance(sentence.lon, float)
    return numbers and isinstance(sentence.time, datetime.time)


def _fix(sentence: Any, days: int) -> Fix:
    time = sentence.time
    seconds = ((days * 24 + time.hour) * 60 + time.minute) * 60 + time.second
    return Fix(seconds * 1_000_000 + time.microsecond, sentence.lat, sentence.lon, _course(sentence))


def _course(sentence: Any) -> float:
    """Degrees; NaN where there is none or the receiver hardly moves."""
    speed, course = getattr(sentence, "spd", ""), getattr(sentence, "cog", "")
    known = isinstance(speed, float) and isinstance(course, float) and speed >= _MIN_KNOTS
    return float(course) if known else math.nan
