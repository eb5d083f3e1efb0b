"""NMEA 0183 logs: RMC sentences (dates, status, speed, course), or GGA, GNS or GLL where a log has no RMC.

Each sentence's checksum, its status, mode or quality are checked: without a fix a sentence reads like any
other. What a logger wrote before a sentence is passed over; its date, or that of a ZDA sentence, dates
sentences that have none.
"""

from __future__ import annotations

import functools
import math
import operator
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from evplace.core.errors import TrackError
from evplace.sources._times import DAY_US, dated_unit, day_of, iso_us, number, number_us, of_day_us
from evplace.sources.tracks._fixes import Fix, Fixes, Losses, line_of, unroll_days

_SENTENCE = re.compile(r"\$([A-Z]{2}(RMC|GGA|GNS|GLL|ZDA|VTG),[^*$]*)(?:(\*)([0-9A-Fa-f]{2})?)?")
_START = re.compile(rb"^[ -~\t]{0,80}?\$[A-Z]{2}(?:RMC|GGA|GNS|GLL),", re.MULTILINE)
_TIME = re.compile(r"([0-9]{2})([0-9]{2})([0-9]{2})(?:\.([0-9]{0,12}))?")
_DATE = re.compile(r"([0-9]{2})([0-9]{2})([0-9]{2})")
_ANGLE = re.compile(r"([0-9]{1,3})([0-9]{2}(?:\.[0-9]{0,12})?)")
_LOGGED = re.compile(r"[0-9]{4}[-/][0-9]{2}[-/][0-9]{2}[T ][0-9]{2}:[0-9]{2}:[0-9]{2}")
_UNIX = re.compile(r"[0-9]{9,19}(?:\.[0-9]{0,9})?")

_KNOT_MPS = 1852 / 3600
_MIN_KNOTS = 2.0
"""A receiver's course below 1 m/s is noise."""
_SHARE = 0.1
"""With so many sentences without a checksum, the log is written so; a few are damaged."""
_FIELDS = {"RMC": (1, 3, 10), "GGA": (1, 2, 7), "GNS": (1, 2, 7), "GLL": (5, 1, 7)}
"""Where time and latitude stand, and how many fields a sentence has at least, its name among them."""


@dataclass(frozen=True, slots=True)
class Settings:
    """NMEA needs none."""


PRESETS: dict[str, Settings] = {}


class Sentence(NamedTuple):
    """One sentence that is whole."""

    kind: str
    """RMC, GGA and so on."""
    fields: list[str]
    """The first is the sentence's name."""
    line: int
    logged: str
    """What a logger wrote before it."""


class Seen(NamedTuple):
    """What is known of a moment in the order of the file."""

    of_day_us: int
    days: int | None
    """Since 1970; None where only a time of day is known."""


def recognises(head: bytes) -> bool:
    """Whether a line holds a sentence with a position, whatever a logger wrote before it."""
    return bool(_START.search(head))


def read(path: Path, settings: Settings) -> Fixes:
    """All fixes of the log; sentences without one, and damaged ones, are counted."""
    del settings
    lines = re.split(r"\r\n|\r|\n", path.read_bytes().decode("latin-1"))
    losses, notes = Losses(), list[str]()
    show = line_of(lines)
    sentences = list(_whole(list(_sentences(lines)), losses, lines, notes))
    present = {sentence.kind for sentence in sentences}
    kind = next((kind for kind in _FIELDS if kind in present), None)
    if kind is None:
        raise TrackError(f"no RMC, GGA, GNS or GLL sentence can be read{losses}")
    found: list[Fix] = []
    seen: list[Seen] = []
    without = _without_fix(sentences)
    for sentence in sentences:
        try:
            moment = _moment(sentence)
            if sentence.kind == "VTG":
                _add_speed(found, sentence)
            elif sentence.kind == kind and _is_fix(sentence, without):
                found.append(_fix(sentence, len(seen)))
            elif sentence.kind == kind:
                losses.add("no fix", show(sentence.line))
        except ValueError:
            losses.add("damaged sentence", show(sentence.line))
            continue
        seen.extend([moment] if moment else [])
    return _dated(found, seen, Fixes.of([], show=show, losses=losses, notes=notes))


def _sentences(lines: list[str]) -> Iterator[tuple[Sentence, bool | None]]:
    """Each sentence, and whether its checksum is right; None without one."""
    for number_, line in enumerate(lines, 1):
        for found in _SENTENCE.finditer(line):
            sum_ = functools.reduce(operator.xor, found[1].encode("latin-1"))
            right = None if found[3] is None else found[4] is not None and int(found[4], 16) == sum_
            yield Sentence(found[2], found[1].split(","), number_, line[: found.start()]), right


def _whole(
    found: list[tuple[Sentence, bool | None]], losses: Losses, lines: list[str], notes: list[str]
) -> Iterator[Sentence]:
    """The sentences whose checksum is right, or that have none in a log that is written so."""
    bare = sum(right is None for _, right in found)
    unchecked = bare > _SHARE * len(found)
    if unchecked:
        notes.append(f"{bare:,} of {len(found):,} sentences have no checksum: they are taken unchecked")
    for sentence, right in found:
        needed = _FIELDS.get(sentence.kind, (0, 0, 5))[2]
        if (right or (right is None and unchecked)) and len(sentence.fields) >= needed:
            yield sentence
        else:
            losses.add("damaged sentence", line_of(lines)(sentence.line))


