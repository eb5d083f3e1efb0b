"""Result: the folder that keeps an evaluation."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core import folders, storage
from evplace.core.errors import EvaluationError, InputError
from evplace.evaluation._measures import CURVE, Bools, Floats
from evplace.evaluation._samples import Samples
from evplace.matchers import Path as Answers

MARK = folders.RESULT
"""What tells a folder that was written here from any other: only such a one is replaced."""
_MATCHES = ("query", "t_us", "item", "score", "accepted", "judged", "seen", "right", "true_item")
_NEEDED = ("queries", "left_out", "items", "judged", "accuracy", "accuracy_seen", "average_precision")
"""Figures that every result has; others depend on what was known."""

OUTCOMES = ("right", "wrong", "missed", "unseen")
"""What became of a query: accepted and right (TP), accepted otherwise (FP), not accepted though seen (FN),
not accepted and unseen (TN)."""


@dataclass(frozen=True, eq=False)
class Result:
    """The figures of one matcher on one drive, with all that they were made from."""

    figures: dict[str, Any]
    """Name -> number, or None where it is not defined (a precision of nothing accepted)."""
    settings: dict[str, Any]
    """The resolved settings of everything that took part."""
    versions: dict[str, str]
    """Package -> version."""
    answers: Answers
    """The matcher's answers."""
    t_us: NDArray[np.int64]
    """(queries,) times in microseconds; -1 where they are not known."""
    judged: Bools
    """(queries,) whether the truth knows anything of the query."""
    seen: Bools
    """(queries,) whether any answer would be right."""
    right: Bools
    """(queries,) whether the item answered is right, accepted or not."""
    curve: Floats
    """(thresholds, 4) the columns of CURVE, from the highest threshold to the lowest."""
    scores: NDArray[np.floating[Any]] | None = field(default=None)
    """(queries, items) score rows, where they were kept."""
    true_item: NDArray[np.int64] | None = None
    """(queries,) the right item nearest to each query, -1 where none is right; None where it was not kept."""
    query_xy: Floats | None = None
    """(queries, 2) easting and northing in metres, NaN where unknown; None where none is known."""
    item_xy: Floats | None = None
    """(items, 2) easting and northing in metres, NaN where unknown; None where none is known."""
    similarity: NDArray[np.uint8] | None = None
    """(at most 320, at most 240) how far items stand out for some queries, to look at."""
    took_s: float | None = None
    """Seconds of localising and measuring."""
    samples: Samples | None = None
    """Some queries with their images, to look at."""

    @property
    def timing(self) -> str:
        """Whether the answers are "live" ones or those of "hindsight"; "not said" where nobody said it."""
        earlier = "hindsight" if "map" in self.settings else "not said"  # what older versions measured
        return str(self.settings.get("answers", earlier))

    @property
    def is_probabilistic(self) -> bool:
        """Whether its scores are probabilities that the answer is right."""
        matcher = self.settings.get("matcher")
        return isinstance(matcher, dict) and matcher.get("probabilistic") is True

    @property
    def error_m(self) -> Floats:
        """(queries,) metres from each query to the item answered, accepted or not; NaN where unknown."""
        if self.query_xy is None or self.item_xy is None:
            return np.full(len(self.judged), np.nan)
        apart = self.query_xy - self.item_xy[self.answers.item]
        return np.where(self.answers.item >= 0, np.hypot(*apart.T), np.nan)

    @property
    def outcome(self) -> NDArray[np.int64]:
        """(queries,) an index of OUTCOMES each; -1 where nothing is known of the query."""
        accepted = self.answers.accepted & (self.answers.item >= 0)
        kinds = [~self.judged, accepted & self.right, accepted, self.seen]
        return np.select(kinds, [-1, 0, 1, 2], 3).astype(np.int64)

    def save(self, path: str | Path, overwrite: bool = False, with_scores: bool = False) -> None:
        """A folder: result.json, matches.csv, pr_curve.npy, and as far as they are known query_xy.npy,
        item_xy.npy, similarity.npy and samples.npy.

        `with_scores` adds scores.npy. Raises OutputError where the folder cannot be written.
        """
        with storage.new_folder(path, overwrite, MARK) as folder:
            storage.write_json(folder / "result.json", self._summary())
            _write_matches(folder / "matches.csv", self)
            arrays = {
                "pr_curve": self.curve,
                "query_xy": self.query_xy,
                "item_xy": self.item_xy,
                "samples": self.samples.images if self.samples is not None else None,
                "scores": self.scores if with_scores else None,
                "similarity": self.similarity,
            }
            for name, array in arrays.items():
                if array is not None:
                    storage.write_array(folder / f"{name}.npy", array)

    @classmethod
    def load(cls, path: str | Path) -> Result:
        """The result in a folder; EvaluationError where it is none or damaged."""
        folder = Path(path)
        if not (folder / MARK).exists() and (told := folders.instead(folder, MARK)) is not None:
            raise EvaluationError(told)
        try:
            what = f"the result in {folder}"
            summary = storage.read_json(folder / "result.json", what)
            curve = storage.read_array(folder / MARK, what).reshape(-1, len(CURVE))
            _check_summary(summary)
            answers, columns = _read_matches(storage.read_bytes(folder / "matches.csv", what).decode())
            images = _kept(folder / "samples.npy")
            samples = Samples.of(summary["samples"], images) if images is not None else None
            result = cls(
                summary["figures"], summary["settings"], summary["versions"], answers, **columns,
                curve=curve, scores=_kept(folder / "scores.npy", memory_mapped=True),
                query_xy=_kept(folder / "query_xy.npy"), item_xy=_kept(folder / "item_xy.npy"),
                similarity=_kept(folder / "similarity.npy"), took_s=summary.get("took_s"), samples=samples,
            )  # fmt: skip
            _check_fit(result)
        except InputError as error:
            raise EvaluationError(str(error)) from error
        except (OSError, EOFError, KeyError, TypeError, ValueError, ArithmeticError, csv.Error) as error:
            raise EvaluationError(f"the result in {folder} is damaged ({error}): evaluate again") from error
        return result

    def _summary(self) -> dict[str, Any]:
        """What result.json holds."""
        summary: dict[str, Any] = {
            "figures": self.figures,
            "settings": self.settings,
            "versions": self.versions,
        }
        if self.took_s is not None:
            summary["took_s"] = self.took_s
        if self.samples is not None:
            summary["samples"] = self.samples.query.tolist()
        return summary


