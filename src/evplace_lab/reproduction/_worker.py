"""Many cases in a process of its own: see `evplace.core.workers`."""

from __future__ import annotations

import dataclasses
import itertools
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import MissingExtraError
from evplace.core.settings import make
from evplace.core.workers import serve
from evplace.evaluation import Result, measure, sample
from evplace.evaluation._evaluate import item_images, xy_in
from evplace.evaluation.sweeps import SWEPT, sweep
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap
from evplace.scorers._network.training import TrainSettings, train
from evplace_lab.reproduction import Drives
from evplace_lab.reproduction._cases import Case
from evplace_lab.reproduction._cities import Cities
from evplace_lab.reproduction._real_sets import RealSets
from evplace_lab.reproduction._runs import Runs

KINDS: dict[str, type[Cities] | type[RealSets]] = {kind.__name__: kind for kind in (Cities, RealSets)}


def work(job: dict[str, Any], say: Callable[[str], None]) -> None:
    """Answer the cases of all groups of `job`, each of which shares a map; says what was done, one by one."""
    drives = KINDS[job["kind"]].from_dict(job["drives"])
    runs = Runs(Path(job["out"]), drives.source)
    for group in job["groups"]:
        _answer_group([Case.from_dict(values) for values in group], drives, runs, say)


def _answer_group(cases: list[Case], drives: Drives, runs: Runs, say: Callable[[str], None]) -> None:
    """Learn the map of `cases`, and answer them one query and scorer after the other."""
    day = drives.opened(cases[0].database, cases[0])
    learned = _learned(cases[0], day, drives, runs)
    for _, group in itertools.groupby(cases, lambda case: (case.query, case.scorer, case.scorer_settings)):
        same = list(group)
        settings = {**learned.settings, "scorer": same[0].scorer_settings}
        place_map = dataclasses.replace(learned, scorer=same[0].scorer, settings=settings)
        query = drives.opened(same[0].query, same[0])
        rows: NDArray[np.float32] | None = None
        for case in same:
            rows = _answer(case, place_map, query, day, rows, drives, runs)
            say(f"{case.query} {case.part} {case.scorer} {case.matcher}")


def _use_one_thread() -> None:
    """As many trainings run as there are cores; and the number of threads would change the last bits."""
    try:
        import torch
    except ModuleNotFoundError as error:
        raise MissingExtraError("torch", "train", "training the network") from error
    torch.set_num_threads(1)


def _learned(case: Case, day: Traverse, drives: Drives, runs: Runs) -> PlaceMap:
    """The map of a case: read where it is there, else learned, and kept where that took long."""
    places = drives.places(day, case)
    if case.train is None:
        return train(day, places, case.scorer, scorer_settings=case.scorer_settings)
    file = runs.map_file(case)
    if not file.exists():
        _use_one_thread()
        settings = make(TrainSettings, case.train)
        began = time.process_time()
        place_map = train(day, places, settings=settings, checkpoint=file.with_suffix(".checkpoint"))
        place_map.settings["train_cpu_s"] = round(time.process_time() - began, 1)
        place_map.save(file)
    return PlaceMap.load(file)


def _answer(
    case: Case,
    place_map: PlaceMap,
    query: Traverse,
    day: Traverse,
    rows: NDArray[np.float32] | None,
    drives: Drives,
    runs: Runs,
) -> NDArray[np.float32]:
    """Answer one case and keep what came out; returns the score rows, for the next one."""
    began = time.process_time()
    where = Localizer(place_map, case.matcher, **case.matcher_settings)
    path, rows = where.path(query, rows)
    found: dict[str, Any] = {}
    for rule, truth in drives.truths(place_map, query, case).items():
        settings = {"key": runs.key(case), "map": place_map.settings, "matcher": where.settings}
        positions, xy = place_map.items.position, xy_in(place_map, query)
        result = measure(path, truth, rows, positions, query.t_us, settings, xy)
        found[rule] = {"figures": result.figures}
        first = len(found) == 1  # the paper's rule
        if case.swept and first:
            distances = where.scorer.distances
            found[rule]["curve"] = _curve(case, rows, query, result, truth.right, distances).tolist()
        if case.keep and first:
            show = item_images(place_map, query, day)
            assert show is not None  # the map's drive lends its images
            sample(result, query.images, show).save(runs.result_folder(case), overwrite=True)
    taken = {"cpu_s": round(time.process_time() - began, 2)}
    taken["train_cpu_s"] = place_map.settings.get("train_cpu_s", 0.0)
    runs.keep(case, {"rules": found, **taken})
    return rows


def _curve(
    case: Case,
    rows: NDArray[np.float32],
    query: Traverse,
    result: Result,
    right: NDArray[np.bool_],
    distances: bool,
) -> NDArray[np.float64]:
    """(values, 3) the swept parameter's value, recall (of the seen) and precision, in the order of recall.

    `right` (queries, items) is the truth.
    """
    filled = np.flatnonzero(query.counts != 0)
    parameter = SWEPT[case.matcher]
    others = {name: value for name, value in case.matcher_settings.items() if name != parameter}
    values = _every_level(rows[filled]) if case.matcher == "local" else None
    points = []
    for value, path in sweep(case.matcher, rows[filled], values, parameter, distances=distances, **others):
        item = np.full(len(query), -1, np.int64)
        item[filled] = np.where(path.accepted, path.item, -1)
        accepted = (item >= 0)[result.judged]
        hits = (accepted & right[np.arange(len(item)), item][result.judged]).sum()
        if accepted.any():
            seen = max(int(result.seen[result.judged].sum()), 1)
            points.append((value, hits / seen, hits / accepted.sum()))
    curve = np.array(sorted(points, key=lambda point: (point[1], -point[2]))).reshape(-1, 3)
    return np.asarray(np.nan_to_num(curve, posinf=1e30, neginf=-1e30), np.float64)


def _every_level(rows: NDArray[np.float32]) -> list[float]:
    """Every value of tau1 at which some answer can change."""
    return [float(value) for value in np.unique(rows.max(axis=1))[::-1]] + [-1.0]


if __name__ == "__main__":
    sys.exit(serve(work))
