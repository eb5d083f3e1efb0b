"""Whether track and camera agree on when the car moves: else one of them is wrong there.

A track that moves while the camera sees nothing, or stands while events come as fast as on the way, is that
of a receiver that drifts or hangs, of another clock, or of another drive.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.doctor._outcome import Finding, Outcome, State
from evplace.doctor._speed import speed_at
from evplace.doctor._subject import BIN_US, AtTheEnd, stretches
from evplace.doctor.standing import LOW, SHORTEST_S, SLOW_MPS

OF = ("events", "frames")

Floats = NDArray[np.float64]

MOVING_MPS = 2.0
"""Above this speed a track moves for sure."""
AS_ON_THE_WAY = 0.5
"""Share of the usual activity on the way that no car has which stands, whatever passes by."""
FEWEST_S = 10.0
"""Of movement, and of all, without which nothing is said."""
MUCH = 5.0
"""Per cent of the time above which track and camera do not belong together."""


class Check(AtTheEnd):
    """Asks the subject's activity, and its track."""

    def outcome(self) -> Outcome:
        """Finding: movement; none without a track."""
        if self._subject.track is None:
            return Outcome()
        t_us, activity = self._subject.smooth_activity()
        mps = speed_at(self._subject.track, t_us.astype(np.float64))
        known = np.isfinite(activity) & np.isfinite(mps)
        moves = known & (mps > MOVING_MPS)
        if moves.sum() * BIN_US < FEWEST_S * 1e6:
            sentence = (
                f"Cannot be determined: track and recording share less than {FEWEST_S:g} s of movement."
            )
            return Outcome([Finding("movement", "unknown", None, "%", sentence)])
        usual, busy = np.median(activity[moves]), np.percentile(activity[known], 90)
        unseen = _long(moves & (activity <= LOW * busy))
        unmoved = _long(known & (mps < SLOW_MPS) & (activity >= AS_ON_THE_WAY * usual))
        share = 100 * float((unseen | unmoved).sum() / known.sum())
        told = [self._told(t_us, unseen, "the track moves while the camera sees hardly anything")]
        told += [self._told(t_us, unmoved, "the track stands while the camera sees as much as on the way")]
        return Outcome([_finding(share, [part for part in told if part])])

    def _told(self, t_us: NDArray[np.int64], where: NDArray[np.bool_], what: str) -> str:
        """What is so, for how long and from when on; empty where it never is."""
        if not where.any():
            return ""
        since_s = float(self._subject.seconds(t_us)[np.argmax(where)])
        return f"{what} for {where.sum() * BIN_US / 1e6:.1f} s (first {since_s:.1f} s after the start)"


def _long(where: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The same without its short stretches."""
    kept = np.zeros(len(where), np.bool_)
    for start, stop in stretches(where):
        kept[start:stop] = (stop - start) * BIN_US >= SHORTEST_S * 1e6
    return kept


def _finding(share: float, told: list[str]) -> Finding:
    if not told:
        sentence = "The track moves where the camera sees movement, and stands where it sees none."
        return Finding("movement", "good", 0.0, "%", sentence)
    state: State = "look" if share < MUCH else "bad"
    sentence = "; ".join(told)
    advice = (
        "see the clock offset first; then whether it is dark there, or a receiver hung or drifted: its fixes "
        "there place images wrongly, so take them out of the log"
    )
    return Finding("movement", state, share, "%", f"{sentence[0].upper()}{sentence[1:]}.", advice)