def _kept(path: Path, memory_mapped: bool = False) -> NDArray[Any] | None:
    """The array in a file that a result may lack."""
    if not path.exists():
        return None
    return storage.read_array(path, f"the result in {path.parent}", memory_mapped)


def _check_summary(summary: dict[str, Any]) -> None:
    """ValueError where result.json holds anything else than `Result._summary` puts there."""
    for name in ("figures", "settings", "versions"):
        if not isinstance(summary.get(name), dict):
            raise ValueError(f"its {name} are no JSON object")
    figures = summary["figures"]
    for name in _NEEDED:
        if name not in figures:
            raise ValueError(f"the figure '{name}' is missing")
    for name, value in figures.items():
        if not (value is None or _is_number(value)):
            raise ValueError(f"the figure '{name}' cannot be {value!r}")
    if not isinstance(figures["items"], int):
        raise ValueError(f"a map of {figures['items']} items")
    if "took_s" in summary and not _is_number(summary["took_s"]):
        raise ValueError(f"it took {summary['took_s']!r} s")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _check_fit(result: Result) -> None:
    """ValueError where the files of a folder are not of one result."""
    queries, items = len(result.judged), result.figures["items"]
    if len(result.answers.item) and result.answers.item.max() >= items:
        raise ValueError(f"item {result.answers.item.max()} of {items}")
    for name, array, shape in (
        ("query_xy", result.query_xy, (queries, 2)),
        ("item_xy", result.item_xy, (items, 2)),
        ("scores", result.scores, (queries, items)),
        ("pr_curve", result.curve, result.curve.shape),
    ):
        if array is not None and (array.shape != shape or array.dtype not in (np.float64, np.float32)):
            raise ValueError(f"its {name} are {array.dtype} {array.shape} in place of floats {shape}")
    shown = result.similarity
    if shown is not None and (shown.ndim != 2 or shown.dtype != np.uint8 or not shown.size):
        raise ValueError(f"its similarity is {shown.dtype} {shown.shape} in place of uint8 in two dimensions")
    if result.samples is not None and np.any(result.samples.query >= queries):
        raise ValueError(f"samples of queries beyond the {queries}")


def _write_matches(path: Path, result: Result) -> None:
    item, score, accepted = result.answers
    flags = [column.astype(int).tolist() for column in (result.judged, result.seen, result.right)]
    shown = ["" if np.isnan(value) else repr(value) for value in score.tolist()]
    true_item = [""] * len(item) if result.true_item is None else result.true_item.tolist()
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(_MATCHES)
        writer.writerows(
            zip(range(len(item)), result.t_us.tolist(), item.tolist(), shown, accepted.astype(int).tolist(),
                *flags, true_item, strict=True)
        )  # fmt: skip


def _read_matches(text: str) -> tuple[Answers, dict[str, NDArray[Any]]]:
    rows = list(csv.DictReader(io.StringIO(text, newline="")))
    column = {name: [row[name] for row in rows] for name in _MATCHES[:-1]}
    flags = {name: np.array(column[name], np.int64).astype(np.bool_) for name in ("judged", "seen", "right")}
    answers = Answers(
        np.array(column["item"], np.int64),
        np.array([text or "nan" for text in column["score"]], np.float64),
        np.array(column["accepted"], np.int64).astype(np.bool_),
    )
    found = {"t_us": np.array(column["t_us"], np.int64)} | flags
    true_item = [row.get("true_item") or "" for row in rows]  # not every result has this column
    if all(true_item):
        found["true_item"] = np.array(true_item, np.int64)
    return answers, found
