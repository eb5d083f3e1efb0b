"""What another method gives: scores, descriptors or ranked lists, from a file or a folder, as score rows.

A folder holds, for each query drive, one of

    night-1.npy                          scores (queries, references), or (references, queries) by its shape
    night-1.npy and day-1.npy            descriptors (images, dimensions) of both drives
    night-1.csv                          a ranked list: query_id,reference_id,rank,score (MegaEvent)
    night-1/retrievals.csv               the same, in a folder as it is written there
    night-1/similarity_matrix.npy        Event-LAB's (references, queries); or distance_matrix.npy
    night-1/queries_descriptors.npy      and database_descriptors.npy, as gmberton's evaluation saves them

and, if wished, method.toml: `trained_on`, the conditions that it was trained on, and `distances`. The images
are all those of both drives, in their order, and are numbered from 0.
"""

from __future__ import annotations

import csv
import functools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core import settings, storage
from evplace.core.errors import InputError, ScoresError
from evplace.matchers import _files
from evplace_lab.benchmark._tasks import Task

Rows = NDArray[np.float32]
Layout = str
LISTED = ("query_id", "reference_id", "rank", "score")
ABOUT = "method.toml"
UNLISTED = 1.0
"""So far below the last of a list are the references that it does not name, in spans of its scores."""
BLOCK = 256


@dataclass(frozen=True)
class About:
    """What a method says of itself."""

    trained_on: tuple[str, ...] = ()
    """Conditions whose drives it was trained on: a query of one is no test of it."""
    distances: bool = False
    """Whether smaller is better in its matrices."""


class Given(NamedTuple):
    """What was read for one task."""

    rows: Rows
    """(queries, references) scores, larger is better."""
    kind: str
    """As people read it: what the file was taken for."""
    listed: int | None
    """How many references a query's list names at least; None where all are scored."""


@dataclass(frozen=True)
class Submission:
    """A method's name and where its files lie."""

    name: str
    path: Path
    layout: Layout | None = None
    """What rows and columns of its matrices are: query-reference or reference-query; by default what fits."""
    distances: bool = False

    @property
    def about(self) -> About:
        """What method.toml says; SettingsError where it cannot be read."""
        file = self.path / ABOUT
        return settings.make(About, settings.from_toml(file)) if file.is_file() else About()

    def given(self, task: Task) -> Given:
        """Its scores for a task; InputError says which file is missing or does not fit."""
        kind, read = self._found(task)
        rows, listed = read()
        return Given(_checked(rows, task, kind), kind, listed)

    def _found(self, task: Task) -> tuple[str, Any]:
        """What there is for a task, and what reads it."""
        if self.path.is_file():
            return self._of_file(self.path, task)
        if not self.path.is_dir():
            raise InputError(f"the method '{self.name}': there is no {self.path}")
        inside = self.path / task.query_name
        for files in _descriptor_files(self.path, task):
            if all(file.is_file() for file in files):
                words = f"descriptors {files[0].name} and {files[1].name}"
                return words, functools.partial(_described, *files)
        for name in ("similarity_matrix.npy", "distance_matrix.npy"):
            if (inside / name).is_file():
                return self._of_matrix(inside / name, task, "reference-query", name.startswith("distance"))
        for file in (
            inside / "retrievals.csv",
            *(self.path / f"{task.query_name}{end}" for end in (".npy", ".csv")),
        ):
            if file.is_file():
                return self._of_file(file, task)
        raise InputError(
            f"the method '{self.name}' says nothing of {task.query_name}: {self.path} holds neither "
            f"{task.query_name}.npy, {task.query_name}.csv nor a folder {task.query_name}"
        )

    def _of_file(self, file: Path, task: Task) -> tuple[str, Any]:
        if file.suffix == ".csv":
            return f"ranked list {file.name}", lambda: _ranked(file, task)
        return self._of_matrix(file, task, self.layout, self.distances or self.about.distances)

    def _of_matrix(self, file: Path, task: Task, layout: Layout | None, distances: bool) -> tuple[str, Any]:
        taken = layout or _layout_of(file, task)
        words = f"{'distances' if distances else 'scores'} {file.name}, {taken}"
        return words, lambda: (_matrix(file, taken, distances), None)


