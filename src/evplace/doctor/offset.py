"""Whether the clocks of the track and of the camera agree: the faster a car drives or turns, the more events.

The logarithm of the activity is fitted to that of the speed, at every shift of the track's times; the shift
at which the fit is best is the offset. Logarithms, because what the scene adds is a factor. The uncertainty
is that of a block bootstrap (Kunsch, "The jackknife and the bootstrap for general stationary observations",
Annals of Statistics 1989): stretches of BLOCK_S are drawn with replacement and the best shift is looked for
anew. What the scene adds lasts for seconds, so single samples would make the offset seem much surer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace.doctor._outcome import Curve, Finding, Outcome, State
from evplace.doctor._speed import speed_at, speeds, turning_at
from evplace.doctor._subject import BIN_US, AtTheEnd
from evplace.sources.tracks import Track

OF = ("events", "frames")

Floats = NDArray[np.float64]

REACH_S = 30.0
"""Offsets up to here are looked for, but no more than a quarter of the recording."""
BLOCK_S = 10.0
"""Length of a block of the bootstrap."""
FEWEST = 6
"""Fewest blocks that an offset is measured from: a minute."""
DRAWS = 200
"""Draws of the bootstrap."""
STEADY_MPS = 1.0
"""Spread of the speed (10th to 90th percentile) below which no offset shows."""
STILL_MPS = 1.0
"""Added to the speed (and as much to the activity) before the logarithm: below it, a track is noise."""
DEPTH_M = 10.0
"""A turn moves the image as passing things at this distance does: it counts as their speed."""
LEAST_FIT = 0.3
"""Correlation below which events and speed have too little in common."""
MODEL_S = 0.3
"""What the model itself may be wrong by, as the camera sees ahead of the car: drives of the virtual city,
whose clocks agree, give 0.2 s. It is added to the bootstrap's uncertainty, by squares."""
VAGUE_S = 3.0
"""Uncertainty above which no offset is given: it would not say which place is which."""
LEAP_S = 18.0
"""Leap seconds since 1980, by which GPS time is ahead of UTC."""
HARMLESS_S = 0.5
"""An offset below this, or below its uncertainty, costs a few metres at most."""


@dataclass(frozen=True)
class Offset:
    """What to add to the track's times so that they fit the camera's."""

    seconds: float
    uncertainty_s: float
    """Half of the interval that holds the offset with 95 %."""
    fit: float
    """Correlation at the best shift."""

    @property
    def interval(self) -> tuple[float, float]:
        """From and to, in seconds."""
        return self.seconds - self.uncertainty_s, self.seconds + self.uncertainty_s


class Check(AtTheEnd):
    """Asks the subject's activity and its track."""

    def outcome(self) -> Outcome:
        """Finding: clock offset, and the fit over the shifts as a curve; none without a track."""
        if self._subject.track is None:
            return Outcome()
        t_us, activity = self._subject.smooth_activity()
        found = Fit.of(t_us, activity, self._subject.track)
        if isinstance(found, str):
            return Outcome([_untold(found)])
        offset = found.offset()
        curve = Curve(
            "offset", "Fit of the activity to the speed", "seconds added to the track's times", "correlation",
            found.shifts_s, found.correlation(found.every)[0],
            [] if isinstance(offset, str) else [(*offset.interval, "offset, with 95 %")],
        )  # fmt: skip
        return Outcome([_untold(offset) if isinstance(offset, str) else _finding(offset)], [curve])


