"""Columns of numbers, as numpy, HDF5 or text files hold them, made into events: units, signs, widths."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import RecordingError
from evplace.sources.readers._source import Block, Hints

US_PER_UNIT = {"s": 1e6, "ms": 1e3, "us": 1.0, "ns": 1e-3}
NAMES = {
    "t": ("t_us", "t_ns", "t_ms", "t_s", "t", "ts", "time", "times", "timestamp", "timestamps"),
    "x": ("x", "xs", "x_coordinates"),
    "y": ("y", "ys", "y_coordinates"),
    "p": ("p", "ps", "pol", "polarity", "polarities", "on"),
}
"""Field -> the names under which files hold it, the clearest first."""
NOWHERE = 0xFFFF
"""A coordinate beyond any sensor: stands for numbers that a pixel cannot have."""


def named(names: list[str]) -> dict[str, str] | None:
    """Field -> its name among `names`, None where one of the four is missing."""
    small = {name.lower(): name for name in names}
    found = {field: next((small[n] for n in usual if n in small), None) for field, usual in NAMES.items()}
    return {field: name for field, name in found.items() if name is not None} if all(found.values()) else None


def time_unit(name: str, sample: NDArray[Any], hints: Hints) -> tuple[str, list[str]]:
    """The unit of time and the note on it, from the caller, the field's name, else the numbers.

    Whole numbers are taken as microseconds and fractions as seconds, where the events then come at a rate
    that only that unit makes likely. RecordingError where it could as well be another.
    """
    if hints.time_unit is not None:
        return hints.time_unit, []
    suffix = name.rpartition("_")[2]
    if "_" in name and suffix in US_PER_UNIT:
        return suffix, []
    unit = "us" if np.issubdtype(sample.dtype, np.integer) else "s"
    finite = sample[np.isfinite(sample)].astype(np.float64)
    span_s = (finite[-1] - finite[0]) * US_PER_UNIT[unit] / 1e6 if len(finite) else 0.0
    rate = len(sample) / span_s if span_s > 0 else 0.0
    low, high = (2e4, 1e9) if unit == "us" else (10.0, 1e9)
    if not low <= rate <= high:
        raise RecordingError(
            f"the unit of '{name}' is not clear: as {unit} it makes {rate:.3g} events/s: give the time unit"
        )
    return unit, [f"times in '{name}' are taken as {unit}: that makes {rate:.3g} events/s"]


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
