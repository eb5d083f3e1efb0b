"""Other methods beside ours, judged by the same rules: `evplace bench`.

What a method gives is turned into score rows (`_submissions`), matched by matchers of ours, and measured
against the truth of a city (`_tasks`). docs/protocol.md says what is frozen and what counts.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.storage import new_file, write_json
from evplace.evaluation import Result, sample, versions
from evplace.evaluation._evaluate import evaluate, hear, judged
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap, train
from evplace.places import Places
from evplace.scorers import Content, Learned, Learning, OpenScorer
from evplace_lab.benchmark._submissions import Given, Submission
from evplace_lab.benchmark._tasks import Rule, Task, tasks_of

__all__ = ["OURS", "Given", "Rule", "Submission", "Table", "Task", "bench", "check", "tables", "tasks_of"]

FORMAT = "evplace-bench-1"
Watch = Callable[[int, int, str], None]
FIGURES = {
    "accuracy": "accuracy", "accuracy_seen": "of seen", "recall@1_seen": "R@1", "recall@5_seen": "R@5",
    "recall@20_seen": "R@20", "average_precision": "AP", "recall_at_full_precision": "R@100%P",
    "auroc": "AUROC", "false_accept_rate": "false accepts", "chance_seen": "chance",
}  # fmt: skip
"""Figure of a result -> the head of its column, all in %."""


@dataclass(frozen=True)
class Ours:
    """A method of ours that stands beside others."""

    scorer: str
    matcher: str | None
    preset: str | None = None


OURS = {
    "best": Ours("fused", None),
    "best, single images": Ours("fused", "best"),
    "ncc": Ours("ncc", "best"),
    "paper": Ours("network", "local", "paper"),
}
"""What evplace does by itself, that without its filter, plain correlation, and the paper's method (torch)."""


class Table(NamedTuple):
    """Something to print."""

    title: str
    columns: list[str]
    rows: list[list[str]]


