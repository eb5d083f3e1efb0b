"""Events as four arrays: the unit in which recordings are read and windows are cut (paper, Eq. 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import InputError

Size = tuple[int, int]
"""(width, height) in pixels."""


@dataclass(frozen=True, slots=True)
class Events:
    """Events in the order of their times; a structure of arrays, because every hot loop reads one field.

    Slicing (`events[10:20]`) gives views, not copies.
    """

    t_us: NDArray[np.int64]
    """(N,) times in microseconds, never decreasing."""
    x: NDArray[np.uint16]
    """(N,) columns, 0 at the left, below `size[0]`."""
    y: NDArray[np.uint16]
    """(N,) rows, 0 at the top, below `size[1]`."""
    p: NDArray[np.bool_]
    """(N,) True where the pixel became brighter."""
    size: Size
    """(width, height) of the sensor in pixels."""
    checked: bool = field(default=False, init=False, repr=False, compare=False)
    """Whether the order of the times was checked: of what recordings give, and its slices."""

    def __len__(self) -> int:
        return len(self.t_us)

    def __getitem__(self, part: slice) -> Events:
        events = Events(self.t_us[part], self.x[part], self.y[part], self.p[part], self.size)
        return events.as_checked() if self.checked and (part.step is None or part.step > 0) else events

    def as_checked(self) -> Events:
        """The same, marked by who has checked the order of its times."""
        object.__setattr__(self, "checked", True)
        return self

    @classmethod
    def empty(cls, size: Size) -> Events:
        """No events of a sensor of `size` (width, height)."""
        return cls.of([], [], [], [], size)

    @classmethod
    def of(cls, t_us: object, x: object, y: object, p: object, size: Size) -> Events:
        """Events from anything that numpy turns into four arrays of one length, each checked once.

        Times are whole microseconds that never decrease, x and y whole numbers up to 65,535, polarities true
        or false, 0 or 1, or -1 and 1, where above 0 is brighter. Raises InputError for anything else.
        """
        found = cls(
            np.ascontiguousarray(_whole(t_us, "t_us", "microseconds"), np.int64),
            np.ascontiguousarray(_within(_whole(x, "x", "columns"), "x"), np.uint16),
            np.ascontiguousarray(_within(_whole(y, "y", "rows"), "y"), np.uint16),
            np.ascontiguousarray(_brighter(p)),
            size,
        )
        if not _is_size(size):
            raise InputError(f"a sensor of {size} pixels cannot be: give width and height, up to 65,536")
        found.check()
        return found

    def check(self, last_us: int | None = None) -> None:
        """InputError where this is no packet of events, or begins before `last_us`, the last event's time.

        It looks at types, lengths and the order of the times, which takes 0.2 ms for a million events and is
        not done again for what is `checked`.
        """
        columns: tuple[NDArray[Any], ...] = (self.t_us, self.x, self.y, self.p)
        kinds = tuple(getattr(column, "dtype", None) for column in columns)
        lengths = {np.shape(column) for column in columns}
        if kinds != _KINDS or lengths != {(len(self.t_us),)}:
            told = ", ".join(
                f"{kind} {np.shape(column)}" for kind, column in zip(kinds, columns, strict=True)
            )
            raise InputError(
                f"events are t_us int64, x and y uint16 and p bool of one length, these are {told}: make "
                "them with Events.of"
            )
        if len(self) and last_us is not None and self.t_us[0] < last_us:
            raise InputError(
                f"a packet begins at {self.t_us[0]} us, before the last event, at {last_us} us: packets "
                "and the events in them stand in the order of their times"
            )
        if self.checked:
            return
        late = self.t_us[1:] < self.t_us[:-1]
        if late.any():
            raise InputError(
                f"event {int(np.argmax(late)) + 1} is earlier than the one before it: sort them by time"
            )

    @classmethod
    def concatenate(cls, parts: Sequence[Events]) -> Events:
        """All `parts` (at least one, of one sensor) as one block, in the order given."""
        return cls(
            np.concatenate([part.t_us for part in parts]),
            np.concatenate([part.x for part in parts]),
            np.concatenate([part.y for part in parts]),
            np.concatenate([part.p for part in parts]),
            parts[0].size,
        )


_KINDS = (np.dtype(np.int64), np.dtype(np.uint16), np.dtype(np.uint16), np.dtype(np.bool_))


def _is_size(size: object) -> bool:
    sides = list(size) if isinstance(size, tuple | list | np.ndarray) else []
    return len(sides) == 2 and all(isinstance(n, int | np.integer) and 0 < n <= 1 << 16 for n in sides)


def _whole(values: object, name: str, what: str) -> NDArray[Any]:
    """Whole numbers as an array; InputError for others."""
    try:
        array = np.asarray(values)
    except ValueError as error:  # lists of several lengths
        raise InputError(f"the {name} of events are whole {what}, one each: {error}") from error
    if array.dtype.kind not in "iu" and array.size:
        hint = ": round seconds times 1e6" if name == "t_us" and array.dtype.kind == "f" else ""
        raise InputError(f"the {name} of events are whole {what}, not {array.dtype}{hint}")
    if array.dtype.kind == "u" and array.size and array.max() > np.iinfo(np.int64).max:
        raise InputError(f"the {name} of events is {array.max()}: no clock counts so far")
    if np.ma.is_masked(values):
        raise InputError(f"the {name} of events is masked at some: leave these events out")
    return array


def _within(values: NDArray[Any], name: str) -> NDArray[Any]:
    if values.size and not (values.min() >= 0 and values.max() <= 0xFFFF):
        raise InputError(f"the {name} of events is 0 to 65,535, not {values.min()} to {values.max()}")
    return values


def _brighter(polarities: object) -> NDArray[np.bool_]:
    array = np.asarray(polarities)
    if array.dtype == np.bool_ or not array.size:
        return array.astype(np.bool_)
    if array.dtype.kind not in "iuf" or not np.isin(array, (-1, 0, 1)).all():
        raise InputError("the p of events is true or false, 0 or 1, or -1 and 1: it holds other values")
    return np.asarray(array > 0, np.bool_)