def _without_fix(sentences: list[Sentence]) -> set[str]:
    """The times at which a GGA says that there was no fix."""
    return {one.fields[1] for one in sentences if one.kind == "GGA" and one.fields[6] in ("0", "")}


def _is_fix(sentence: Sentence, without: set[str]) -> bool:
    fields = sentence.fields
    time, latitude, _ = _FIELDS[sentence.kind]
    if not all(fields[at] for at in (time, *range(latitude, latitude + 4))) or fields[time] in without:
        return False
    if sentence.kind == "RMC":
        return fields[2] == "A" and (len(fields) < 13 or fields[12] != "N")
    if sentence.kind == "GNS":
        return bool(fields[6].strip("N"))
    return fields[6] == "A" if sentence.kind == "GLL" else True


def _fix(sentence: Sentence, moment: int) -> Fix:
    """The fix of a sentence; in place of its time stands the number of its moment."""
    fields = sentence.fields
    at = _FIELDS[sentence.kind][1]
    latitude, longitude = _angle(fields[at], fields[at + 1]), _angle(fields[at + 2], fields[at + 3])
    knots, course = (_optional(text) for text in fields[7:9]) if sentence.kind == "RMC" else (math.nan,) * 2
    heading = course if knots >= _MIN_KNOTS else math.nan
    return Fix(moment, latitude, longitude, heading, knots * _KNOT_MPS, sentence.line)


def _add_speed(found: list[Fix], sentence: Sentence) -> None:
    """A VTG has no time of its own: its course and speed are those of the fix before it."""
    if found and math.isnan(found[-1].speed) and len(sentence.fields) > 5:
        knots, course = _optional(sentence.fields[5]), _optional(sentence.fields[1])
        heading = course if knots >= _MIN_KNOTS else math.nan
        found[-1] = found[-1]._replace(heading_deg=heading, speed=knots * _KNOT_MPS)


def _moment(sentence: Sentence) -> Seen | None:
    """When the sentence was made; None where it does not say."""
    fields = sentence.fields
    text = fields[1] if sentence.kind == "ZDA" else fields[_FIELDS.get(sentence.kind, (0,))[0]]
    if sentence.kind == "VTG" or not text:
        return None
    found = _TIME.fullmatch(text)
    if not found:
        raise ValueError(text)
    time = of_day_us(found[1], found[2], found[3], found[4] or "0")
    own = _own_day(sentence)
    return Seen(time, own if own is not None else _logged_day(sentence.logged, time))


def _own_day(sentence: Sentence) -> int | None:
    """The date of an RMC or ZDA, in days since 1970."""
    if sentence.kind == "ZDA" and all(sentence.fields[2:5]):
        day, month, year = sentence.fields[2:5]
        return day_of(f"{int(year):04}-{int(month):02}-{int(day):02}")
    if sentence.kind != "RMC" or sentence.fields[2] != "A" or not sentence.fields[9]:
        return None  # before its first fix, a receiver writes any date
    found = _DATE.fullmatch(sentence.fields[9])
    if not found:
        raise ValueError(sentence.fields[9])
    century = 19 if int(found[3]) >= 80 else 20
    return day_of(f"{century}{found[3]}-{found[2]}-{found[1]}")


def _logged_day(logged: str, time_us: int) -> int | None:
    """The day on which the time of day is nearest to what a logger wrote before the sentence."""
    date, unix = _LOGGED.search(logged), _UNIX.search(logged)
    try:
        if date:
            t_us = iso_us(date[0])
        elif unix and (unit := dated_unit([number(unix[0])])):
            t_us = number_us(unix[0], unit)
        else:
            return None
    except ValueError:
        return None
    return round((t_us - time_us) / DAY_US)


def _dated(found: list[Fix], seen: list[Seen], empty: Fixes) -> Fixes:
    """The fixes with their times: a time without a date is on the day nearest to the dated one before it."""
    times = np.array([moment.of_day_us for moment in seen], np.int64)
    days = np.array([-1 if moment.days is None else moment.days for moment in seen], np.int64)
    dated = bool((days >= 0).any())
    if dated:
        known = np.flatnonzero(days >= 0)
        near = known[np.clip(np.searchsorted(known, np.arange(len(days)), "right") - 1, 0, None)]
        anchors = times[near] + days[near] * DAY_US
        nearest = np.round((anchors - times) / DAY_US).astype(np.int64)
        times = times + DAY_US * np.where(days >= 0, days, nearest)
        _say_undated(days[[fix.t_us for fix in found]], empty.notes)
    else:
        times = unroll_days(times)
    fixes = [fix._replace(t_us=int(times[fix.t_us])) for fix in found]
    return Fixes.of(fixes, dated=dated, show=empty.show, losses=empty.losses, notes=empty.notes)


def _say_undated(days: np.ndarray, notes: list[str]) -> None:
    missing = int((days < 0).sum())
    if missing:
        notes.append(
            f"{missing:,} of {len(days):,} fixes have no date: each is on the day of the dated one before it"
        )


def _angle(text: str, side: str) -> float:
    """ddmm.mmmm and N, S, E or W in degrees; ValueError where it is none."""
    found = _ANGLE.fullmatch(text)
    if not found or side not in ("N", "S", "E", "W") or float(found[2]) >= 60:
        raise ValueError(text)
    degrees = int(found[1]) + float(found[2]) / 60
    return -degrees if side in "SW" else degrees


def _optional(text: str) -> float:
    """A number that may be missing: NaN."""
    try:
        return float(number(text))
    except ValueError:
        return math.nan
