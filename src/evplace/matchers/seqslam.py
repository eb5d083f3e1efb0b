"""SeqSLAM: short straight sequences of locally contrasted distances, as in OpenSeqSLAM 2.0 and of 2013.

After Milford and Wyeth, "SeqSLAM" (ICRA 2012); Talbot, Garg and Milford, "OpenSeqSLAM 2.0" (IROS 2018),
which the paper compares with. Items are reference images in the order of their drive.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import SettingsError
from evplace.matchers import Answer, Matching, Path, Row, Rows, Sweep
from evplace.matchers import _seqslam_search as search
from evplace.matchers._rows import Columns, RowCheck, above, costs_below

_WAYS = {"hybrid": search.HYBRID, "cone": search.CONE}


@dataclass(frozen=True)
class SeqSLAM:
    """OpenSeqSLAM 2.0, with its defaults; any score serves as a distance, negated.

    Among equals the lowest reference wins. Where the original divides by a deviation of zero (flat
    distances), the contrast is 0.
    """

    ds: int = 15
    """Sequence length in queries; the first ds // 2 and the last ds - 1 - ds // 2 queries of a drive have no
    answer. The 2013 search makes it even and looks at one query more. OpenSeqSLAM 2.0: 15, 2013: 10."""
    v_min: float = 0.8
    """Slowest trajectory, in references a query."""
    v_max: float = 1.2
    """Fastest trajectory, in references a query."""
    v_step: float = 0.1
    """Step between velocities; only the "trajectory" search uses it."""
    R: int = 10
    """References in the neighbourhood of the contrast enhancement, the one itself not counted; even."""
    search: Literal["trajectory", "hybrid", "cone", "2013"] = "trajectory"
    """Least sum along any trajectory; "hybrid", only those that touch a nearest reference; "cone", how few
    of the nearest references lie between the slowest and the fastest; "2013", the older program's sums."""
    selection: Literal["window", "threshold"] = "window"
    """Accept a match whose uniqueness is above mu, or whose score is below the threshold."""
    window: int = 10
    """References about the best one that do not count as rivals in the uniqueness."""
    mu: float = 1.111
    """Least uniqueness, the best rival's score over the best score; the paper sweeps it."""
    threshold: float = 2.5
    """Largest score that the "threshold" selection accepts, in standard deviations summed over ds."""

    def __post_init__(self) -> None:
        """Raise SettingsError for values that OpenSeqSLAM rejects or that leave nothing to search."""
        if self.ds < 2:
            raise SettingsError(f"ds = {self.ds} queries make no sequence: take at least 2")
        if self.R < 2 or self.R % 2:
            raise SettingsError(f"R = {self.R} cannot be halved: take an even number from 2")
        if not 0 < self.v_min <= self.v_max or self.v_step <= 0:
            raise SettingsError(
                f"v_min = {self.v_min}, v_max = {self.v_max}, v_step = {self.v_step}: "
                "take 0 < v_min <= v_max and v_step > 0"
            )
        if self.window < 0:
            raise SettingsError(f"window = {self.window} is negative: take 0 or more references")
        if self.search == "2013":
            velocities, queries = search.trajectories_2013(
                self.ds + self.ds % 2, self.v_min, self.v_max
            ).shape
            if velocities > queries:
                raise SettingsError(
                    f"v_min to v_max is {velocities} velocities: with this ds at most {queries}"
                )

    presets: ClassVar[Mapping[str, SeqSLAM]]
    causal: ClassVar[bool] = False

    def start(self, distances: bool = False) -> Matching:  # noqa: ARG002 - a distance is the score -d
        """See Matcher."""
        return _SequenceSearch(self)

    def sweep(self, parameter: str | None = None) -> Sweep:
        """See Matcher."""
        if parameter == "threshold":
            below = replace(self, selection="threshold")
            return Sweep(parameter, below, costs_below)
        unique = replace(self, selection="window")
        return Sweep(parameter or "mu", unique, above if parameter in (None, "mu") else None)


SeqSLAM.presets = {"openseqslam2": SeqSLAM(), "openseqslam2013": SeqSLAM(ds=10, search="2013")}


