"""Cases that share a map, in a process of its own: `python -m evplace.reproduction._worker JOB`."""

from __future__ import annotations

import dataclasses
import itertools
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.errors import MissingExtraError
from evplace.evaluation import Result, measure, sample
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap
from evplace.places import PlaceGrid
from evplace.reproduction._cases import Case
from evplace.reproduction._drives import Cities
from evplace.reproduction._runs import Runs
from evplace.settings import make
from evplace.sweeps import SWEPT, sweep
from evplace.training import TrainSettings, train
from evplace.traverse import Traverse
from evplace.trial import Rule, item_images, truth_of, xy_in
from evplace.workers import serve

RULES: tuple[Rule, ...] = ("places", "view")


def work(job: dict[str, Any], say: Callable[[str], None]) -> None:
    """Answer all cases of `job`, which share a map; says the key of each one that is done."""
    _one_thread_each(job["threads"])
    cities = Cities(Path(job["city"]), Path(job["beside"]))
    runs = Runs(Path(job["out"]), cities.settings)
    cases = [Case.from_dict(values) for values in job["cases"]]
    day = cities.opened(cases[0].database, cases[0])
    learned = _learned(cases[0], day, runs)
    for (query, scorer, _), group in itertools.groupby(
        cases, lambda case: (case.query, case.scorer, str(case.scorer_settings))
    ):
        same = list(group)
        place_map = dataclasses.replace(
            learned, scorer=scorer, settings={**learned.settings, "scorer": same[0].scorer_settings}
        )
        traverse = cities.opened(query, same[0])
        rows: NDArray[np.float32] | None = None
        for case in same:
            rows = _answer(case, place_map, traverse, day, rows, runs)
            say(case.key(runs.city))


def _one_thread_each(threads: int) -> None:
    """As many threads as there are cores for this worker: more would only get in each other's way."""
    os.environ["OMP_NUM_THREADS"] = str(threads)
    try:
        import torch
    except ModuleNotFoundError as error:
        raise MissingExtraError("torch", "train", "training the network") from error
    torch.set_num_threads(threads)


def _learned(case: Case, day: Traverse, runs: Runs) -> PlaceMap:
    """The map of a case: read where it is there, else learned, and kept where that took long."""
    assert day.track is not None  # the city knows where it is
    places = PlaceGrid.from_track(day.track, origin=case.origin)
    if case.train is None:
        return train(day, places, case.scorer, scorer_settings=case.scorer_settings)
    file = runs.map_file(case)
    if not file.exists():
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
    runs: Runs,
) -> NDArray[np.float32]:
    """Answer one case and keep what came out; returns the score rows, for the next one."""
    began = time.process_time()
    where = Localizer(place_map, case.matcher, **case.matcher_settings)
    path, rows = where.path(query, rows)
    found: dict[str, Any] = {}
    for rule in RULES:
        truth = truth_of(place_map, query, rule)
        settings = {"case": case.to_dict(), "map": place_map.settings, "matcher": where.settings}
        positions, xy = place_map.items.position, xy_in(place_map, query)
        result = measure(path, truth, rows, positions, query.t_us, settings, xy)
        found[rule] = {"figures": result.figures}
        if case.swept:
            found[rule]["curve"] = _curve(case, rows, query, result, truth.accepts).tolist()
        if case.keep and rule == "places":
            show = item_images(place_map, query, day)
            assert show is not None  # the day's drive lends its images
            sample(result, query.images, show).save(runs.result_folder(case), overwrite=True)
    runs.keep(case, {"rules": found, "cpu_s": round(time.process_time() - began, 2)})
    return rows


def _curve(
    case: Case,
    rows: NDArray[np.float32],
    query: Traverse,
    result: Result,
    accepts: Callable[[NDArray[np.int64]], NDArray[np.bool_]],
) -> NDArray[np.float64]:
    """(values, 3) the swept parameter's value, recall (of the seen) and precision, in the order of recall."""
    filled = np.flatnonzero(query.counts != 0)
    parameter = SWEPT[case.matcher]
    others = {name: value for name, value in case.matcher_settings.items() if name != parameter}
    values = _every_level(rows[filled]) if case.matcher == "local" else None
    points = []
    for value, path in sweep(
        case.matcher, rows[filled], values, parameter, distances=case.scorer in ("sad", "seqslam"), **others
    ):
        item = np.full(len(query), -1, np.int64)
        item[filled] = np.where(path.accepted, path.item, -1)
        accepted, right = (item >= 0)[result.judged], accepts(item)[result.judged]
        if accepted.any():
            seen = max(int(result.seen[result.judged].sum()), 1)
            points.append((value, right.sum() / seen, right.sum() / accepted.sum()))
    curve = np.array(sorted(points, key=lambda point: (point[1], -point[2]))).reshape(-1, 3)
    return np.asarray(np.nan_to_num(curve, posinf=1e30, neginf=-1e30), np.float64)


def _every_level(rows: NDArray[np.float32]) -> list[float]:
    """Every value of tau1 at which some answer can change."""
    return [float(value) for value in np.unique(rows.max(axis=1))[::-1]] + [-1.0]


if __name__ == "__main__":
    sys.exit(serve(work))
