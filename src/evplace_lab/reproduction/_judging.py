"""What judges answers, fitted to drives, and how well that judges the drives of a town that was left out.

Trees judge the answers of quick cameras, a logistic regression those of slow ones; each town is judged by
what is fitted without it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.matchers._known import ASKED, Judges, limit, said
from evplace_lab.reproduction._boosting import boosted

COLOUR = "colour"
"""The camera that each town has besides its sensors."""
KINDS = ("live", "late")
USED = "both, halfway"
"""Where `bayes` takes its thresholds from: the map, and other towns."""
ASKED_FOR = 0.01
"""Share of false accepts for which the thresholds are."""
RIDGE = 1e-3
"""Penalty on large weights."""
HOW_MUCH_LIVE, HOW_MUCH_LATE = 1, 2
"""So many of the last features say how much was seen: of live answers, and of both sides of late ones."""
LIVE_COUNTS = 0.5
"""What the log-odds of a live answer count beside those of the late one."""
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Answers(NamedTuple):
    """What one drive's answers looked like, and which were right."""

    features: dict[str, Floats]
    """"live" or "late" -> (queries, features)."""
    right: dict[str, Bools]
    known: Bools
    """(queries,) whether any item is right."""
    slow: Bools
    """(queries,) whether each came long after the one before it."""


class Camera(NamedTuple):
    """What the map is of, and how it is localised on."""

    town: int
    sensor: str
    way: str


@dataclass(frozen=True)
class Drive:
    """One drive on one map, whole or cut."""

    camera: Camera
    query: str
    whole: bool
    answers: Answers
    broken: bool = False
    """Whether it begins anew every so often."""

    @property
    def counts(self) -> Bools:
        """(queries,) what trees and rates are made of: on cut maps, broken drives of a quick camera, and
        those of a slow one that go on, which has too few images to begin often.
        """
        return np.asarray(np.where(self.answers.slow, not self.broken, self.whole or self.broken), np.bool_)


@dataclass(frozen=True)
class Own:
    """What one map tells of itself."""

    camera: Camera
    features: dict[str, Floats]
    """"live" or "late" -> (unknown, features) of images whose places are cut out."""


def fitted(drives: list[Drive], kind: str) -> Judges:
    """What judges answers of a kind, and what it says of images of places that maps lack.

    The latter by what is fitted without their town, where there are others: it would say too little of its
    own.
    """
    towns = list(dict.fromkeys(drive.camera.town for drive in drives))
    unknown: list[tuple[Floats, Bools]] = []
    for town in towns:
        judges = _judges([one for one in drives if one.camera.town != town] or drives, kind)
        unknown += [_unknown(one, kind, judges) for one in drives if one.camera.town == town]
    found, slow = (np.concatenate(column) for column in zip(*unknown, strict=True))
    usual = [_log_odds(np.quantile(found[slow == flag], 1 - ASKED)) for flag in (False, True)]
    return _judges(drives, kind)._replace(usual=np.array(usual))


def _judges(drives: list[Drive], kind: str) -> Judges:
    """Trees, by the answers of quick cameras; a regression, by all of events, of drives that go on."""
    quick = [drive.counts & ~drive.answers.slow for drive in drives]
    right, features = (
        np.concatenate([of(drive.answers)[chosen] for drive, chosen in zip(drives, quick, strict=True)])
        for of in (_right_of(kind), _features_of(kind))
    )
    going_on = [one for one in drives if one.camera.sensor != COLOUR and not one.broken]
    return Judges(boosted(features, right), _linear(going_on, kind), np.zeros((2, len(ASKED))))


def _log_odds(probability: Floats) -> Floats:
    held = np.clip(probability, 1e-9, 1 - 1e-9)
    return np.asarray(np.log(held / (1 - held)), np.float64)


def _right_of(kind: str) -> Callable[[Answers], Floats]:
    return lambda answers: answers.right[kind].astype(np.float64)


def _features_of(kind: str) -> Callable[[Answers], Floats]:
    return lambda answers: answers.features[kind]