class _Opened:
    distances = False

    def __init__(self, items: int) -> None:
        self._items = items

    def rows(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        """See OpenScorer: nobody asks, since the rows are given."""
        return np.zeros((len(images), self._items), np.float32)


@dataclass(frozen=True)
class _Scored:
    """A scorer whose rows were given by another program."""

    items: int

    def learn(self, reference: Traverse, places: Places, learning: Learning) -> Learned:
        """See Scorer."""
        del reference, places, learning
        return Learned({}, np.arange(self.items))

    def open(self, content: Content) -> OpenScorer:
        """See Scorer."""
        del content
        return _Opened(self.items)


def bench(
    tasks: Sequence[Task],
    submissions: Sequence[Submission],
    ours: Sequence[str],
    matchers: Sequence[str],
    out: Path,
    watch: Watch,
) -> dict[str, Any]:
    """Judge all methods on all tasks; results go to `out/results`, the document to `out/bench.json`.

    InputError names the file of a submission that is missing or does not fit, before anything is judged.
    """
    check(tasks, submissions)
    jobs = [(method, matcher) for method in submissions for matcher in matchers]
    total = len(tasks) * (len(jobs) + len(ours))
    rows: list[dict[str, Any]] = []
    for result, about in _judged(tasks, jobs, ours):
        watch(len(rows), total, f"{about['query']} {about['method']}")
        name = f"{about['query']} {about['method']}".replace("/", "-")
        result.save(out / "results" / name, overwrite=True)
        rows.append({**about, **{name: result.figures.get(name) for name in (*FIGURES, *TIES)}})
    document = {
        "format": FORMAT,
        "rows": rows,
        "rule": tasks[0].rule,
        "input": tasks[0].part,
        "versions": versions(),
    }
    with new_file(out / "bench.json", overwrite=True) as partial:
        write_json(partial, document)
    return document


TIES = ("recall@1_worst_ties", "recall@1_best_ties", "queries", "seen", "unseen")


def check(tasks: Sequence[Task], submissions: Sequence[Submission]) -> list[tuple[str, str, Given]]:
    """What each submission was taken for on each task; InputError where one does not fit."""
    return [(method.name, task.query_name, method.given(task)) for method in submissions for task in tasks]


def _judged(
    tasks: Sequence[Task], jobs: Sequence[tuple[Submission, str]], ours: Sequence[str]
) -> Iterator[tuple[Result, dict[str, Any]]]:
    for name in ours:
        place_map = _learned(tasks[0], OURS[name])
        for task in tasks:
            where = Localizer(
                place_map, OURS[name].matcher, OURS[name].preset if OURS[name].matcher else None
            )
            result = evaluate(where, task.query, task.truth_of(place_map))
            yield (
                result,
                {"method": name, "query": task.query_name, "condition": task.condition, "held_out": True},
            )
    for task in tasks:
        for method, matcher in jobs:
            label = method.name if matcher == "best" else f"{method.name}, {matcher}"
            held_out = task.condition not in method.about.trained_on
            about = {"method": label, "query": task.query_name, "condition": task.condition}
            yield _of_submission(task, method, matcher), {**about, "held_out": held_out}


def _learned(task: Task, ours: Ours) -> PlaceMap:
    """The map of a method of ours."""
    return train(task.database, task.places, ours.scorer, ours.preset)


def _of_submission(task: Task, method: Submission, matcher: str) -> Result:
    """What a method's rows and one of our matchers say, live."""
    given, began = method.given(task), time.perf_counter()
    track = task.database.track
    assert track is not None  # it has items
    scored = _Scored(task.shape[1])
    place_map = PlaceMap(
        scored, task.places, task.items, np.column_stack([track.xy, track.heading_deg]), {},
        task.database.images.shape[1:], task.database.recipe, (track.zone, track.northern),
        matcher=families.make("matchers", matcher),
    )  # fmt: skip
    where = Localizer(place_map)
    heard = hear(where, task.query, [task.truth(task.items)], "live", given.rows)
    result = judged(where, task.query, heard, 0)
    known = result.settings | {"map": {"scorer": {"name": method.name, "given": given.kind}}}
    result = dataclasses.replace(result, settings=known, took_s=round(time.perf_counter() - began, 3))
    return sample(result, task.query.images, lambda items: np.asarray(task.database.images[items]))


def tables(document: dict[str, Any]) -> Iterator[Table]:
    """A table of all queries, and one of means: by condition, and of what a method was not trained on."""
    rows = document["rows"]
    methods = list(dict.fromkeys(row["method"] for row in rows))
    lines = []
    for query in dict.fromkeys(row["query"] for row in rows):
        for row in (row for row in rows if row["query"] == query):
            cells = [_percent(row.get(name)) for name in FIGURES]
            cells[2] += _bracket(row)
            mark = "" if row["held_out"] else " *"
            lines.append([query, row["method"] + mark, *cells])
    rule = f"right by {document['rule']}; {document['input']}"
    heads = ["query", "method", *FIGURES.values()]
    yield Table(
        f"In %, {rule}; R@1, R@5 and R@20 of the scores alone, on images whose place is known", heads, lines
    )
    conditions = list(dict.fromkeys(row["condition"] for row in rows))
    lines = [
        [method, *_means([row for row in rows if row["method"] == method], conditions)] for method in methods
    ]
    heads = [
        "method",
        *(f"{condition}: accuracy, R@1" for condition in conditions),
        "held out: accuracy, R@1",
    ]
    yield Table("Means by condition; held out: without those that a method was trained on (*)", heads, lines)


def _means(rows: list[dict[str, Any]], conditions: Sequence[str]) -> list[str]:
    groups = [[row for row in rows if row["condition"] == condition] for condition in conditions]
    return [_pair(group) for group in (*groups, [row for row in rows if row["held_out"]])]


def _pair(rows: list[dict[str, Any]]) -> str:
    """Mean accuracy and recall@1."""
    cells = []
    for name in ("accuracy", "recall@1_seen"):
        known = [row[name] for row in rows if row.get(name) is not None]
        cells.append(_percent(sum(known) / len(known) if known else None))
    return ", ".join(cells)


def _bracket(row: dict[str, Any]) -> str:
    """Where ties leave recall@1 open, between what it lies."""
    low, high = row.get("recall@1_worst_ties"), row.get("recall@1_best_ties")
    if low is None or high is None or high - low < 0.0005:
        return ""
    return f" ({_percent(low)} to {_percent(high)})"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.1f}"
