"""Result: the folder that keeps an evaluation."""

from __future__ import annotations

import csv
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace import storage
from evplace.errors import EvaluationError, InputError
from evplace.evaluation._measures import CURVE, Bools, Floats
from evplace.matchers import Path as Answers

_MATCHES = ("query", "t_us", "item", "score", "accepted", "judged", "seen", "right")


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

    def save(self, path: str | Path, overwrite: bool = False, with_scores: bool = False) -> None:
        """A folder: result.json, matches.csv, pr_curve.npy, and pr_curve.png where matplotlib is installed.

        `with_scores` adds scores.npy. Raises OutputError where the folder cannot be written.
        """
        with storage.new_folder(path, overwrite) as folder:
            summary = {"figures": self.figures, "settings": self.settings, "versions": self.versions}
            storage.write_json(folder / "result.json", summary)
            _write_matches(folder / "matches.csv", self)
            np.save(folder / "pr_curve.npy", self.curve)
            _draw_curve(folder / "pr_curve.png", self.curve)
            if with_scores and self.scores is not None:
                np.save(folder / "scores.npy", self.scores)

    @classmethod
    def load(cls, path: str | Path) -> Result:
        """The result in a folder; EvaluationError where it is none or damaged."""
        folder = Path(path)
        try:
            summary = storage.read_json(folder / "result.json", "a result")
            curve = storage.read_array(folder / "pr_curve.npy", "a result").reshape(-1, len(CURVE))
            kept = folder / "scores.npy"
            scores = storage.read_array(kept, "a result", memory_mapped=True) if kept.exists() else None
            answers, columns = _read_matches(folder / "matches.csv")
            return cls(
                summary["figures"], summary["settings"], summary["versions"], answers, **columns,
                curve=curve, scores=scores,
            )  # fmt: skip
        except InputError as error:
            raise EvaluationError(str(error)) from error
        except (OSError, EOFError, KeyError, ValueError) as error:
            raise EvaluationError(f"the result in {folder} is damaged ({error}): evaluate again") from error


def _write_matches(path: Path, result: Result) -> None:
    item, score, accepted = result.answers
    flags = [column.astype(int).tolist() for column in (result.judged, result.seen, result.right)]
    shown = ["" if np.isnan(value) else repr(value) for value in score.tolist()]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(_MATCHES)
        writer.writerows(
            zip(range(len(item)), result.t_us.tolist(), item.tolist(), shown, accepted.astype(int).tolist(),
                *flags, strict=True)
        )  # fmt: skip


def _read_matches(path: Path) -> tuple[Answers, dict[str, NDArray[Any]]]:
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    column = {name: [row[name] for row in rows] for name in _MATCHES}
    flags = {name: np.array(column[name], np.int64).astype(np.bool_) for name in ("judged", "seen", "right")}
    answers = Answers(
        np.array(column["item"], np.int64),
        np.array([text or "nan" for text in column["score"]], np.float64),
        np.array(column["accepted"], np.int64).astype(np.bool_),
    )
    return answers, {"t_us": np.array(column["t_us"], np.int64)} | flags


def _draw_curve(path: Path, curve: Floats) -> None:
    """The curve as a picture, where matplotlib is installed."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return
    figure = Figure(figsize=(5, 4), layout="constrained")
    axes = figure.add_subplot(xlabel="recall", ylabel="precision", xlim=(0, 1.02), ylim=(0, 1.02))
    axes.plot(curve[:, 2], curve[:, 1], marker="." if len(curve) < 30 else None)
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=120)
