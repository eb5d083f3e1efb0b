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
from evplace.core.tables import rows_of
from evplace.core.workers import serve
from evplace.evaluation import Result, sample
from evplace.evaluation._evaluate import Heard, hear, item_images, judged
from evplace.evaluation.sweeps import sweep
from evplace.evaluation.truth import Truth
from evplace.imaging.traverse import Traverse
from evplace.localizer import Answers, Localizer
from evplace.matchers import RouteMatcher
from evplace.matchers.best import Best
from evplace.matchers.local import Local
from evplace.placemap import PlaceMap, calibrate, train
from evplace.scorers import Learning, Rows
from evplace_lab.reproduction import Drives
from evplace_lab.reproduction._cases import Case
from evplace_lab.reproduction._panels import Panels
from evplace_lab.reproduction._real_sets import RealSets
from evplace_lab.reproduction._runs import TIMINGS, Runs

KINDS: dict[str, type[Panels] | type[RealSets]] = {kind.__name__: kind for kind in (Panels, RealSets)}


def work(job: dict[str, Any], say: Callable[[str], None]) -> None:
    """Answer the cases of all groups of `job`, each of which shares a map; says what was done, one by one."""
    drives = KINDS[job["kind"]].from_dict(job["drives"])
    runs = Runs(Path(job["out"]), drives.source)
    for group in job["groups"]:
        cases = [Case.from_dict(values) for values in group]
        todo = [case for case in cases if not runs.done(case)]  # a killed worker may have done some
        if todo:
            _answer_group(todo, drives, runs, say)


def _answer_group(cases: list[Case], drives: Drives, runs: Runs, say: Callable[[str], None]) -> None:
    """Learn the map of `cases`, and answer them one query and scorer after the other."""
    day = drives.opened(cases[0].database, cases[0])
    learned = _calibrated(_learned(cases[0], day, drives, runs), cases)
    for _, group in itertools.groupby(cases, lambda case: (case.query, case.scorer, case.scorer_settings)):
        same = list(group)
        place_map = dataclasses.replace(learned, scorer=same[0].scorer_part)
        query = drives.opened(same[0].query, same[0])
        rows: dict[str, Rows] = {}
        for case in same:
            _answer(case, place_map, query, day, rows, drives, runs)
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
        return train(day, places, case.scorer_part, matcher=Best())
    file = runs.map_file(case)
    if not file.exists():
        _use_one_thread()
        began = time.process_time()
        learning = Learning(checkpoint=file.with_suffix(".checkpoint"))
        place_map = train(day, places, case.scorer_part, learning=learning, matcher=Best())
        place_map.info["train_cpu_s"] = round(time.process_time() - began, 1)
        place_map.save(file)
    return PlaceMap.load(file)


def _calibrated(place_map: PlaceMap, cases: list[Case]) -> PlaceMap:
    """The map with what the matcher learns of it that one of the cases wants, where it is one that learns."""
    learning = (case.matcher_part for case in cases if isinstance(case.matcher_part, RouteMatcher))
    matcher = next(learning, None)
    return place_map if matcher is None else calibrate(place_map, matcher)


def _answer(
    case: Case,
    place_map: PlaceMap,
    query: Traverse,
    day: Traverse,
    rows: dict[str, Rows],
    drives: Drives,
    runs: Runs,
) -> None:
    """Answer one case, live and in hindsight, and keep what came out; `rows` go from case to case."""
    began = time.process_time()
    where = Localizer(place_map, case.matcher_part)
    truths = drives.truths(place_map, query, case)
    found: dict[str, Any] = {}
    for timing in TIMINGS:
        heard = hear(
            where, query, list(truths.values()), timing, rows.get(timing), case.swept or None,
            checkpoint=runs.checkpoint(case),
        )  # fmt: skip
        if heard.rows is not None:  # in memory, or needed for a curve: they serve the next case
            rows[timing] = heard.rows
        found[timing] = _by_rules(case, where, query, heard, list(truths))
        if case.keep and timing == "live":
            _keep(case, judged(where, query, heard, 0), place_map, query, day, runs)
    taken = {"cpu_s": round(time.process_time() - began, 2)}
    taken["train_cpu_s"] = place_map.info.get("train_cpu_s", 0.0)
    runs.keep(case, {**found, **taken})


def _keep(
    case: Case, result: Result, place_map: PlaceMap, query: Traverse, day: Traverse, runs: Runs
) -> None:
    """Keep a whole result, with images of some matches."""
    show = item_images(place_map, query, day)
    assert show is not None  # the map's drive lends its images
    known = dataclasses.replace(result, settings=result.settings | {"key": runs.key(case)})
    sample(known, query.images, show).save(runs.result_folder(case), overwrite=True)


def _by_rules(
    case: Case, where: Localizer, query: Traverse, heard: Heard, rules: list[str]
) -> dict[str, Any]:
    """Rule -> figures, and by the first rule, which is the paper's, the curve where it is wanted."""
    found: dict[str, Any] = {}
    for number, rule in enumerate(rules):
        result = judged(where, query, heard, number)
        found[rule] = {"figures": result.figures}
        if case.swept and not number:
            assert heard.rows is not None
            found[rule]["curve"] = _curve(
                where, heard.rows, query, result, heard.truths[0], heard.answers
            ).tolist()
    return found


def _curve(
    where: Localizer,
    rows: Rows,
    query: Traverse,
    result: Result,
    truth: Truth,
    timing: Answers,
) -> NDArray[np.float64]:
    """(values, 3) the swept parameter's value, recall (of the seen) and precision, in the order of recall."""
    filled = np.flatnonzero(query.counts != 0)
    shown, judged = rows_of(rows, filled), result.judged[filled]
    values = _every_level(shown) if isinstance(where.matcher, Local) else None
    points, item, right = [], np.full(len(query), -1, np.int64), np.zeros(len(query), np.bool_)
    for value, path in sweep(where.matcher, shown, values, None, where.scorer.distances, timing):
        if not np.array_equal(item[filled], path.item):  # one path may be judged at many values
            item[filled] = path.item
            right = truth.accepts(item)
        accepted = (path.accepted & (path.item >= 0))[judged]
        hits = (accepted & right[filled][judged]).sum()
        if accepted.any():
            seen = max(int(result.seen[result.judged].sum()), 1)
            points.append((value, hits / seen, hits / accepted.sum()))
    curve = np.array(sorted(points, key=lambda point: (point[1], -point[2]))).reshape(-1, 3)
    return np.asarray(np.nan_to_num(curve, posinf=1e30, neginf=-1e30), np.float64)


def _every_level(rows: Rows) -> list[float]:
    """Every value of tau1 at which some answer can change."""
    return [float(value) for value in np.unique(rows.max(axis=1))[::-1]] + [-1.0]


if __name__ == "__main__":
    sys.exit(serve(work))
