"""Columns of numbers, as numpy, HDF5 or text files hold them, made into events: units, signs, widths."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import RecordingError
from evplace.sources.readers import _order
from evplace.sources.readers._source import Block, Hints, printable

US_PER_UNIT = {"s": 1e6, "ms": 1e3, "us": 1.0, "ns": 1e-3}
UNIT_WORDS = {
    "s": "s", "sec": "s", "secs": "s", "second": "s", "seconds": "s",
    "ms": "ms", "msec": "ms", "millisecond": "ms", "milliseconds": "ms",
    "us": "us", "usec": "us", "microsecond": "us", "microseconds": "us",
    "ns": "ns", "nsec": "ns", "nanosecond": "ns", "nanoseconds": "ns",
}  # fmt: skip
"""Words in a name or an attribute -> the unit."""
RATES = (1e3, 1e9)
"""Events a second that a camera sends, from a still scene to more than any link carries."""
SLOWEST = 2e4
"""Events a second below which whole numbers might be milliseconds or nanoseconds as well."""
SLOW = 100.0
"""Events a second below which whole numbers cannot be microseconds, nor fractions of more than three places
seconds: a camera's clock ticks in microseconds."""
CENTURY_S = (946_684_800, 4_102_444_800)
"""Seconds from 1970 to the years 2000 and 2100."""
NOWHERE = 0xFFFF
"""A coordinate beyond any sensor: stands for numbers that a pixel cannot have."""


def time_unit(name: str, sample: NDArray[Any], hints: Hints) -> tuple[str, list[str]]:
    """The unit of time and the note on it, from the caller, the field's name, else the numbers.

    Times since 1970 have a unit each. Others are microseconds where they are whole, and seconds where they
    have fractions, if the events then come at a rate that only that unit makes likely; nanoseconds where
    microseconds would make next to none. RecordingError where it could as well be another.
    """
    if hints.time_unit is not None:
        return hints.time_unit, []
    name = printable(name)
    stated = [UNIT_WORDS[word] for word in _order.words_of(name) if word in UNIT_WORDS]
    if len(stated) == 1:
        return stated[0], []
    unit, rate, slowest = _likely(sample[np.isfinite(sample)].astype(np.float64))
    if not slowest <= rate <= RATES[1]:
        raise RecordingError(
            f"the unit of '{name}' is not clear: as {unit} it makes {rate:.3g} events/s: give `time_unit`, "
            f"as in `time_unit=us`"
        )
    return unit, [f"times in '{name}' are taken as {unit}: that makes {rate:.3g} events/s"]


def _likely(times: NDArray[np.float64]) -> tuple[str, float, float]:
    """The likeliest unit, the events a second that it makes, and how many it must make not to be in doubt."""
    if not len(times) or times[-1] <= times[0]:
        return "us", 0.0, SLOWEST
    way, whole = float(times[-1] - times[0]), bool(np.all(times == np.rint(times)))
    rates = {unit: len(times) * 1e6 / (way * us) for unit, us in US_PER_UNIT.items()}
    for unit, rate in rates.items():
        if _since_1970(float(times[0]), unit) and RATES[0] <= rate <= RATES[1]:
            return unit, rate, RATES[0]
    if not whole:
        coarse = bool(np.allclose(times * 1e3, np.rint(times * 1e3), rtol=0, atol=1e-6))
        return "s", rates["s"], RATES[0] if coarse else SLOW
    unit = "ns" if rates["us"] < SLOW and rates["ns"] >= SLOWEST else "us"
    return unit, rates[unit], SLOWEST


def _since_1970(time: float, unit: str) -> bool:
    """Whether a time is one of this century, counted from 1970."""
    return CENTURY_S[0] < time * US_PER_UNIT[unit] / 1e6 < CENTURY_S[1]


def of_rows(rows: Mapping[str, NDArray[Any]], unit: str, part_ns: int = 1) -> Block:
    """Events from rows t, x, y and p; with `part`, the time is whole seconds and parts of `part_ns` each."""
    found = block(rows["t"], rows["x"], rows["y"], rows["p"], unit)
    if "part" not in rows:
        return found
    return found._replace(t_us=found.t_us + rows["part"].astype(np.int64) * part_ns // 1000)


def block(t: NDArray[Any], x: NDArray[Any], y: NDArray[Any], p: NDArray[Any], unit: str) -> Block:
    """Events from columns of any type; times that are no numbers are left out and counted as untimed."""
    finite = np.isfinite(t) if t.dtype.kind == "f" else np.ones(len(t), np.bool_)
    untimed = int(len(t) - np.count_nonzero(finite))
    if untimed:
        t, x, y, p = t[finite], x[finite], y[finite], p[finite]
    return Block(_microseconds(t, unit), _pixels(x), _pixels(y), _polarities(p), untimed)


def _microseconds(t: NDArray[Any], unit: str) -> NDArray[np.int64]:
    if t.dtype.kind == "f":
        limit = 2.0**62
        with np.errstate(over="ignore"):
            return np.rint(np.clip(t.astype(np.float64) * US_PER_UNIT[unit], -limit, limit)).astype(np.int64)
    if unit == "ns":
        return t.astype(np.int64) // 1000
    factor = int(US_PER_UNIT[unit])
    whole = t.astype(np.int64)
    return whole if factor == 1 else np.clip(whole, -(2**62) // factor, 2**62 // factor) * factor


def _pixels(values: NDArray[Any]) -> NDArray[np.uint16]:
    if values.dtype == np.uint16:
        return np.ascontiguousarray(values, np.uint16)
    if values.dtype.kind == "f":
        values = np.rint(np.nan_to_num(values, nan=-1.0, posinf=-1.0, neginf=-1.0))
    outside = (values < 0) | (values >= NOWHERE)
    return np.where(outside, NOWHERE, values).astype(np.uint16)


def _polarities(values: NDArray[Any]) -> NDArray[np.bool_]:
    return np.ascontiguousarray(values > 0)