class _SequenceSearch:
    """Remembers the last ds enhanced rows. `step` answers for the query in the middle of them.

    The original lowers all contrasts by the least of the whole matrix; `step` knows only the least so far,
    `path` the true one. That changes confidences and what is accepted, never the best reference. Where no
    trajectory fits (the drive's ends, fewer queries or references than ds) the item is -1, the score NaN.
    """

    def __init__(self, settings: SeqSLAM) -> None:
        self._settings, self._check = settings, RowCheck()
        self._offsets = offsets_of(settings)
        self._old = settings.search == "2013"
        self._before = settings.ds // 2 if not self._old else (self._offsets.shape[1] - 1) // 2
        self._state = np.array([0.0, np.inf])
        self._found = Columns("qdd")
        self._band, self._work = np.empty((0, 0), np.float32), np.empty((0, 0), np.float32)
        self._nearest = np.empty(self._offsets.shape[1], np.int64)

    def step(self, row: Row) -> Answer | None:
        """The match of the query in the middle, None until ds rows are there; `row` (items,)."""
        item, best, second, least = self._advance(row[None])
        if not len(item):
            return None
        score, accepted = self._judge(best, second, least)
        self._found.forget_old()
        query = self._before + len(self._found) - 1
        return Answer(query, int(item[0]), float(score[0]), bool(accepted[0]))

    def extend(self, rows: Rows) -> None:
        """Take the next queries; `rows` (queries, items)."""
        self._advance(rows)

    def path(self) -> Path:
        """The matches of all queries so far, with the contrasts of all of them known."""
        item, best, second = self._found.arrays()
        score, accepted = self._judge(best, second, self._state[1])
        queries = self._check.queries
        path = Path(np.full(queries, -1), np.full(queries, np.nan), np.zeros(queries, np.bool_))
        first = self._before + self._found.first
        middle = slice(first, first + len(item))
        path.item[middle], path.score[middle], path.accepted[middle] = item, score, accepted
        return path

    def _advance(self, rows: Rows, scores: NDArray[np.float32] | None = None) -> list[NDArray[Any]]:
        table = self._check(rows)
        if not len(self._band):
            self._band = np.empty((self._offsets.shape[1], table.shape[1]), np.float32)
            self._work = np.empty((2, table.shape[1]), np.float32)
        s = self._settings
        keep = np.empty((0, table.shape[1]), np.float32) if scores is None else scores
        item, best, second, least = search.advance(
            table,
            self._band,
            self._nearest,
            self._work,
            self._state,
            self._offsets,
            _WAYS.get(s.search, search.TRAJECTORY),
            s.R // 2,
            (s.window + 1) // 2,
            keep,
        )
        if self._old:  # the best first row stands for the middle, as if the velocity were 1
            item = np.where(item < 0, -1, np.minimum(item + self._before, table.shape[1] - 1))
        self._found.extend(item, best, second)
        return [item, best, second, least]

    def _judge(
        self, best: NDArray[np.float64], second: NDArray[np.float64], least: NDArray[np.float64] | float
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Confidences and acceptance from the best scores, the rivals' and the least contrast."""
        s = self._settings
        lift = 0.0 if s.search == "cone" else -self._offsets.shape[1] * np.asarray(least)
        if s.selection == "threshold":
            return -(best + lift), best + lift < s.threshold
        with np.errstate(divide="ignore", invalid="ignore"):
            uniqueness = (second + lift) / (best + lift)
        return uniqueness, uniqueness > s.mu


def offsets_of(settings: SeqSLAM) -> search.Offsets:
    """The trajectories that the settings ask for."""
    s = settings
    if s.search == "2013":
        return search.trajectories_2013(s.ds + s.ds % 2, s.v_min, s.v_max)
    return search.trajectories(s.ds, s.v_min, s.v_max, s.v_step, every=s.search != "trajectory")


def sequence_scores(rows: Rows, settings: SeqSLAM) -> NDArray[np.float64]:
    """The whole (queries, items) matrix of sequence scores, smaller is better, NaN where nothing fits.

    For looking at and for tests: matching needs only the least of each row.
    """
    seqslam = _SequenceSearch(settings)
    table = np.full(np.shape(rows), np.inf, np.float32)
    found = np.full(np.shape(rows), np.inf, np.float32)
    seqslam._advance(rows, found)
    answered = len(seqslam._found)
    table[seqslam._before : seqslam._before + answered] = found[:answered]
    if settings.search != "cone":
        table = table - seqslam._offsets.shape[1] * seqslam._state[1]
    return np.where(np.isinf(table), np.nan, table).astype(np.float64)
