"""The filter along a route: against plain matrices; rates, lags, states; maps that cannot be measured."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from evplace.core.errors import PlaceMapError, SettingsError
from evplace.matchers import Answer, Continuing, Learned, Route, Seen, _calibration, _known
from evplace.matchers import _belief as belief
from evplace.matchers import _route_filter as loops
from evplace.matchers import _surroundings as around
from evplace.matchers import _traces as traces
from evplace.matchers._calibration import LATE, LIVE, SLOW, UNKNOWN, strangers
from evplace.matchers._known import (
    ASKED,
    LATE_SIGNS,
    LONGER,
    SIGNS,
    SPANS,
    Judges,
    Means,
    Trees,
    joined,
    of_live,
)
from evplace.matchers._ways import Ways
from evplace.matchers.bayes import Bayes
from evplace.testing import check_matcher

Floats = NDArray[np.float64]


def road(items: int = 300, spacing: float = 2.0, rate: float = 5.0) -> Route:
    """A straight road driven at `rate` items a second."""
    position = np.stack([500_000 + spacing * np.arange(items), np.full(items, 4e6)], axis=1)
    t_us = (np.arange(items) / rate * 1e6).astype(np.int64)
    return Route(position, np.full(items, 90.0), t_us, content=50.0)


def rows_along(route: Route, at: Floats, seed: int = 0, height: float = 8.0) -> NDArray[np.float32]:
    """Scores of a drive that is `at` these items: noise, and a peak there; none where `at` is NaN."""
    items = len(route.position)
    rows = np.random.default_rng(seed).standard_normal((len(at), items))
    near = np.exp(-0.5 * ((np.arange(items) - np.nan_to_num(at, nan=-1e9)[:, None]) / 2.0) ** 2)
    return (rows + height * near).astype(np.float32)


def own_rows(route: Route, height: float = 8.0) -> NDArray[np.float32]:
    return rows_along(route, np.arange(len(route.position), dtype=float), seed=9, height=height)


def calibrated(route: Route) -> Route:
    own = own_rows(route)
    return route._replace(learned=Bayes().learn(route, lambda part: own[part]))


def drive(matcher: Bayes, route: Route, rows: NDArray[np.float32], seen: list[Seen]) -> list[Answer]:
    following = matcher.follow(route)
    said = [answer for row, one in zip(rows, seen, strict=True) for answer in following.step(row, one)]
    return said + following.finish()


def at_rate(n: int, rate: float, content: float = 50.0) -> list[Seen]:
    return [Seen(round(k / rate * 1e6), content) for k in range(n)]


def test_it_keeps_what_matchers_promise() -> None:
    check_matcher(Bayes())
    check_matcher(Bayes(threshold=0.5))


def plain_transition(ways: Ways, seconds: float) -> Floats:
    """(states, states) column: what becomes of each (reference, speed), one after another."""
    n, v = len(ways.way), len(belief.SPEEDS)
    change = np.zeros((n * v, n * v))
    ticks = min(seconds / belief.TICK_S, 1)
    for r in range(n):
        for s in range(v):
            for to, share in (
                (s, 1 - belief.CHANGE * ticks),
                (max(s - 1, 0), belief.CHANGE * ticks / 2),
                (min(s + 1, v - 1), belief.CHANGE * ticks / 2),
            ):
                goal = ways.way[r] + belief.SPEEDS[to] * ways.pace * seconds
                at = int(np.searchsorted(ways.way, goal, "right")) - 1
                targets = [(at, 1.0)]
                if at == n - 1:
                    targets = [(at, 1.0)] if goal <= ways.way[at] else []
                elif goal > ways.way[at]:
                    between = (goal - ways.way[at]) / (ways.way[at + 1] - ways.way[at])
                    targets = [(at, 1 - between), (at + 1, between)]
                for target, part in targets:
                    linked = ways.links.to[ways.links.first[target] : ways.links.first[target + 1]]
                    passed = belief.LINK * ticks if len(linked) else 0.0
                    change[target * v + to, r * v + s] += share * part * (1 - passed)
                    for other in linked:
                        change[other * v + to, r * v + s] += share * part * passed / len(linked)
    change *= 1 - belief.JUMP * ticks
    return change + (1 - change.sum(axis=0)) / len(change)


def loop_route() -> Route:
    """A round of 80 m, driven one and a half times."""
    angle = np.arange(30) / 20 * 2 * np.pi
    position = 80 / (2 * np.pi) * np.stack([np.sin(angle), np.cos(angle)], axis=1)
    return Route(position, (90 + np.rad2deg(angle)) % 360, np.arange(30) * 400_000)


@pytest.mark.parametrize("seconds", [0.08, 0.1, 0.7])
def test_a_move_is_that_of_a_plain_matrix(seconds: float) -> None:
    ways = Ways.of(loop_route())
    assert len(ways.links.to)
    rng = np.random.default_rng(0)
    before = rng.random((30, len(belief.SPEEDS)))
    before /= before.sum()
    found = belief.moved(before.copy(), ways, seconds, np.empty_like(before))
    matrix = plain_transition(ways, seconds)
    np.testing.assert_allclose(found.reshape(-1), matrix @ before.reshape(-1), atol=1e-12)


def test_hindsight_is_forward_and_backward_by_plain_matrices() -> None:
    """Over more moments than are kept at once."""
    route = loop_route()
    ways = Ways.of(route)
    n, v = len(ways.way), len(belief.SPEEDS)
    queries = traces.BLOCK + 20
    rows = np.random.default_rng(1).standard_normal((queries, n)).astype(np.float32)
    seen = at_rate(queries, 10)
    filter_ = belief.Filter(ways)
    says = [np.repeat(np.exp(evidence(filter_, row)), v) for row in rows]
    matrix = plain_transition(ways, 0.1)
    forward, beliefs = np.full(n * v, 1 / (n * v)), []
    for query in range(queries):
        forward = (matrix @ forward if query else forward) * says[query]
        forward /= forward.sum()
        beliefs.append(forward)
    backward, items = np.ones(n * v), []
    reader = traces.Reader(ways)
    for query in range(queries - 1, -1, -1):
        both = (beliefs[query] * backward).reshape(n, v).sum(axis=1)
        items.append(reader.find(both / both.sum(), traces.robust_z(rows[query])).item)
        backward = matrix.T @ (backward * says[query])
        backward /= backward.max()
    assert traces.late(ways, rows, seen, {}).item.tolist() == items[::-1]


def evidence(filter_: belief.Filter, row: NDArray[np.float32]) -> Floats:
    said = np.zeros(len(row))
    loops.weigh(np.ones((len(row), 8)), said, traces.robust_z(row), filter_.says, np.ones(360))
    return said


def test_a_transposed_move_undoes_no_product() -> None:
    """<later, move(belief)> = <move_back(later), belief>, and so for the links."""
    ways = Ways.of(loop_route())
    rng = np.random.default_rng(0)
    one, later = rng.random((2, 30, len(belief.SPEEDS)))
    steps = belief.SPEEDS * 0.9
    there, back = np.empty_like(one), np.empty_like(one)
    loops.move(one, ways.way, steps, there, np.empty(len(steps), np.uint64))
    loops.move_back(later, ways.way, steps, 0.0, back)
    np.testing.assert_allclose((later * there).sum(), (back * one).sum())
    loops.pass_links(one, *ways.links, 0.3, there)
    loops.pass_links_back(later, *ways.links, 0.3, back)
    np.testing.assert_allclose((later * there).sum(), (back * one).sum())
    np.testing.assert_allclose(there.sum(), one.sum())


def test_a_drive_is_found_and_a_stranger_is_unseen() -> None:
    route = calibrated(road())
    on = np.concatenate([np.arange(20, 120, 0.5), np.full(150, np.nan), np.arange(150, 250, 0.5)])
    answers = drive(Bayes(), route, rows_along(route, on), at_rate(len(on), 10))
    item = np.array([answer.item for answer in answers])
    accepted = np.array([answer.accepted for answer in answers])
    known = ~np.isnan(on)
    assert [answer.query for answer in answers] == list(range(len(on)))
    assert np.abs(item[known][20:200] - on[known][20:200]).max() <= 3
    assert accepted[known].mean() > 0.9
    assert accepted[~known][10:].mean() < 0.05
    states = {answer.estimate.state for answer in answers if answer.estimate is not None}
    assert {"localised", "unseen"} <= states <= {"localised", "unseen", "lost", "ambiguous"}
    found = answers[100].estimate
    assert found is not None
    assert 0 <= found.uncertainty_m < 10
    assert 0.5 < found.probability <= 1
    assert answers[100].item not in found.others


@pytest.mark.parametrize("rate", [20, 30, 60])
def test_images_of_any_rate_give_the_same_answers(rate: int) -> None:
    route = calibrated(road())
    on = np.concatenate([np.full(40, np.nan), np.arange(30, 200, 0.5)])
    at_ten = drive(Bayes(), route, rows_along(route, on), at_rate(len(on), 10))
    many = rate // 10
    fine = np.repeat(rows_along(route, on), many, axis=0)
    faster = drive(Bayes(), route, fine, at_rate(len(fine), rate))[many - 1 :: many]
    apart = [abs(one.item - other.item) for one, other in zip(at_ten, faster, strict=True)]
    assert np.quantile(apart[60:], 0.99) <= 3
    accepted = np.array([[one.accepted, other.accepted] for one, other in zip(at_ten, faster, strict=True)])
    assert (accepted[:, 0] == accepted[:, 1]).mean() > 0.97


def test_images_further_apart_tell_more_each() -> None:
    """One a second must do with a tenth of the images, each of which is new."""
    told = {}
    for apart_s in (0.05, 0.1, 0.2, 0.6, 1.0, 30.0):
        clock = belief.Clock()
        told[apart_s] = [clock.see(Seen(round(at * apart_s * 1e6), 1.0))[0] for at in range(3)][-1]
    wanted = {0.05: 0.5, 0.1: 1.0, 0.2: 1.0, 0.6: 1.25, 1.0: 1.5, 30.0: 1.5}
    assert told == pytest.approx(wanted)


def test_where_images_are_a_second_apart_a_drive_is_found_in_a_few() -> None:
    """What is read of an answer is averaged over images, of which each counts for one."""
    route = calibrated(road())
    on = np.arange(20, 180, 5.0)
    answers = drive(Bayes(), route, rows_along(route, on), at_rate(len(on), 1))
    sure = [one.accepted for one in answers]
    assert sure.index(True) < 8
    assert all(abs(one.item - at) <= 3 for one, at in zip(answers, on, strict=True) if one.accepted)
    signs, weights = np.random.default_rng(0).normal(size=(20, SIGNS)), np.full(20, 2.0)
    running, once = Means(), of_live(signs, np.ones(20))
    assert np.allclose([running.add(one, 2.0) for one in signs], once)
    assert np.allclose(of_live(signs, weights), once)


def test_a_camera_that_stands_says_nothing_new() -> None:
    route = calibrated(road())
    on = np.arange(50, 150, 0.5)
    rows = rows_along(route, on)
    standing = rows_along(route, np.full(300, np.nan), seed=5)
    seen = at_rate(len(on) + 300, 10)
    seen = [one._replace(content=2.0) if 100 <= at < 400 else one for at, one in enumerate(seen)]
    answers = drive(Bayes(), route, np.concatenate([rows[:100], standing, rows[100:]]), seen)
    assert {answer.item for answer in answers[100:400]} == {answers[99].item}
    states = [answer.estimate.state for answer in answers[100:400] if answer.estimate is not None]
    assert set(states) == {"standing"}
    assert abs(answers[-1].item - on[-1]) <= 3


def test_a_drive_that_begins_with_a_stop_is_not_sure_of_anything() -> None:
    route = calibrated(road())
    rows = np.repeat(rows_along(route, np.array([np.nan])), 80, axis=0)
    answers = drive(Bayes(), route, rows, at_rate(80, 10, content=2.0))
    assert not any(answer.accepted for answer in answers)


@pytest.mark.parametrize("lag_s", [1.0, 2.0])
def test_with_a_lag_answers_are_late_and_better(lag_s: float) -> None:
    route = calibrated(road())
    on = np.concatenate([np.full(60, np.nan), np.arange(40, 240, 0.5)])
    rows, seen = rows_along(route, on, height=4.0), at_rate(len(on), 10)
    following = Bayes(lag_s=lag_s).follow(route)
    said = [(at, answer) for at, row in enumerate(rows) for answer in following.step(row, seen[at])]
    assert all(at - answer.query == round(10 * lag_s) for at, answer in said)
    answers = [answer for _, answer in said] + following.finish()
    assert [answer.query for answer in answers] == list(range(len(on)))
    live = drive(Bayes(), route, rows, seen)
    wrong = [
        np.mean([abs(one.item - where) > 5 for one, where in zip(some[60:], on[60:], strict=True)])
        for some in (answers, live)
    ]
    assert wrong[0] <= wrong[1]


def test_at_the_end_of_a_drive_the_lag_is_hindsight() -> None:
    """The last answers come all at once, and each from all that was seen."""
    route = calibrated(road())
    on = np.arange(40, 60, 0.5)
    rows, seen = rows_along(route, on), at_rate(len(on), 10)
    late = drive(Bayes(lag_s=60), route, rows, seen)
    path = Bayes().in_hindsight(route, rows, seen)
    assert [answer.item for answer in late] == path.item.tolist()
    np.testing.assert_allclose([answer.score for answer in late], path.score, atol=1e-5)


def test_where_a_map_passes_twice_both_passes_are_one_place() -> None:
    route = loop_route()
    assert Ways.of(route).links.first[-1] > 0
    rows = rows_along(route, np.tile(np.arange(20.0), 3), height=9.0)
    answers = drive(Bayes(threshold=0.0), route, rows, at_rate(60, 2.5))
    item = np.array([answer.item for answer in answers])
    away = np.hypot(*(route.position[item] - route.position[np.tile(np.arange(20), 3)]).T)
    assert np.mean(away[5:] < 10) > 0.9


def test_memory_stays_flat() -> None:
    route = road(40)
    following = Bayes(lag_s=1.0).follow(route)
    rows = rows_along(route, np.arange(0, 40, 0.02))
    for at, row in enumerate(rows):
        following.step(row, Seen(at * 100_000, 50.0))
    kept = vars(following)
    assert len(kept["_waiting"]) <= 11
    assert len(kept["_moments"]) <= 12


def small(items: int) -> Route:
    return road(items, spacing=1.0)


@pytest.mark.parametrize("items", [1, 2, 50])
def test_a_map_too_small_to_be_measured_gives_no_probability(items: int) -> None:
    route = small(items)
    own = np.ones((items, items), np.float32)
    assert Bayes().learn(route, lambda part: own[part]) == {}
    rows = np.random.default_rng(0).random((12, items)).astype(np.float32)
    for matcher in (Bayes(), Bayes(lag_s=1)):
        answers = drive(matcher, route, rows, at_rate(12, 10))
        assert all(answer.accepted for answer in answers)
        assert all(
            answer.estimate is not None and np.isnan(answer.estimate.probability) for answer in answers
        )
    assert Bayes().in_hindsight(route, rows, at_rate(12, 10)).accepted.all()


def test_a_map_whose_images_are_all_alike_is_never_sure() -> None:
    route = road()
    alike = np.ones((300, 300), np.float32)
    learned = Bayes().learn(route, lambda part: alike[part])
    answers = drive(Bayes(), route._replace(learned=learned), alike[:30], at_rate(30, 10))
    assert not any(answer.accepted for answer in answers)
    said = [answer.estimate.probability for answer in answers if answer.estimate is not None]
    assert max(said) < 0.5


def test_a_query_shorter_than_the_history() -> None:
    route = calibrated(road())
    assert len(drive(Bayes(lag_s=5), route, rows_along(route, np.array([30.0])), at_rate(1, 10))) == 1
    assert drive(Bayes(lag_s=5), route, rows_along(route, np.empty(0)), []) == []
    assert Bayes().in_hindsight(route, rows_along(route, np.array([30.0])), at_rate(1, 10)).item.shape == (1,)


def test_more_false_accepts_are_allowed_more_answers_are_accepted() -> None:
    route = calibrated(road())
    on = np.concatenate([np.full(100, np.nan), np.arange(30, 130, 0.5)])
    rows, seen = rows_along(route, on, height=4.5), at_rate(len(on), 10)
    accepted = [
        sum(answer.accepted for answer in drive(Bayes(false_accept=share), route, rows, seen))
        for share in (0.001, 0.01, 0.1, 0.5)
    ]
    assert accepted == sorted(accepted)


def test_with_what_comes_later_the_worse_side_counts_whichever_it_is() -> None:
    rng = np.random.default_rng(0)
    seen, to_come = np.array([7.0]), np.array([3.0])
    before, ahead = rng.normal(size=LATE_SIGNS * len(SPANS)), rng.normal(size=len(LONGER))
    features = joined(np.append(before, seen), np.append(ahead, to_come))
    past, alone = before[LONGER], np.arange(LATE_SIGNS) * len(SPANS)
    np.testing.assert_array_equal(features[LONGER], np.minimum(past, ahead))
    np.testing.assert_array_equal(features[len(before) : -2], np.maximum(past, ahead))
    np.testing.assert_array_equal(features[alone], before[alone])
    np.testing.assert_array_equal(features[-2:], [7.0, 3.0])
    other = before.copy()
    other[LONGER] = ahead
    np.testing.assert_array_equal(joined(np.append(other, seen), np.append(past, to_come)), features)
    nothing = joined(np.append(before, seen), np.full(len(LONGER) + 1, np.nan))
    np.testing.assert_array_equal(nothing[len(before) :], [*past, 7.0, 0.0])


def test_what_was_learned_must_be_what_is_learned() -> None:
    route = calibrated(road())
    learned = dict(route.learned or {})
    for name, wrong in (
        ("wrong", learned["wrong"][:-1]),
        ("wrong", np.full(360, np.nan)),
        (LIVE, np.linspace(0.9, 0.1, 9)),
        (LATE, learned[LATE] + 2),
        (LATE + SLOW, np.linspace(0.9, 0.1, 9)),
        (LIVE, np.empty(0)),
        ("content", np.array([1.0, 2.0])),
        ("content", np.array([-1.0])),
    ):
        with pytest.raises(PlaceMapError, match="calibrate"):
            Bayes().follow(route._replace(learned=learned | {name: wrong}))


def constant(quick: float, slow: float, features: int) -> Judges:
    """Whatever an answer looks like, it is right with one probability or the other."""
    start, intercept = np.log(quick / (1 - quick)), np.log(slow / (1 - slow))
    nothing = np.zeros((1, 1), np.int64), np.zeros((1, 1)), np.zeros((1, 2))
    usual = np.zeros((2, len(ASKED)))  # half, so that a limit is between that and the map's own
    return Judges(Trees(float(start), *nothing), intercept * np.eye(1 + features)[0], usual)


MANY = (SIGNS * len(SPANS) + 1, LATE_SIGNS * len(SPANS) + len(LONGER) + 2 + SIGNS * len(SPANS) + 1)
"""Features of a live answer, and of a late one."""
SAID = {"live": (0.4, 0.6), "late": (0.3, 0.7)}
"""Of quick images and of slow ones."""
WAYS = ["live", "lag", "hindsight"]


@pytest.fixture
def constants(monkeypatch: pytest.MonkeyPatch) -> None:
    both = tuple(constant(*said, many) for said, many in zip(SAID.values(), MANY, strict=True))
    for module in (_known, _calibration):
        monkeypatch.setattr(module, "judges", lambda: both)


def measured_as(**values: float) -> Learned:
    """What a map may have learned, with all that it says of places it lacks alike."""
    unknown = {name: np.full(9, values.get(name, 0.5)) for name in UNKNOWN}
    return {belief.WRONG: around.USUAL, belief.CONTENT: np.array([50.0]), **unknown}


@pytest.fixture
def cut_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """A map is measured quickly."""
    monkeypatch.setattr(_calibration, "TRIALS", (2, 2))


def judged(way: str, route: Route, rows: NDArray[np.float32], seen: list[Seen]) -> tuple[Floats, list[bool]]:
    """The probabilities and what is accepted, live, with a lag or in hindsight."""
    if way == "hindsight":
        path = Bayes().in_hindsight(route, rows, seen)
        return path.score, path.accepted.tolist()
    answers = drive(Bayes(lag_s=0.0 if way == "live" else 1.0), route, rows, seen)
    return np.array([answer.score for answer in answers]), [answer.accepted for answer in answers]


TIMES_S = np.array([0.0, 0.1, 0.2, 0.7, 0.8, 1.3, 3.0, 3.4])
IS_SLOW = np.array([False, False, False, True, False, True, True, False])
"""Half a second and more after the one before it."""


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("quick", "slow"), [(0.2, 0.9), (0.9, 0.2), (0.35, 0.65), (0.2, 0.2)])
def test_images_of_a_slow_camera_have_their_own_judge_and_threshold(
    way: str, quick: float, slow: float, constants: None
) -> None:
    route, kind = road(60), LIVE if way == "live" else LATE
    learned = measured_as(**{kind: quick, kind + SLOW: slow})
    seen = [Seen(round(time * 1e6), 50.0) for time in TIMES_S]
    rows = rows_along(route, 5 + 5 * TIMES_S)
    right, accepted = judged(way, route._replace(learned=learned), rows, seen)
    wanted = np.where(IS_SLOW, *SAID["live" if way == "live" else "late"][::-1])
    np.testing.assert_allclose(right, wanted)
    quick, slow = (1 / (1 + np.sqrt(1 / own - 1)) for own in (quick, slow))  # halfway to one half
    assert accepted == (wanted > np.where(IS_SLOW, slow, quick)).tolist()


@pytest.mark.parametrize("way", WAYS)
def test_a_threshold_that_is_set_is_that_of_all(way: str, constants: None) -> None:
    seen = [Seen(round(time * 1e6), 50.0) for time in TIMES_S]
    route = road(60)._replace(learned=measured_as())
    rows = rows_along(route, 5 + 5 * TIMES_S)
    settings = Bayes(threshold=0.5, lag_s=1.0 if way == "lag" else 0.0)
    if way == "hindsight":
        accepted = settings.in_hindsight(route, rows, seen).accepted.tolist()
    else:
        accepted = [answer.accepted for answer in drive(settings, route, rows, seen)]
    assert accepted == IS_SLOW.tolist()


def test_a_map_is_measured_for_quick_and_for_slow_cameras(constants: None, cut_twice: None) -> None:
    learned = calibrated(road()).learned
    assert learned is not None
    for name, said in ((LIVE, SAID["live"]), (LATE, SAID["late"])):
        for kind, wanted in zip((name, name + SLOW), said, strict=True):
            np.testing.assert_allclose(learned[kind], wanted)
            assert len(learned[kind]) == len(learned[LIVE])
    assert set(UNKNOWN) < set(learned)


def test_what_is_measured_of_more_comes_to_each_of_four(constants: None, cut_twice: None) -> None:
    route = calibrated(road())
    before, own = route.learned or {}, own_rows(route)
    more = Bayes().learn_more(before, route, lambda part: own[part])
    assert [len(more[name]) for name in UNKNOWN] == [2 * len(before[name]) for name in UNKNOWN]
    for name in UNKNOWN:
        np.testing.assert_array_equal(np.unique(more[name]), np.unique(before[name]))


@pytest.mark.parametrize("way", [*WAYS, "more"])
def test_a_map_that_an_earlier_version_measured_is_to_be_calibrated(way: str, cut_twice: None) -> None:
    route = road()
    own, learned = own_rows(route), measured_as()
    earlier = {name: values for name, values in learned.items() if not name.endswith(SLOW)}
    assert len(earlier) == len(learned) - 2
    with pytest.raises(PlaceMapError, match=r"measure it again, with evplace calibrate$") as told:
        if way == "more":
            Bayes().learn_more(earlier, route, lambda part: own[part])
        else:
            judged(way, route._replace(learned=earlier), own[:3], at_rate(3, 10))
    assert "earlier evplace" in str(told.value)
    assert "\n" not in str(told.value)


def verifying_alone(features: int) -> Judges:
    """What verifies the image above 2: right; else wrong. The same of slow cameras, less sharply."""
    trees = Trees(0.0, np.array([[VERIFIES]]), np.array([[2.0]]), np.array([[-3.0, 3.0]]))
    return Judges(trees, np.eye(1 + features)[1 + VERIFIES], np.zeros((2, len(ASKED))))


VERIFIES = 3 * len(SPANS)
"""The feature that is what verifies the image itself."""


@pytest.fixture
def by_what_verifies(monkeypatch: pytest.MonkeyPatch) -> None:
    both = tuple(verifying_alone(many) for many in MANY)
    for module in (_known, _calibration):
        monkeypatch.setattr(module, "judges", lambda: both)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("rate", [10, 1])
def test_one_descriptor_verifies_what_all_together_find(
    way: str, rate: float, by_what_verifies: None
) -> None:
    """At the item that is found; without one, the scores themselves do."""
    route = road(100)
    on = 20 + np.arange(30) * 2.5 / rate
    rows, seen = rows_along(route, on), at_rate(30, rate)
    good = np.arange(30) % 3 == 0
    there = np.abs(np.arange(100) - on[:, None]) < 3
    verifying = np.where(there & good[:, None], 4.0, np.where(there, 1.0, 9.0)).astype(np.float32)
    told = [one._replace(verifying=row) for one, row in zip(seen, verifying, strict=True)]
    right, _ = judged(way, route, rows, told)
    slow = np.arange(30) > 0 if rate == 1 else np.zeros(30, np.bool_)
    log_odds = np.where(slow, np.where(good, 4.0, 1.0), np.where(good, 3.0, -3.0))
    np.testing.assert_allclose(right[3:], (1 / (1 + np.exp(-log_odds)))[3:], rtol=1e-6)
    alone, _ = judged(way, route, rows, seen)
    assert (alone[3:] > 0.9).all()


@pytest.mark.parametrize("lag_s", [0.0, 1.0])
def test_images_that_wait_keep_what_verifies_them(lag_s: float, by_what_verifies: None) -> None:
    """On the same items in the same order, nothing changes; of others, each has its own."""
    route = road(100)
    rows, seen = rows_along(route, 20 + np.arange(30) / 2), at_rate(30, 10)
    verifying = np.random.default_rng(2).normal(0.0, 2.0, (30, 100)).astype(np.float32)
    seen = [one._replace(verifying=row) for one, row in zip(seen, verifying, strict=True)]
    wanted = drive(Bayes(lag_s=lag_s), route, rows, seen)
    following, found = Bayes(lag_s=lag_s).follow(route), list[Answer]()
    for at, (row, one) in enumerate(zip(rows, seen, strict=True)):
        if at == 15:
            assert isinstance(following, Continuing)
            following = following.continued(route, np.arange(100))
        found += following.step(row, one)
    found += following.finish()
    assert [answer.item for answer in found] == [answer.item for answer in wanted]
    np.testing.assert_allclose([one.score for one in found], [one.score for one in wanted], rtol=1e-4)
    assert len({answer.score for answer in found}) > 1


def test_what_verifies_images_that_wait_is_renumbered() -> None:
    route, rows = road(100), rows_along(road(100), np.arange(5.0))
    following = Bayes(lag_s=10).follow(route)
    seen = [one._replace(verifying=row + 1) for one, row in zip(at_rate(5, 10), rows, strict=True)]
    for row, one in zip(rows, [*seen[:4], seen[4]._replace(verifying=None)], strict=True):
        following.step(row, one)
    assert isinstance(following, Continuing)
    other = following.continued(road(3)._replace(left_out=97), np.array([7, -1, 2]))
    waiting = vars(other)["_waiting"]
    for row, one in zip(rows[:4], waiting, strict=False):
        np.testing.assert_array_equal(one.verifying, [row[7] + 1, 0, row[2] + 1])
    assert waiting[4].verifying is None


def test_a_map_is_measured_by_what_verifies_its_own_images(cut_twice: None) -> None:
    """Of each drive's, and of no image by itself."""
    route = road()
    own = own_rows(route)
    flat = np.full((300, 300), 3.0, np.float32)
    np.fill_diagonal(flat, 90.0)
    for verifying, told in ((lambda part: flat[part], 3.0), (None, None)):
        found = strangers(route._replace(verifying=verifying), lambda part: own[part])
        assert found is not None
        for features in (found.live, found.late):
            means = slice(VERIFIES, VERIFIES + len(SPANS))
            wanted = features[:, : len(SPANS)] if told is None else np.full((len(features), len(SPANS)), told)
            np.testing.assert_allclose(features[:, means], wanted, rtol=1e-6)


