"""Which column is which: as the caller says, by the columns' names, else by their values.

By values: the polarity is -1, 0 or 1, the time rises, pixels are whole numbers, and x stands before y, unless
only the other way round fits the sensor. What could be read in two ways is an error that asks; what was told
by values is noted.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.events import Size

NAMES = {
    "t": ("t_us", "t_ns", "t_ms", "t_s", "t", "ts", "time", "times", "timestamp", "timestamps"),
    "x": ("x", "xs", "x_coordinates"),
    "y": ("y", "ys", "y_coordinates"),
    "p": ("p", "ps", "pol", "polarity", "polarities", "on"),
}
"""Field -> the names under which files hold it, the clearest first."""
WORDS = {
    "t": {"t", "ts", "time", "times", "timestamp", "timestamps", "stamp", "stamps"},
    "x": {"x", "xs", "xpos", "posx", "xcoord", "col", "column"},
    "y": {"y", "ys", "ypos", "posy", "ycoord", "row"},
    "p": {"p", "ps", "pol", "polarity", "polarities", "on", "sign"},
    "sec": {"sec", "secs", "second", "seconds"},
    "nsec": {"nsec", "nsecs", "nanosec", "nanosecs", "nanosecond", "nanoseconds"},
    "usec": {"usec", "usecs", "microsec", "microsecs", "microsecond", "microseconds"},
}
"""Field -> the words that stand for it in longer names, such as x_pos or event_timestamp."""
RISING = 0.9
"""Share of its whole way by which a clock gets ahead: it hardly ever turns back."""
MANY = 5000
"""Rows that reach most of a sensor's pixels."""
TALL = 1.1
"""Sensors are wider than tall, or square: y does not reach so much farther than x."""
FARTHER = 4
"""How much longer the way of the time is than that of a column of pixels that happens to rise."""
EPOCH_S = 1e8
"""Whole seconds since 1970 are more than this."""


class Order(NamedTuple):
    """The places of the columns."""

    t: int
    x: int
    y: int
    p: int
    part: int | None = None
    """The parts of a second, where `t` holds whole seconds."""
    part_ns: int = 1
    """How many nanoseconds such a part is."""

    def words(self, count: int) -> str:
        """As `columns` would say it of a table of that many columns."""
        named = {self.t: "t", self.x: "x", self.y: "y", self.p: "p"}
        if self.part is not None:
            named |= {self.t: "sec", self.part: "nsec" if self.part_ns == 1 else "usec"}
        return ",".join(named.get(column, "-") for column in range(count))

    def note(self, count: int) -> str:
        """What is to be said where the values told it."""
        return f"columns are taken as {self.words(count)} by their values: if wrong, give `columns=t,x,y,p`"


class UnclearError(ValueError):
    """The columns could be read in two ways; the text says which."""


def said(columns: Sequence[str]) -> Order:
    """The order that the caller gives."""
    return _order({name: number for number, name in enumerate(columns)})


def named(names: Sequence[str]) -> dict[str, int]:
    """Field -> the place of the name that stands for it, for as many fields as have one.

    The time is t, or sec with nsec or usec. Raises UnclearError where several columns have one name.
    """
    small = [name.strip().lower() for name in names]
    found: dict[str, int] = {}
    for field, words in WORDS.items():
        exact = [small.index(name) for name in NAMES.get(field, ()) if name in small]
        if exact and small.count(small[exact[0]]) > 1:
            raise UnclearError(f"several columns are called '{small[exact[0]]}'")
        likely = [n for n, name in enumerate(small) if set(words_of(name)) & words]
        likely = [n for n in likely if "event" in small[n]] or likely
        if exact or len(likely) == 1:
            found[field] = (exact or likely)[0]
    parts = [found[part] for part in ("nsec", "usec") if part in found]
    if not ("sec" in found and parts and parts[0] != found["sec"]):
        found = {"t": next(iter([found["sec"]] if "sec" in found else parts), -1)} | found
        found = {field: place for field, place in found.items() if field in NAMES and place >= 0}
    elif "sec" in found:
        found.pop("t", None)
    return found


def words_of(name: str) -> list[str]:
    """The words in a column's name: "Time [µs]" -> time, us."""
    return re.findall("[a-z]+", name.lower().replace("µ", "u").replace("μ", "u"))


def complete(found: dict[str, int]) -> Order | None:
    """The order where names say all of it."""
    return _order(found) if {"x", "y", "p"} <= set(found) and {"t", "sec"} & set(found) else None


def _order(found: dict[str, int]) -> Order:
    """Of t or of sec with nsec or usec, and x, y, p."""
    if "t" in found:
        return Order(found["t"], found["x"], found["y"], found["p"])
    part, part_ns = (found["nsec"], 1) if "nsec" in found else (found["usec"], 1000)
    return Order(found["sec"], found["x"], found["y"], found["p"], part, part_ns)