def _linear(drives: list[Drive], kind: str) -> Floats:
    """The weights of 1 and of the features; 0 of how much was seen, which is no matter of more or less.

    Of late answers those of both sides are fitted by themselves; then the log-odds of live ones are added by
    LIVE_COUNTS, and the sum scaled anew.
    """
    right, features = (
        np.concatenate([of(drive.answers) for drive in drives])
        for of in (_right_of(kind), _features_of(kind))
    )
    if kind == "live":
        return _without(HOW_MUCH_LIVE, features, right)
    sides = len(features[0]) - len(drives[0].answers.features["live"][0])
    own, live = _without(HOW_MUCH_LATE, features[:, :sides], right), _linear(drives, "live")
    weights = np.concatenate([[own[0] + LIVE_COUNTS * live[0]], own[1:], LIVE_COUNTS * live[1:]])
    shift, scale = _regression((weights[0] + features @ weights[1:])[:, None], right)
    return np.asarray(scale * weights + shift * np.eye(len(weights))[0], np.float64)


def _without(last: int, features: Floats, right: Floats) -> Floats:
    """A regression on all but the last few features, whose weights are 0."""
    return np.concatenate([_regression(features[:, :-last], right), np.zeros(last)])


def _regression(features: Floats, right: Floats) -> Floats:
    """The weights of 1 and of the features: a logistic regression with a ridge, by Newton's method."""
    middle, scale = features.mean(axis=0), features.std(axis=0) + 1e-9
    table = np.column_stack([np.ones(len(features)), (features - middle) / scale])
    weights = np.zeros(table.shape[1])
    for _ in range(30):
        said = 1 / (1 + np.exp(-table @ weights))
        slope = table.T @ (right - said) / len(right) - RIDGE * weights
        bend = (table * (said * (1 - said))[:, None]).T @ table / len(right) + RIDGE * np.eye(len(weights))
        weights += np.linalg.solve(bend, slope)
    own = weights[1:] / scale
    return np.concatenate([[weights[0] - middle @ own], own])


def judged(drives: list[Drive], own: list[Own], town: int) -> Iterator[dict[str, Any]]:
    """The drives of one town, by weights and thresholds fitted without it."""
    rest = [one for one in drives if one.camera.town != town]
    judges = {kind: fitted(rest, kind) for kind in KINDS}
    for mine in (one for one in own if one.camera.town == town):
        thresholds = {kind: _thresholds(mine, kind, judges[kind]) for kind in KINDS}
        queries = [one for one in drives if one.camera == mine.camera]
        for query in dict.fromkeys(one.query for one in queries):
            group = [one for one in queries if one.query == query]
            row: dict[str, Any] = {**mine.camera._asdict(), "query": query}
            for kind in KINDS:
                row[kind] = {
                    by: _at(group, kind, judges[kind], limits) for by, limits in thresholds[kind].items()
                }
            yield row


def _thresholds(mine: Own, kind: str, judges: Judges) -> dict[str, Floats]:
    """Where they come from -> (2,) for as many false accepts as are asked, of quick and of slow cameras."""
    features = mine.features[kind]
    own = [said(judges, features, np.full(len(features), slow)) for slow in (False, True)]
    at = int(np.flatnonzero(ASKED == ASKED_FOR)[0])
    return {
        USED: np.array([limit(one, judges, bool(slow), ASKED_FOR) for slow, one in enumerate(own)]),
        "the map": np.array([np.quantile(one, 1 - ASKED_FOR) for one in own]),
        "other towns": 1 / (1 + np.exp(-judges.usual[:, at])),
    }


def _at(group: list[Drive], kind: str, judges: Judges, limits: Floats) -> dict[str, float | None]:
    """One query's accuracy on the whole map, and its false accepts on all maps, in %."""
    (whole,) = (one.answers for one in group if one.whole)
    accepted = said(judges, whole.features[kind], whole.slow) > limits[whole.slow.astype(int)]
    good = np.where(whole.known, whole.right[kind] & accepted, ~accepted)
    unknown = [_unknown(one, kind, judges) for one in group]
    wrong = np.concatenate([found > limits[slow.astype(int)] for found, slow in unknown])
    return {
        "accuracy": 100 * float(good.mean()),
        "false_accepts": 100 * float(wrong.mean()) if len(wrong) else None,
    }


def _unknown(drive: Drive, kind: str, judges: Judges) -> tuple[Floats, Bools]:
    """The probabilities of the images of places that a drive's map lacks, and which are of a slow camera."""
    answers, there = drive.answers, ~drive.answers.known & drive.counts
    return said(judges, answers.features[kind][there], answers.slow[there]), answers.slow[there]