def test_of_several_drives_each_has_what_verifies_it(monkeypatch: pytest.MonkeyPatch) -> None:
    route = road()
    drives = [np.arange(120), np.arange(0, 200, 2)]
    rows = np.random.default_rng(0).standard_normal((220, 300)).astype(np.float32)
    told = list[tuple[int, bool]]()

    def noted(route: Route, whole: Ways, at: Any, own: Any, verifying: Any, *_: object) -> Any:
        told.append((len(at), bool((verifying == -own).all() and len(own) == len(at))))
        return np.zeros((60, MANY[0])), np.zeros((60, MANY[1]))

    monkeypatch.setattr(_calibration, "_trial", noted)
    given = route._replace(own=drives, verifying=lambda part: -rows[part])
    assert strangers(given, lambda part: rows[part].copy()) is not None
    assert set(told) == {(120, True), (100, True)}


def test_settings_that_cannot_be_are_refused() -> None:
    for wrong in ({"false_accept": 0.0}, {"false_accept": 1.0}, {"lag_s": 0.5}, {"lag_s": 61.0}):
        with pytest.raises(SettingsError, match=next(iter(wrong))):
            Bayes(**wrong)


@settings(max_examples=20)
@given(st.integers(2, 40), st.integers(0, 99))
def test_any_rows_give_items_of_the_map(items: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((15, items)).astype(np.float32) * 10.0 ** rng.integers(-6, 6)
    position = rng.uniform(0, 200, (items, 2))
    position[rng.random(items) < 0.3] = np.nan
    route = Route(position, rng.uniform(0, 360, items), np.sort(rng.integers(0, 10**8, items)))
    times = np.sort(rng.integers(0, 10**7, 15))
    seen = [Seen(int(t), float(c)) for t, c in zip(times, rng.choice([0.0, 50.0, np.nan], 15), strict=True)]
    for matcher in (Bayes(), Bayes(lag_s=1)):
        answers = drive(matcher, route, rows, seen)
        assert [answer.query for answer in answers] == list(range(15))
        assert all(0 <= answer.item < items and 0 <= answer.score <= 1 for answer in answers)