def _descriptor_files(folder: Path, task: Task) -> Iterator[tuple[Path, Path]]:
    """Where descriptors of the queries and of the references may lie."""
    inside = folder / task.query_name
    yield inside / "queries_descriptors.npy", inside / "database_descriptors.npy"
    yield folder / f"{task.query_name}.npy", folder / f"{task.database_name}.npy"


def _layout_of(file: Path, task: Task) -> Layout:
    """What fits the shape; queries are rows where both do."""
    shape, (queries, references) = _files.open_scores(file).shape, task.shape
    if shape == (references, queries) and queries != references:
        return "reference-query"
    return "query-reference"


def _matrix(file: Path, layout: Layout, distances: bool) -> Rows:
    table = np.asarray(_files.open_scores(file), np.float32)
    rows = table.T if layout == "reference-query" else table
    return -rows if distances else rows


def _described(queries: Path, database: Path) -> tuple[Rows, None]:
    """Cosines of descriptors."""
    first, second = (
        _unit(storage.read_array(path, f"the descriptors {path}")) for path in (queries, database)
    )
    if first.shape[1] != second.shape[1]:
        raise ScoresError(
            f"{queries} has {first.shape[1]} dimensions, {database} has {second.shape[1]}: they differ"
        )
    rows = np.empty((len(first), len(second)), np.float32)
    for start in range(0, len(first), BLOCK):
        rows[start : start + BLOCK] = first[start : start + BLOCK] @ second.T
    return rows, None


def _unit(vectors: NDArray[Any]) -> Rows:
    if vectors.ndim != 2 or vectors.dtype.kind not in "fiu":
        raise ScoresError(
            f"descriptors have the shape (images, dimensions), not {vectors.dtype} {vectors.shape}"
        )
    values = np.asarray(vectors, np.float32)
    unit: Rows = values / np.maximum(np.linalg.norm(values, axis=1, keepdims=True), 1e-12)
    return unit


def _ranked(file: Path, task: Task) -> tuple[Rows, int]:
    """A ranked list as rows: what is not listed lies below all that is."""
    queries, references = task.shape
    entries = [(line, *entry) for line, entry in enumerate(_entries(file), 2)]
    for line, query, reference, _, _ in entries:
        if not (0 <= query < queries and 0 <= reference < references):
            raise ScoresError(
                f"{file}, line {line}: query {query} and reference {reference} are not among {queries} "
                f"queries and {references} references, which are numbered from 0"
            )
    scores = [score for *_, score in entries]
    low, high = min(scores, default=0.0), max(scores, default=1.0)
    rows = np.full(task.shape, low - UNLISTED * max(high - low, 1e-6), np.float32)
    counts = np.zeros(queries, np.int64)
    for _, query, reference, _, score in entries:
        rows[query, reference] = score
        counts[query] += 1
    return rows, int(counts.min(initial=references))


def _entries(file: Path) -> Iterator[tuple[int, int, int, float]]:
    """Query, reference, rank and score of each line; ScoresError names the line that cannot be read."""
    text = storage.read_bytes(file, f"the ranked list {file}").decode("utf-8-sig", "replace")
    reader = csv.DictReader(text.splitlines())
    missing = [name for name in LISTED if name not in (reader.fieldnames or ())]
    if missing:
        raise ScoresError(f"{file} has no column {', '.join(missing)}: a ranked list has {', '.join(LISTED)}")
    for line, row in enumerate(reader, 2):
        try:
            yield int(row["query_id"]), int(row["reference_id"]), int(row["rank"]), float(row["score"])
        except (TypeError, ValueError):
            shown = ",".join(str(row[name]) for name in LISTED)
            raise ScoresError(f"{file}, line {line} cannot be read: {shown[:80]}") from None


def _checked(rows: Rows, task: Task, kind: str) -> Rows:
    if rows.shape != task.shape:
        raise ScoresError(
            f"{kind} for {task.query_name} has the shape {rows.shape}: the benchmark has {task.shape[0]} "
            f"queries and {task.shape[1]} references, all images of {task.query_name}/{task.part} and of "
            f"{task.database_name}/{task.part}"
        )
    if not np.isfinite(rows).all():
        raise ScoresError(f"{kind} for {task.query_name} holds NaN or infinity")
    return rows
