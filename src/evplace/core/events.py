"""Events as four arrays: the unit in which recordings are read and windows are cut (paper, Eq. 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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

    def __len__(self) -> int:
        return len(self.t_us)

    def __getitem__(self, part: slice) -> Events:
        return Events(self.t_us[part], self.x[part], self.y[part], self.p[part], self.size)

    @classmethod
    def empty(cls, size: Size) -> Events:
        """No events of a sensor of `size` (width, height)."""
        return cls.of([], [], [], [], size)

    @classmethod
    def of(cls, t_us: object, x: object, y: object, p: object, size: Size) -> Events:
        """Events from anything that numpy turns into four arrays of one length; values are not checked."""
        return cls(
            np.ascontiguousarray(t_us, np.int64),
            np.ascontiguousarray(x, np.uint16),
            np.ascontiguousarray(y, np.uint16),
            np.ascontiguousarray(p, np.bool_),
            size,
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
