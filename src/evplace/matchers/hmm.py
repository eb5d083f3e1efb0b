"""A hidden Markov model over the references, solved by Viterbi: our reading of Hansen and Browning.

"Visual place recognition using HMM sequence matching" (IROS 2014) says: similarity probabilities of locally
contrasted images, transitions that limit the velocity, a path that may be discontinuous, and a matrix of
reduced rank for scoring. All numbers, the form of the transitions, the softmax and the score are ours.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import SettingsError
from evplace.matchers import Answer, Matching, Path, Row, Rows, Sweep
from evplace.matchers._kept import Kept, after, live_rows
from evplace.matchers._rows import RowCheck, above, as_table
from evplace.matchers._seqslam_search import enhance
from evplace.matchers._viterbi import LONGEST_STEP, Viterbi, pieces


@dataclass(frozen=True)
class HMM:
    """The model, uniform over the references at first. Among equals the lowest reference wins."""

    v_min: int = 0
    """Fewest references that one query moves on; 0 lets the query stand, less than 0 lets it turn back."""
    v_max: int = 3
    """Most references that one query moves on."""
    speed: float = 1.0
    """References that a query moves on by where nothing is unusual: the drives' speeds and frame rates."""
    steady: float = 0.9
    """Probability that a query moves on at `speed`, or by the whole numbers next to it; the rest is spread
    evenly from v_min to v_max. 0 where the speed is quite unknown."""
    jump: float = 1e-3
    """Probability of a jump to any reference at all, at each query."""
    emission: Literal["contrast", "softmax", "probabilities"] = "contrast"
    """How a score row becomes probabilities: softmax of the local contrast (SeqSLAM's), softmax of the scores
    themselves, or they are probabilities already, as the network's."""
    temperature: float = 1.0
    """Divides what the softmax sees, in its units (standard deviations for "contrast")."""
    R: int = 10
    """References in the neighbourhood of the local contrast; even."""
    drop: int = 0
    """Leading singular components of the log-probability matrix that `path` removes first: what all queries
    have in common, such as references that look like everything. 0 leaves `path` the causal model's."""
    length: int = 15
    """Queries over which the score of a match is averaged, centred on it; shorter at the ends."""
    threshold: float = 0.0
    """Accept a match whose score is above this; 0 is what a reference has by chance."""

    def __post_init__(self) -> None:
        """Raise SettingsError for values out of range."""
        if not -LONGEST_STEP <= self.v_min <= self.v_max <= LONGEST_STEP:
            raise SettingsError(f"v_min = {self.v_min} and v_max = {self.v_max}: take v_min <= v_max")
        if not 0 < self.jump < 1:
            raise SettingsError(f"jump = {self.jump} is no probability between 0 and 1")
        if not 0 <= self.steady <= 1:
            raise SettingsError(f"steady = {self.steady} is no probability from 0 to 1")
        if not self.v_min <= self.speed <= self.v_max:
            raise SettingsError(f"speed = {self.speed} does not lie between v_min and v_max")
        if self.temperature <= 0 or self.length < 1 or self.drop < 0:
            raise SettingsError("take a temperature above 0, a length from 1, and drop from 0")
        if self.R < 2 or self.R % 2:
            raise SettingsError(f"R = {self.R} cannot be halved: take an even number from 2")

    presets: ClassVar[Mapping[str, HMM]] = {}
    causal: ClassVar[bool] = False

    def start(self, distances: bool = False) -> Matching:  # noqa: ARG002 - a distance is the score -d
        """See Matcher."""
        return _Model(self)

    def sweep(self, parameter: str | None = None) -> Sweep:
        """See Matcher."""
        return Sweep(parameter or "threshold", self, above if parameter in (None, "threshold") else None)


