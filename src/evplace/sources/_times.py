"""Times as text or numbers -> microseconds. Every number is bounded before it is computed with."""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterable
from decimal import Decimal
from typing import Literal

Unit = Literal["s", "ms", "us", "ns"]

UNIT_US: dict[str, Decimal] = {
    "s": Decimal(1_000_000), "ms": Decimal(1000), "us": Decimal(1), "ns": Decimal("0.001"),
}  # fmt: skip
"""Microseconds in one of each unit."""
DAY_US = 86_400_000_000
DATED_US = (631_152_000_000_000, 4_102_444_800_000_000)
"""1990 and 2100: a number is a date between them in one unit at most, as units are a factor of 1000 apart."""

_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
_MICROSECOND = datetime.timedelta(microseconds=1)
_NUMBER = re.compile(r"[+-]?(?:[0-9]{1,30}(?:[.,][0-9]{0,30})?|[.,][0-9]{1,30})(?:[eE][+-]?[0-9]{1,3})?")
_CLOCK = re.compile(r"([0-9]{1,2}):([0-9]{2}):([0-9]{2})(?:[.,]([0-9]{1,12}))?")
_MAX_DIGITS = 18


def number(text: str) -> Decimal:
    """A number of reasonable length, with a point or a comma; ValueError for any other text."""
    text = text.strip()
    if not _NUMBER.fullmatch(text):
        raise ValueError(text)
    value = Decimal(text.replace(",", "."))
    if value and value.adjusted() > 2 * _MAX_DIGITS:
        raise ValueError(text)
    return value


def number_us(text: str, unit: str) -> int:
    """A number of the unit as whole microseconds; ValueError where it is none, or too large for any clock."""
    t_us = number(text) * UNIT_US[unit]
    if t_us and t_us.adjusted() > _MAX_DIGITS - 1:
        raise ValueError(text)
    return int(t_us.to_integral_value())


def dated_unit(numbers: Iterable[Decimal]) -> Unit | None:
    """The unit in which the middle one of the numbers is a date between 1990 and 2100; None where none is."""
    ordered = sorted(numbers)
    middle = ordered[len(ordered) // 2] if ordered else Decimal(0)
    units: tuple[Unit, ...] = ("s", "ms", "us", "ns")
    fit = [unit for unit in units if DATED_US[0] <= middle * UNIT_US[unit] <= DATED_US[1]]
    return fit[0] if fit else None


def iso_us(text: str) -> int:
    """A date with a time (ISO 8601, also with a space, slashes or digits alone) as microseconds since 1970.

    A time without a zone is UTC. ValueError where it cannot be read.
    """
    plain = re.sub(r"\s*(UTC|GMT)$", "Z", text.strip())
    if re.match(r"[0-9]{4}/", plain):
        plain = plain.replace("/", "-", 2)
    plain = re.sub(r"^([0-9]{8})([0-9]{6}(?:[.,][0-9]*)?)$", r"\1T\2", plain)
    if len(plain) > 64 or not re.match(r"[0-9]{4}-?[0-9]{2}-?[0-9]{2}[T ][0-9]", plain):
        raise ValueError(text)
    found = datetime.datetime.fromisoformat(plain)
    aware = found if found.tzinfo else found.replace(tzinfo=datetime.UTC)
    return (aware - _EPOCH) // _MICROSECOND


def clock_us(text: str) -> int:
    """HH:MM:SS as microseconds since midnight; ValueError where it cannot be read."""
    found = _CLOCK.fullmatch(text.strip())
    if not found:
        raise ValueError(text)
    return of_day_us(found[1], found[2], found[3], found[4] or "0")


def of_day_us(hours: str, minutes: str, seconds: str, part: str = "0") -> int:
    """Digits of a time of day as microseconds, `part` those after the point; a leap second is second 60."""
    if int(hours) > 23 or int(minutes) > 59 or int(seconds) > 60:
        raise ValueError(f"{hours}:{minutes}:{seconds}")
    whole = (int(hours) * 60 + int(minutes)) * 60 + int(seconds)
    return whole * 1_000_000 + int(part[:6].ljust(6, "0"))


def day_of(date: str) -> int:
    """YYYY-MM-DD as days since 1970; ValueError where it is none."""
    return (datetime.date.fromisoformat(date) - _EPOCH.date()).days
