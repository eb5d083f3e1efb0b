"""Small made results, and the folder that a whole run of the paper's tables and curves leaves."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np

from evplace.evaluation import Result, measure, sample, truth
from evplace.matchers import Path as Answers

QUERIES = ("night-1", "rain-1", "day-2", "night-2", "rain-2")


def make_result(seed: int = 0, queries: int = 60, size: tuple[int, ...] = (12, 16)) -> Result:
    """A bent drive past 20 items, of which most queries are found; some are wrong, rejected or unseen."""
    rng = np.random.default_rng(seed)
    along = np.linspace(0, 420, queries)
    here = 500_000 + np.column_stack([np.minimum(along, 250), np.maximum(along - 250, 0)])
    far = np.linspace(0, 400, 20)
    there = 500_000 + np.column_stack([np.minimum(far, 250), np.maximum(far - 250, 0)])
    item = np.abs(here[:, None] - there[None]).sum(axis=2).argmin(axis=1)
    lost = rng.random(queries) < 0.25
    item[lost] = rng.integers(0, 20, lost.sum())
    score = np.where(lost, 0.4, 0.8) + 0.2 * rng.random(queries)
    answers = Answers(item, score, score > 0.5)
    settings = {"answers": "live", "matcher": {"name": "local", "K": 5}, "scorer": "network"}
    right = truth.by_radius(here, there, 12.0)
    made = measure(answers, right, None, there, np.arange(queries), settings, here)
    images = rng.integers(0, 255, (queries, *size), np.uint8)
    return dataclasses.replace(sample(made, images, lambda items: images[items]), took_s=1.25)


def table2() -> dict[str, object]:
    """Two matchers, two inputs (events from two sensors), both rules."""
    rows = [
        {
            "database": "day-1", "query": query, "input": kind, "sensor": sensor, "matcher": matcher,
            "answers": "live",
            "rule": rule,
            "mean": 90.0 - 9 * number - (30 if kind == "colour" else 0) - (10 if rule == "view" else 0),
            "spread": 1.5, "seeds": 3, "values": [], "seen": 88.25, "rejected": 3.5, "chance": 4.0,
            "paper": 85.8 if sensor != "weak" and rule == "places" else None,
        }
        for rule in ("places", "view")
        for matcher in ("global-max", "Algorithm 1")
        for number, query in enumerate(QUERIES)
        for kind, sensor in (("events", "ideal"), ("events", "weak"), ("colour", "camera"))
    ]  # fmt: skip
    return {
        "format": "evplace-table-1", "title": "Table 2: events and colour", "rows": rows, "took_s": 321.5,
        "settings": {"cell_m": 20, "train": {"steps": 1000}}, "versions": {"evplace": "0.1.0"},
    }  # fmt: skip


def figure5() -> dict[str, object]:
    """Two panels; in each three methods, one of them of one point, and the paper's."""
    curves = []
    papers = []
    for panel, query in (("day-night", "night-1"), ("day-rain", "rain-1")):
        for number, (kind, matcher) in enumerate([("events", "Algorithm 1"), ("colour", "Algorithm 1")]):
            points = [[t / 10, t / 10, 1 - number * 0.3 - t / 25] for t in range(11)]
            curves.append(
                {
                    "panel": panel, "query": query, "input": kind, "sensor": "ideal", "matcher": matcher,
            "answers": "live",
                    "parameter": "tau1", "points": points, "average_precision": 0.8 - number * 0.3,
                    "spread": 0.01, "seeds": 3,
                }
            )  # fmt: skip
        papers.append({"panel": panel, "method": "SeqSLAM", "points": [[0.1, 0.99], [0.9, 0.6]]})
        papers.append({"panel": panel, "method": "graph", "points": [[0.5, 0.7]]})
    return {"format": "evplace-curves-1", "curves": curves, "paper": papers, "versions": {}, "took_s": 12.0}


def ablations() -> dict[str, object]:
    """One that helps, one that harms, one that does nothing."""
    rows = [
        {
            "name": name, "change": f"{name} changed", "query": "night-1", "mean": 90 + effect, "spread": 1.0,
            "effect": effect, "effect_spread": 0.8, "verdict": verdict, "seeds": 3,
        }
        for name, effect, verdict in [
            ("no blur", -0.3, "no effect seen"), ("half the K", -12.5, "worse"),
            ("no last ReLU", 4.5, "better"),
        ]
    ]  # fmt: skip
    return {"format": "evplace-ablations-1", "baseline": {"query": "night-1", "mean": 90.0}, "rows": rows}


def write_run(folder: Path, results: int = 2) -> Path:
    """A folder with everything in it."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, sheet in [("table2", table2()), ("figure5", figure5()), ("ablations", ablations())]:
        (folder / f"{name}.json").write_text(json.dumps(sheet))
    for number in range(results):
        make_result(number).save(folder / "results" / f"night-{number} events")
    return folder


def make_unanswered() -> Result:
    """A drive on which nothing is answered at all: there is no curve and nothing accepted."""
    here = np.column_stack([np.arange(6.0), np.zeros(6)])
    nothing = Answers(np.full(6, -1), np.full(6, np.nan), np.zeros(6, np.bool_))
    return measure(nothing, truth.by_radius(here, here[:2], 1.0), positions=here[:2], query_xy=here)