@dataclass(frozen=True)
class Fit:
    """Sums of a straight line's fit, for each block and shift; blocks can be drawn and added."""

    shifts_s: Floats
    """(S,) seconds added to the track's times."""
    sums: Floats
    """(blocks, S, 6) n, x, y, xx, yy, xy: x is of the speed, y of the activity."""

    @classmethod
    def of(cls, t_us: NDArray[np.int64], activity: Floats, track: Track) -> Fit | str:
        """For an activity (n,) every tenth of a second; where no offset can be measured, the reason why."""
        per_block = int(BLOCK_S * 1e6) // BIN_US
        blocks = len(t_us) // per_block
        if blocks < FEWEST:
            return f"it takes a recording of {FEWEST * BLOCK_S:.0f} s"
        used = blocks * per_block
        known, at_us = speeds(track), t_us[:used].astype(np.float64)
        here = speed_at(track, at_us, known)
        if np.isfinite(here).sum() < FEWEST * per_block:
            return f"track and recording share less than {FEWEST * BLOCK_S:.0f} s"
        if np.subtract(*np.nanpercentile(here, [90, 10])) < STEADY_MPS:
            return "the speed hardly changes"
        reach = round(min(REACH_S, used * BIN_US / 4e6) * 1e6 / BIN_US)
        shifts = np.arange(-reach, reach + 1)
        wide_us = t_us[0] + np.arange(-reach, used + reach) * float(BIN_US)
        x = np.log(speed_at(track, wide_us, known) + DEPTH_M * turning_at(track, wide_us) + STILL_MPS)
        still = np.nanmedian(activity) * STILL_MPS / max(float(np.nanmedian(here)), STILL_MPS)
        y = np.log(activity[:used] + max(float(still), 1e-9))
        y -= np.nanmean(y)
        parts = [_sums(x[reach - shift : reach - shift + used], y, blocks) for shift in shifts]
        return cls(shifts * BIN_US / 1e6, np.stack(parts, axis=1))

    def correlation(self, weights: Floats) -> Floats:
        """(draws, S) with each block counted `weights` (draws, blocks) times.

        0 where half of the samples are missing.
        """
        n, x, y, xx, yy, xy = np.moveaxis(np.tensordot(weights, self.sums, 1), -1, 0)
        enough = n >= 0.5 * np.maximum(n.max(axis=1, keepdims=True), 1.0)
        n = np.maximum(n, 1.0)
        spread = np.maximum(xx - x * x / n, 0) * np.maximum(yy - y * y / n, 0)
        good = enough & (spread > 0)
        return np.where(good, (xy - x * y / n) / np.sqrt(np.where(good, spread, 1.0)), 0.0)

    def best(self, weights: Floats) -> Floats:
        """(draws,) the best shifts in seconds, between two tried ones by a parabola."""
        fit = self.correlation(weights)
        top = np.argmax(fit, axis=1)
        inner = np.clip(top, 1, fit.shape[1] - 2)
        left, middle, right = (fit[np.arange(len(fit)), inner + step] for step in (-1, 0, 1))
        bend = left - 2 * middle + right
        bent = (inner == top) & (bend < 0)
        part = np.where(bent, 0.5 * (left - right) / np.where(bent, bend, 1.0), 0.0)
        return np.asarray(self.shifts_s[top] + part * BIN_US / 1e6, np.float64)

    @property
    def every(self) -> Floats:
        """(1, blocks) each block once."""
        return np.ones((1, len(self.sums)))

    def offset(self) -> Offset | str:
        """The offset with its uncertainty; where it cannot be given, the reason why."""
        fit = float(self.correlation(self.every).max())
        if fit < LEAST_FIT:
            return f"events and speed have too little in common (correlation {fit:.2f})"
        best = float(self.best(self.every)[0])
        if abs(best) > float(self.shifts_s[-1]) - 0.5:
            return f"no offset within {float(self.shifts_s[-1]):.0f} s fits"
        blocks = len(self.sums)
        drawn = self.best(_draws(blocks))
        away = float(np.percentile(np.abs(drawn - best), 95)) * float(np.sqrt(blocks / (blocks - 1)))
        if away > VAGUE_S:
            return f"several offsets fit about as well (95 % of the draws lie within {away:.1f} s)"
        return Offset(best, float(np.hypot(away, MODEL_S)), fit)


def _draws(blocks: int) -> Floats:
    """(DRAWS, blocks) how often each block is drawn, with replacement; always the same draws."""
    chosen = np.random.default_rng(0).integers(0, blocks, (DRAWS, blocks))
    rows = np.arange(DRAWS)[:, None] * blocks
    return (
        np.bincount((rows + chosen).ravel(), minlength=DRAWS * blocks)
        .reshape(DRAWS, blocks)
        .astype(np.float64)
    )


def _sums(x: Floats, y: Floats, blocks: int) -> Floats:
    """(blocks, 6) of the samples where both are known."""
    known = np.isfinite(x) & np.isfinite(y)
    x, y = np.where(known, x, 0.0), np.where(known, y, 0.0)
    columns = np.stack([known.astype(np.float64), x, y, x * x, y * y, x * y], axis=1)
    return np.asarray(columns.reshape(blocks, -1, 6).sum(axis=1), np.float64)


def _untold(reason: str) -> Finding:
    return Finding("clock offset", "unknown", None, "s", f"Cannot be determined: {reason}.")


def _finding(offset: Offset) -> Finding:
    sentence = (
        f"The track fits best with {offset.seconds:+.2f} s added to its times, give or take "
        f"{offset.uncertainty_s:.2f} s (95 %; correlation {offset.fit:.2f})."
    )
    if abs(abs(offset.seconds) - LEAP_S) <= offset.uncertainty_s:
        sentence += f" GPS time is {LEAP_S:.0f} s, the leap seconds, ahead of UTC: that may be why."
    away = abs(offset.seconds)
    if away <= max(HARMLESS_S, offset.uncertainty_s):
        return Finding("clock offset", "good", offset.seconds, "s", sentence)
    state: State = "look" if away - offset.uncertainty_s < 2 else "bad"
    advice = (
        f"shift the track's times by {offset.seconds:.2f} s with `offset_us` (on top of a shift that was "
        "given), or set both clocks by GPS time"
    )
    return Finding("clock offset", state, offset.seconds, "s", sentence, advice)
