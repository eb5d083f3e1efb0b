"""The sensor's clock: which events are in order, and whether it was set or has begun anew."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from evplace.core.events import Size
from evplace.sources.readers import Block
from evplace.sources.readers._checks import NOTHING_YET, REASONS, checked
from evplace.sources.readers._source import joined

LEAP_US = 1_000_000
"""A clock that is so far from where it should be was set, or is another one; less is jitter."""


@dataclass
class Sifted:
    """What the checks let through of a block."""

    blocks: list[Block] = field(default_factory=list)
    anew: bool = False
    """Whether the times begin anew with the first of the blocks."""


class Sieve:
    """Lets through events inside the sensor and in the order of their times, as a recording's reader does.

    A block that lies off by more than LEAP_US, or goes back at all after so long a silence, waits for the
    next: where that agrees with it, the clock was set or the camera started again, and times begin anew;
    else it was noise, and is dropped.
    """

    def __init__(self, size: Size) -> None:
        self.size = size
        self.dropped = dict.fromkeys((*REASONS, "doubtful"), 0)
        """Reason -> events left out so far."""
        self._last_us = NOTHING_YET
        self._last_s = 0.0
        self._held: Block | None = None
        self._doubtful: Block | None = None

    def push(self, block: Block, now_s: float, pace: float) -> Sifted:
        """The good events of a block that came at `now_s`, where `pace` seconds of the sensor pass in one."""
        if not len(block.t_us):
            self.dropped["untimed"] += block.untimed
            return Sifted()
        middle_us = _middle_us(block)
        if not self._is_off(middle_us, now_s, pace):
            self._drop_doubtful()
            return self._passed([block], now_s)
        before, self._doubtful = self._doubtful, block
        if before is None or abs(middle_us - _middle_us(before)) > LEAP_US:
            self.dropped["doubtful"] += 0 if before is None else len(before.t_us)
            return Sifted()
        self.anew()
        return self._passed([before, block], now_s, anew=True)

    def flush(self) -> Sifted:
        """What was held back because more might have come."""
        held, self._held = self._held, None
        return Sifted([] if held is None else self._kept(held, final=True))

    def anew(self) -> None:
        """Times begin anew with the next block."""
        self._last_us, self._held, self._doubtful = NOTHING_YET, None, None

    def _is_off(self, t_us: int, now_s: float, pace: float) -> bool:
        if self._last_us == NOTHING_YET:
            return False
        ahead_us = t_us - self._last_us
        passed_us = (now_s - self._last_s) * pace * 1e6
        is_back = ahead_us < -LEAP_US or (ahead_us < 0 and passed_us > LEAP_US)
        return is_back or (pace > 0 and ahead_us > passed_us + LEAP_US)

    def _drop_doubtful(self) -> None:
        if self._doubtful is not None:
            self.dropped["doubtful"] += len(self._doubtful.t_us)
            self._doubtful = None

    def _passed(self, blocks: list[Block], now_s: float, anew: bool = False) -> Sifted:
        held = [] if self._held is None else [self._held]
        self._held = None
        kept = self._kept(joined([*held, *blocks]), final=False)
        if kept:  # else all is held back, and the last time that is known is still that of before
            self._last_s = now_s
        return Sifted(kept, anew)

    def _kept(self, block: Block, final: bool) -> list[Block]:
        good, self._held, drops = checked(block, self.size, self._last_us, final)
        for reason, count in zip(REASONS, drops, strict=True):
            self.dropped[reason] += count
        if not len(good.t_us):
            return []
        self._last_us = int(good.t_us[-1])
        return [good]


def _middle_us(block: Block) -> int:
    """The middle one of five times spread over a block: one that is wrong makes no difference."""
    at = np.linspace(0, len(block.t_us) - 1, 5).astype(np.int64)
    return int(np.sort(block.t_us[at])[2])