class _Model:
    """Remembers the log-probabilities and a step for each cell, 6 bytes; live, those of the last rows.

    `step` answers by the rows so far, `path` by all of them, on the matrix of reduced rank. The score is the
    log of how much likelier the matched references are than chance, in `path` averaged over `length` queries.
    """

    def __init__(self, settings: HMM) -> None:
        self._settings, self._check = settings, RowCheck()
        self._search: Viterbi | None = None
        self._rows = Kept()

    def step(self, row: Row) -> Answer:
        """The likeliest reference of this query, given all rows so far; `row` (items,)."""
        search, item = self._advance(row[None])
        score = float(self._rows.last[item[0]])
        many = live_rows(6 * len(self._rows.last))
        self._rows.forget_but(many)
        search.forget_but(many)
        return Answer(self._check.queries - 1, int(item[0]), score, score > self._settings.threshold)

    def extend(self, rows: Rows) -> None:
        """Take the next queries; `rows` (queries, items)."""
        for piece in pieces(as_table(rows)):
            self._advance(piece)

    def path(self) -> Path:
        """The likeliest path through all queries so far."""
        if self._search is None:
            return Path.of([])
        rows, search = self._rows, self._search
        if self._settings.drop:
            rows, search = self._reduced()
        item = search.trace()
        own = np.array([row[at] for row, at in zip(rows.rows(), item, strict=True)], np.float64)
        score = moving_mean(own, self._settings.length)
        return after(self._rows.first, Path(item, score, score > self._settings.threshold))

    def _reduced(self) -> tuple[Kept, Viterbi]:
        """What is kept, of reduced rank, and the search through it."""
        logs, rows = without_leading(self._rows.table(), self._settings.drop), Kept()
        search = transitions(self._settings, logs.shape[1])
        rows.append(logs)
        for piece in pieces(logs):
            search.extend(piece.astype(np.float64))
        return rows, search

    def _advance(self, rows: Rows) -> tuple[Viterbi, NDArray[np.int64]]:
        """The search, and the end of the best path at each query."""
        table = self._check(rows)
        if self._search is None:
            self._search = transitions(self._settings, table.shape[1])
        logs = log_odds(table, self._settings)
        self._rows.append(logs)
        return self._search, self._search.extend(logs.astype(np.float64))


def transitions(settings: HMM, items: int) -> Viterbi:
    """A search from anywhere, that moves on as the settings say."""
    s = settings
    steps = np.arange(s.v_min, s.v_max + 1)
    usual = s.steady * np.maximum(0, 1 - np.abs(steps - s.speed))
    probability = (1 - s.jump) * (usual + (1 - s.steady) / len(steps)) + s.jump / items
    return Viterbi(s.v_min, np.log(probability), float(np.log(s.jump / items)))


def log_odds(rows: NDArray[np.floating[Any]], settings: HMM) -> NDArray[np.float32]:
    """Log of each reference's probability over 1/items; (queries, items)."""
    items = rows.shape[1]
    if settings.emission == "probabilities":
        odds: NDArray[np.float32] = np.log(np.maximum(rows, 1e-12) * items).astype(np.float32)
        return odds
    if settings.emission == "contrast":
        logits, work = np.empty(rows.shape, np.float32), np.empty((2, items), np.float32)
        for row, out in zip(rows, logits, strict=True):
            enhance(row, settings.R // 2, out, work)
        logits /= -settings.temperature
    else:
        logits = (rows / settings.temperature).astype(np.float32)
    logits -= logits.max(1, keepdims=True)
    logits -= np.log(np.exp(logits).mean(1, keepdims=True))
    return logits


def without_leading(matrix: NDArray[np.float32], components: int) -> NDArray[np.float32]:
    """`matrix` without its leading singular components, found by subspace iteration from a fixed start."""
    components = min(components, *matrix.shape)
    if components == 0:
        return matrix
    basis = np.random.default_rng(0).standard_normal((matrix.shape[1], components + 8)).astype(np.float32)
    for _ in range(12):
        basis = np.linalg.qr(matrix.T @ (matrix @ basis))[0]
    _, _, right = np.linalg.svd(matrix @ basis, full_matrices=False)
    leading = basis @ right[:components].T
    reduced: NDArray[np.float32] = matrix - (matrix @ leading) @ leading.T
    return reduced


def moving_mean(values: NDArray[np.float64], length: int) -> NDArray[np.float64]:
    """Means of `values` over `length` of them, centred; of fewer at the ends."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    at = np.arange(len(values))
    first, end = np.maximum(0, at - length // 2), np.minimum(len(values), at + (length + 1) // 2)
    means: NDArray[np.float64] = (sums[end] - sums[first]) / np.maximum(1, end - first)
    return means
