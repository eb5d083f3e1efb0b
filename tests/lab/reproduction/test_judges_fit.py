"""What judges answers: its fit, its limits, and how it is judged itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from evplace.core.storage import write_json
from evplace.matchers import _known
from evplace.matchers._known import Judges, said
from evplace_lab.reproduction import _judging as judging
from evplace_lab.reproduction import known

SHARE_SLOW = 0.4
"""Of the answers of a made drive, those of a slow camera."""


def camera(town: int, sensor: str = "ideal") -> judging.Camera:
    return judging.Camera(town, sensor, "ten images a second")


def made_features(rng: np.random.Generator, many: int) -> NDArray[np.float64]:
    """Two that tell something, and how much was seen."""
    return np.column_stack([rng.standard_normal((many, 2)) * [1.0, 3.0] + [0.5, -2.0], np.full(many, 20.0)])


def late_of(live: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same two of both sides, how much was seen on each, and what live answers say."""
    return np.column_stack([live[:, :2], live[:, 2:], live[:, 2:], live])


def drive(town: int, seed: int, weights: list[float], sensor: str = "ideal") -> judging.Drive:
    """Answers that are right with the probability that these weights say."""
    rng = np.random.default_rng(seed)
    features = made_features(rng, 20_000)
    right = rng.random(len(features)) < 1 / (1 + np.exp(-(weights[0] + features[:, :2] @ weights[1:])))
    there, slow = rng.random(len(right)) < 0.7, rng.random(len(right)) < SHARE_SLOW
    of_both = {"live": features, "late": late_of(features)}
    answers = judging.Answers(of_both, {"live": right, "late": right}, there, slow)
    return judging.Drive(camera(town, sensor), "night-1", whole=True, answers=answers)


def test_the_weights_are_found_that_the_answers_follow() -> None:
    """By the regression they are read off; the trees say much the same."""
    wanted = [-0.4, 1.5, -0.5]
    found = judging.fitted([drive(1, 0, wanted)], "live")
    np.testing.assert_allclose(found.slow, [*wanted, 0.0], atol=0.08)
    features = made_features(np.random.default_rng(5), 2000)
    apart = said(found, features, slow=False) - said(found, features, slow=True)
    assert np.abs(apart).mean() < 0.03


def test_trees_are_of_quick_cameras_and_the_regression_of_events_alone() -> None:
    """Slow answers, and those on colour, that say the opposite change not the one and not the other."""
    wanted, opposite = [0.0, 2.0, 0.0], [0.0, -2.0, 0.0]
    one, other = drive(1, 0, wanted), drive(1, 1, opposite)
    slow = other.answers._replace(slow=np.ones(20_000, np.bool_))
    colour = other.answers._replace(slow=np.zeros(20_000, np.bool_))
    high = np.array([[2.0, -2.0, 20.0]])

    def says(answers: judging.Answers, sensor: str, slow: bool) -> float:
        drives = [one, judging.Drive(camera(1, sensor), "night-1", True, answers)]
        return float(said(judging.fitted(drives, "live"), high, slow)[0])

    assert says(slow, "ideal", slow=False) > 0.9
    assert says(colour, "ideal", slow=False) < 0.8
    assert says(colour, judging.COLOUR, slow=True) > 0.9
    assert says(slow, "ideal", slow=True) < 0.8


def test_a_town_is_judged_by_the_weights_of_the_others() -> None:
    drives = [drive(1, 0, [0.0, 2.0, 0.0]), drive(2, 1, [0.0, -2.0, 0.0])]
    features = made_features(np.random.default_rng(2), 5000)
    own = judging.Own(camera(1), {"live": features, "late": late_of(features)})
    (row,) = judging.judged(drives, [own], 1)
    assert [row[name] for name in ("town", "sensor", "way", "query")] == [*camera(1), "night-1"]
    judges = judging.fitted(drives[1:], "live")
    assert judges.slow[1] < 0  # the other town's weights point the other way
    one = drives[0].answers
    limits = [np.quantile(said(judges, features, slow), 0.99) for slow in (False, True)]
    accepted = said(judges, one.features["live"], one.slow) > np.where(one.slow, limits[1], limits[0])
    good = np.where(one.known, one.right["live"] & accepted, ~accepted)
    assert row["live"]["the map"]["accuracy"] == pytest.approx(100 * good.mean())
    assert row["live"]["the map"]["false_accepts"] == pytest.approx(100 * accepted[~one.known].mean())
    assert row["live"]["the map"]["false_accepts"] == pytest.approx(1, abs=0.5)


def test_a_threshold_is_the_maps_own_or_that_of_other_towns_or_halfway() -> None:
    """One for quick cameras and one for slow ones; other towns are judged by each other."""
    others = [drive(2, 1, [0.0, 2.0, 0.0]), drive(3, 2, [0.0, 2.0, 0.0])]
    certain = np.full((200, 3), 3.0)
    sure = judging.Own(camera(1), {"live": certain, "late": late_of(certain)})
    judges = judging.fitted(others, "late")
    limits = judging._thresholds(sure, "late", judges)
    wanted = [said(judges, late_of(certain)[:1], slow)[0] for slow in (False, True)]
    assert limits["the map"] == pytest.approx(np.array(wanted))
    held_out = judging._judges(others[1:], "late"), judging._judges(others[:1], "late")
    for slow in (False, True):
        unknown = [
            one.answers.features["late"][~one.answers.known & (one.answers.slow == slow)] for one in others
        ]
        each = [said(by, features, slow) for by, features in zip(held_out, unknown, strict=True)]
        assert limits["other towns"][int(slow)] == pytest.approx(np.quantile(np.concatenate(each), 0.99))
    odds = {name: np.log(found / (1 - found)) for name, found in limits.items()}
    assert odds[judging.USED] == pytest.approx((odds["the map"] + odds["other towns"]) / 2)


def test_weights_that_are_written_are_those_that_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the digits that are kept."""
    fitted = {kind: judging.fitted([drive(1, 0, [0.1, 1.0, 0.3])], kind) for kind in judging.KINDS}
    write_json(tmp_path / "weights.json", {kind: known._plain(judges) for kind, judges in fitted.items()})
    monkeypatch.setattr(_known, "WEIGHTS", tmp_path / "weights.json")
    features = made_features(np.random.default_rng(3), 500)
    for judges, kind in zip(_known.judges.__wrapped__(), judging.KINDS, strict=True):
        assert isinstance(judges, Judges)
        made = features if kind == "live" else late_of(features)
        for slow in (False, True):
            kept, whole = (said(one, made, slow) for one in (judges, fitted[kind]))
            np.testing.assert_allclose(kept, whole, atol=1e-4)


def test_on_a_cut_map_quick_cameras_begin_often_and_slow_ones_go_on() -> None:
    """Whatever it is made of, each image of a place counts once."""
    answers = drive(1, 0, [0.0, 1.0, 0.0]).answers
    whole, going_on, broken = (
        judging.Drive(camera(1), "night-1", is_whole, answers, is_broken)
        for is_whole, is_broken in ((True, False), (False, False), (False, True))
    )
    assert whole.counts.all()
    np.testing.assert_array_equal(going_on.counts, answers.slow)
    np.testing.assert_array_equal(broken.counts, ~answers.slow)
    _, slow = judging._unknown(broken, "live", judging._judges([whole], "live"))
    assert len(slow) == (~answers.known & ~answers.slow).sum()
    assert not slow.any()
