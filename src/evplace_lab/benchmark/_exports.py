"""The tasks and our own lists in the layout of MegaEvent: for whoever works with its tools.

For each query drive a folder: positives.npy, (references, queries) bool; retrievals.csv, our ranked list
(query_id,reference_id,rank,score); samples.json, when each image was taken; run.json, how the list was made.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from evplace.core.storage import new_folder, write_array, write_json
from evplace.evaluation import versions
from evplace.localizer import Localizer
from evplace.placemap import train
from evplace_lab.benchmark._submissions import LISTED
from evplace_lab.benchmark._tasks import Task

TOP = 20
"""References in a list."""
MARK = "retrievals.csv"
SCORER = "ncc"
"""Whose list it is: one that scores every image of the map, as these lists number them."""


def export(tasks: Sequence[Task], out: Path) -> list[Path]:
    """Write a folder for each task; one that was written here is replaced."""
    place_map = train(tasks[0].database, tasks[0].places, SCORER, matcher="best")
    where = Localizer(place_map)
    folders = []
    for task in tasks:
        with new_folder(out / task.query_name, overwrite=True, mark=MARK) as folder:
            answered = where.answers(task.query)
            _write_list(folder / MARK, np.asarray(answered.rows))
            write_array(folder / "positives.npy", np.ascontiguousarray(task.truth_of(place_map).right.T))
            sides = {"reference": task.database.t_us, "query": task.query.t_us}
            samples = {
                side: [{"id": at, "end_us": int(t)} for at, t in enumerate(t_us)]
                for side, t_us in sides.items()
            }
            write_json(folder / "samples.json", samples)
            about = {"model": f"evplace {SCORER}", "top_k": TOP, "rule": task.rule, "versions": versions()}
            write_json(folder / "run.json", about)
        folders.append(out / task.query_name)
    return folders


def _write_list(path: Path, rows: np.ndarray) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(LISTED)
        for query, row in enumerate(rows):
            best = np.argsort(-row, kind="stable")[:TOP]
            writer.writerows(
                (query, int(item), rank, f"{row[item]:.6g}") for rank, item in enumerate(best, 1)
            )