def by_values(sample: NDArray[Any], found: dict[str, int], size: Size | None = None) -> Order | None:
    """The order of the columns of `sample` (n, k) of which `found` is known; None where they are no events.

    Raises UnclearError where it could be more than one.
    """
    columns = [_Column(number, sample[:, number].astype(np.float64)) for number in range(sample.shape[1])]
    free = [column for column in columns if column.number not in found.values()]
    chosen = dict(found)
    for field, choose in (("p", _polarity), ("t", _time)):
        known = field in chosen or (field == "t" and "sec" in chosen)
        if not known and not _take(chosen, field, choose(free)):
            return None
        free = [column for column in free if column.number not in chosen.values()]
    return _pixels(columns, free, chosen, size)


class _Column:
    """What the values of a column may stand for."""

    def __init__(self, number: int, values: NDArray[np.float64]) -> None:
        steps = np.diff(values)
        self.number = number
        self.values = values
        self.whole = bool(np.all(values == np.rint(values)))
        self.signs = bool(np.isin(values, (-1, 0, 1)).all())
        self.pixels = self.whole and values.min() >= 0 and values.max() < (1 << 16) - 1
        self.way = float(values[-1] - values[0])
        self.rises = self.way > 0 and self.way >= RISING * float(np.abs(steps).sum())
        self.counts = len(values) > 1 and bool(np.all(steps == 1))
        self.constant = bool(np.all(steps == 0))


def _take(chosen: dict[str, int], field: str, found: list[_Column]) -> bool:
    """Note the one column of a field, or the two of seconds and billionths; whether there is any."""
    if len(found) == 1:
        chosen[field] = found[0].number
    elif len(found) == 2 and field == "t" and _seconds(*found):
        chosen["sec"], chosen["nsec"] = found[0].number, found[1].number
    elif found:
        numbers = " and ".join(str(column.number + 1) for column in found)
        raise UnclearError(f"columns {numbers} could both be {field}")
    return bool(found)


def _polarity(free: list[_Column]) -> list[_Column]:
    signs = [column for column in free if column.signs]
    return [column for column in signs if not column.constant] or signs


def _time(free: list[_Column]) -> list[_Column]:
    """Columns that may be the time; one that only counts the rows is none where there is another."""
    for first, second in itertools.pairwise(free):
        if _seconds(first, second):
            return [first, second]
    rising = [column for column in free if column.rises and not column.signs]
    rising = [column for column in rising if not column.counts] or rising
    beyond = [column for column in rising if not column.pixels]
    rising.sort(key=lambda column: -column.way)
    clear = not beyond and len(rising) > 1 and rising[0].way > FARTHER * rising[1].way
    return beyond or (rising[:1] if clear else rising)


def _seconds(first: _Column, second: _Column) -> bool:
    """Whether the two are whole seconds since 1970 and billionths beside them."""
    steps = np.diff(first.values)
    since = first.whole and first.values.min() > EPOCH_S and first.values.max() < 100 * EPOCH_S
    parts = second.whole and second.values.min() >= 0 and second.values.max() < 1e9
    both = first.values + second.values / 1e9
    return bool(since and parts and np.all((steps == 0) | (steps == 1)) and np.diff(both).min(initial=0) >= 0)


def _pixels(
    columns: list[_Column], free: list[_Column], chosen: dict[str, int], size: Size | None
) -> Order | None:
    """The order with x before y, unless only the other way round fits the sensor."""
    missing = [field for field in "xy" if field not in chosen]
    pixels = [column for column in free if column.pixels] if missing else []
    if len(pixels) > len(missing):
        pixels = [column for column in pixels if not column.counts and not column.constant]
    if len(pixels) < len(missing):
        return None
    if len(pixels) > len(missing):
        numbers = ", ".join(str(column.number + 1) for column in pixels)
        raise UnclearError(f"columns {numbers} could all be {' or '.join(missing)}")
    chosen |= {field: column.number for field, column in zip(missing, pixels, strict=True)}
    order = _order(chosen)
    return _turned(order, columns, size) if len(missing) == 2 else order


def _turned(order: Order, columns: list[_Column], size: Size | None) -> Order:
    """With y before x where only that fits the sensor; UnclearError for a sensor taller than wide."""
    first, second = columns[order.x].values, columns[order.y].values
    other = order._replace(x=order.y, y=order.x)
    if size is not None:
        fits = first.max() < size[0] and second.max() < size[1]
        return other if not fits and second.max() < size[0] and first.max() < size[1] else order
    if len(first) >= MANY and second.max() > TALL * first.max():
        count = len(columns)
        raise UnclearError(
            f"it could be {order.words(count)} of a sensor taller than wide, or {other.words(count)}"
        )
    return order
