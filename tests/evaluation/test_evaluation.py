"""Figures against closed cases and brute force; results that survive the disk."""

from __future__ import annotations

import dataclasses
import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evplace.core.errors import EvaluationError, OutputError
from evplace.evaluation import (
    OUTCOMES,
    RECALLS_AT,
    Result,
    average_precision,
    compare,
    gallery_spacing,
    hits_at,
    measure,
    precision_recall,
    sample,
    truth,
)
from evplace.evaluation._samples import choose
from evplace.matchers import Path as Answers


def answers(item: list[int], accepted: list[bool] | None = None, score: list[float] | None = None) -> Answers:
    return Answers(
        np.array(item, np.int64),
        np.array(score if score is not None else np.arange(len(item)), np.float64),
        np.array([one >= 0 for one in item] if accepted is None else accepted, np.bool_),
    )


def known(matrix: object) -> truth.Truth:
    right = np.asarray(matrix, np.bool_)
    return truth.by_matrix(right, *right.shape)


SIX = known([[1, 0], [1, 0], [0, 1], [0, 1], [0, 0], [0, 0]])


def test_every_figure_of_a_closed_case() -> None:
    figures = measure(answers([0, 1, 1, -1, 0, -1], score=[5, 4, 3, np.nan, 2, np.nan]), SIX).figures
    assert [figures[key] for key in ("tp", "fp", "fn", "tn")] == [2, 2, 1, 1]
    assert figures["accuracy"] == 3 / 6
    assert figures["accuracy_seen"] == 2 / 4
    assert figures["rejection_rate"] == 2 / 6
    assert figures["unseen_rejected"] == 1 / 2
    assert figures["precision"] == 2 / 4
    assert (figures["recall"], figures["recall_accepted"]) == (2 / 4, 2 / 3)
    assert figures["recall_at_full_precision"] == 1 / 4
    assert figures["average_precision"] == pytest.approx(1 / 4 + 2 / 3 / 4)
    assert (figures["chance"], figures["chance_seen"]) == (2 / 6, 2 / 4)


def test_nothing_accepted_has_no_precision() -> None:
    figures = measure(answers([-1] * 6), SIX).figures
    assert (figures["precision"], figures["recall"], figures["accuracy"]) == (None, 0, 2 / 6)
    assert figures["average_precision"] is None


def test_nothing_seen_has_no_recall() -> None:
    figures = measure(answers([0, -1]), known([[0], [0]])).figures
    assert (figures["recall"], figures["accuracy"], figures["average_precision"]) == (None, 0.5, None)


def test_queries_without_position_are_left_out_and_counted() -> None:
    xy = np.array([[5.0, 5.0], [np.nan, np.nan], [500.0, 5.0]])
    result = measure(answers([0, 0, -1]), truth.by_cells(xy, [[5, 5], [25, 5]]), positions=[[5, 5], [25, 5]])
    assert (result.figures["queries"], result.figures["left_out"], result.figures["judged"]) == (3, 1, 2)
    assert result.figures["accuracy"] == 1
    assert result.figures["gallery_spacing_m"] == 20


def test_spacing_passes_over_unknown_positions() -> None:
    assert gallery_spacing([[0, 0], [0, 10], [np.nan, 0], [0, 50], [0, 70]]) == 15
    assert gallery_spacing([[0, 0]]) is None


QUERIES = st.lists(
    st.tuples(st.sampled_from([0.1, 0.2, 0.5, 0.9, np.nan]), st.booleans(), st.booleans(), st.booleans()),
    max_size=30,
)


@given(QUERIES)
def test_the_curve_is_exact(queries: list[tuple[float, bool, bool, bool]]) -> None:
    score = np.array([q[0] for q in queries], np.float64)
    seen, answered = np.array([q[1] for q in queries], bool), np.array([q[2] for q in queries], bool)
    right = seen & answered & np.array([q[3] for q in queries], bool)
    curve = precision_recall(score, right, seen, answered)
    twin = []
    for threshold in sorted({s for s, a in zip(score, answered, strict=True) if a and s == s}, reverse=True):
        accepted = answered & (score >= threshold)
        tp, fn = np.sum(accepted & right), np.sum(~accepted & seen)
        recall = tp / seen.sum() if seen.any() else np.nan
        twin.append([threshold, tp / accepted.sum(), recall, tp / (tp + fn) if tp + fn else np.nan])
    np.testing.assert_array_equal(curve, np.reshape(twin, (-1, 4)))
    area = average_precision(curve)
    assert area is None or 0 <= area <= 1


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.sampled_from([1.0, 2.0, 3.0]), st.booleans()), min_size=1, max_size=6))
def test_ties_against_every_order(row: list[tuple[float, bool]]) -> None:
    score, right = np.array([one[0] for one in row]), np.array([one[1] for one in row])
    orders = [
        order
        for order in itertools.permutations(range(len(row)))
        if all(score[a] >= score[b] for a, b in itertools.pairwise(order))
    ]
    for n in (1, 2, 5):
        hit = [bool(right[list(order[:n])].any()) for order in orders]
        found = hits_at(score[None], right[None], n)[0, 0]
        assert found.tolist() == pytest.approx([float(min(hit)), np.mean(hit), float(max(hit))])


def test_recall_at_n_with_both_denominators() -> None:
    scores = np.array([[3.0, 2, 1], [1, 2, 3], [1, 1, 1]])
    right = known([[1, 0, 0], [1, 0, 0], [0, 0, 0]])
    figures = measure(answers([0, 2, 0]), right, scores).figures
    assert (figures["recall@1"], figures["recall@1_seen"], figures["recall@5"]) == (1 / 3, 1 / 2, 2 / 3)
    assert figures["recall@1_worst_ties"] == figures["recall@1_best_ties"] == 1 / 3


def test_equal_scores_are_chance_within_a_wide_bracket() -> None:
    figures = measure(answers([0] * 6), SIX, np.zeros((6, 2))).figures
    assert figures["recall@1"] == figures["chance"]
    assert (figures["recall@1_worst_ties"], figures["recall@1_best_ties"]) == (0, 4 / 6)


def test_scores_that_are_not_numbers_never_hit() -> None:
    figures = measure(answers([-1] * 6), SIX, np.full((6, 2), np.nan, np.float32)).figures
    assert [figures[f"recall@{n}"] for n in RECALLS_AT] == [0, 0, 0, 0]


def test_parts_that_do_not_fit_are_refused() -> None:
    with pytest.raises(EvaluationError, match="5 answers do not fit a truth of 6 queries"):
        measure(answers([0] * 5), SIX)
    with pytest.raises(EvaluationError, match="the truth has 2"):
        measure(answers([2] * 6), SIX)
    with pytest.raises(EvaluationError, match="scores of shape"):
        measure(answers([0] * 6), SIX, np.zeros((2, 6)))
    with pytest.raises(EvaluationError, match="none of the 2 queries"):
        measure(answers([0, 0]), truth.by_radius(np.full((2, 2), np.nan), [[0, 0]]))


def test_a_result_survives_the_disk(tmp_path: Path) -> None:
    scores = np.arange(12, dtype=np.float32).reshape(6, 2)
    given_answers = answers([0, 1, 1, -1, 0, -1], score=[0.1, 1 / 3, np.inf, np.nan, -2, 3])
    result = measure(given_answers, SIX, scores, t_us=np.arange(6) * 10, settings={"matcher": {"K": 5}})
    result.save(tmp_path / "night.result", with_scores=True)
    again = Result.load(tmp_path / "night.result")
    assert again.figures == result.figures
    assert again.settings == result.settings
    assert again.versions["evplace"]
    for name in ("t_us", "judged", "seen", "right", "curve", "scores"):
        np.testing.assert_array_equal(getattr(again, name), getattr(result, name))
    for ours, theirs in zip(again.answers, result.answers, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    with pytest.raises(OutputError, match="exists"):
        result.save(tmp_path / "night.result")
    result.save(tmp_path / "night.result", overwrite=True)
    assert Result.load(tmp_path / "night.result").scores is None


def test_compare_reads_folders_and_shows_what_differs(tmp_path: Path) -> None:
    for K in (1, 5):
        made = measure(answers([0] * 6), SIX, settings={"matcher": {"name": "local", "K": K}})
        made.save(tmp_path / f"k{K}")
    rows = compare([tmp_path / "k1", tmp_path / "k5", Result.load(tmp_path / "k5")])
    assert [row["result"] for row in rows] == ["k1", "k5", "3"]
    assert [row["matcher.K"] for row in rows] == [1, 5, 5]
    assert "matcher.name" not in rows[0]
    assert rows[0]["accuracy"] == 2 / 6
    assert compare([]) == []


def test_damaged_results_are_refused(tmp_path: Path) -> None:
    with pytest.raises(EvaluationError, match="No such file"):
        Result.load(tmp_path / "none")
    folder = tmp_path / "r"
    for name, content in [
        ("pr_curve.npy", b""),
        ("matches.csv", b"query\n1\n"),
        ("matches.csv", b"\xff\xfe"),
        ("result.json", b"{}"),
        ("result.json", b"["),
    ]:
        measure(answers([0] * 6), SIX).save(folder, overwrite=True)
        (folder / name).write_bytes(content)
        with pytest.raises(EvaluationError, match="damaged"):
            Result.load(folder)
    assert json.loads((folder / "result.json").read_text() + "]") == []


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("figures", "average_precision"), None),
        (("figures", "accuracy"), "much"),
        (("figures", "accuracy"), float("nan")),
        (("figures", "items"), 1.5),
        (("figures",), [1]),
        (("settings",), [1]),
        (("versions",), 3),
        (("took_s",), "long"),
    ],
)
def test_a_summary_of_other_things_is_damaged(tmp_path: Path, place: tuple[str, ...], value: object) -> None:
    folder = tmp_path / "r"
    measure(answers([0] * 6), SIX).save(folder)
    summary = json.loads((folder / "result.json").read_text())
    inner = summary
    for name in place[:-1]:
        inner = inner[name]
    if value is None:
        del inner[place[-1]]
    else:
        inner[place[-1]] = value
    (folder / "result.json").write_text(json.dumps(summary))
    with pytest.raises(EvaluationError, match="damaged"):
        Result.load(folder)


def with_images() -> Result:
    """SIX with positions and samples: the image of query or item n is of the grey level n."""
    xy = [[0, 1], [3, 3], [3, 6], [0, 0], [0, 0], [np.nan, 0]]
    result = measure(
        answers([0, 1, 1, -1, 0, -1]), SIX, positions=[[0, 0], [3, 5]], query_xy=xy, t_us=np.arange(6)
    )
    images = np.arange(6, dtype=np.uint8)[:, None, None].repeat(3, 1).repeat(4, 2)
    return sample(result, images, lambda items: 100 + images[items])


def test_outcomes_errors_and_the_right_item() -> None:
    result = with_images()
    assert [OUTCOMES[one] for one in result.outcome] == [
        "right", "wrong", "right", "missed", "wrong", "unseen",
    ]  # fmt: skip
    assert result.true_item is not None
    assert result.true_item.tolist() == [0, 0, 1, 1, -1, -1]
    np.testing.assert_allclose(result.error_m[:3], [1, 2, 1])
    assert np.isnan(result.error_m[3])
    assert np.isnan(measure(answers([0] * 6), SIX).error_m).all()


def test_the_nearest_right_item_is_the_true_one() -> None:
    right = known([[1, 1, 1, 0], [0, 0, 0, 1]])
    placed = measure(
        answers([0, 0]), right, positions=[[0, 0], [9, 0], [5, 0], [6, 0]], query_xy=[[6, 0], [0, 0]]
    )
    assert placed.true_item is not None
    assert placed.true_item.tolist() == [2, 3]
    unplaced = measure(answers([0, 0]), right)
    assert unplaced.true_item is not None
    assert unplaced.true_item.tolist() == [1, 3]
    with pytest.raises(EvaluationError, match=r"positions of shape \(1, 2\)"):
        measure(answers([0, 0]), right, query_xy=[[0, 0]])


def test_samples_mix_and_spread() -> None:
    outcome = np.array([0, 1, 2, 3] * 100)
    chosen = choose(outcome, 6)
    assert np.array_equal(np.minimum(outcome[chosen], 2), [0, 1, 2, 0, 1, 2])
    assert np.all(np.abs(np.diff(chosen) - 66.7) < 9)
    assert choose(np.zeros(3, np.int64)).tolist() == [0, 1, 2]
    assert choose(np.full(20, -1)).tolist() == []


def test_samples_show_query_match_and_truth() -> None:
    samples = with_images().samples
    assert samples is not None
    assert samples.query.tolist() == [0, 1, 2, 3, 4, 5]
    assert samples.images[:, :, 0, 0].tolist() == [
        [0, 100, 100], [1, 101, 100], [2, 101, 101], [3, 0, 101], [4, 100, 0], [5, 0, 0],
    ]  # fmt: skip


def test_what_a_report_needs_survives_the_disk(tmp_path: Path) -> None:
    result = dataclasses.replace(with_images(), took_s=1.5)
    result.save(tmp_path / "r")
    assert {file.name for file in (tmp_path / "r").iterdir()} == {
        "result.json", "matches.csv", "pr_curve.npy", "query_xy.npy", "item_xy.npy", "samples.npy",
    }  # fmt: skip
    again = Result.load(tmp_path / "r")
    assert again.took_s == 1.5
    for name in ("query_xy", "item_xy", "true_item"):
        np.testing.assert_array_equal(getattr(again, name), getattr(result, name))
    assert again.samples is not None
    assert result.samples is not None
    np.testing.assert_array_equal(again.samples.images, result.samples.images)
    for name in ("query_xy", "item_xy", "samples"):
        (tmp_path / "r" / f"{name}.npy").unlink()
    matches = (tmp_path / "r" / "matches.csv").read_text().splitlines()
    (tmp_path / "r" / "matches.csv").write_text("\n".join(line.rsplit(",", 1)[0] for line in matches))
    older = Result.load(tmp_path / "r")
    assert (older.query_xy, older.item_xy, older.samples, older.true_item) == (None, None, None, None)


@pytest.mark.parametrize("name", ["query_xy", "item_xy", "samples"])
def test_files_of_another_result_are_refused(name: str, tmp_path: Path) -> None:
    with_images().save(tmp_path / "r")
    np.save(tmp_path / "r" / f"{name}.npy", np.zeros((1, 2)))
    with pytest.raises(EvaluationError, match="damaged"):
        Result.load(tmp_path / "r")


def test_real_techniques_against_a_plain_count(data: Path) -> None:
    with np.load(data / "scores/vprbench_corridor.npz", allow_pickle=False) as file:
        tables = {name: file[name] for name in file.files if file[name].shape == (111, 111)}
    assert len(tables) == 10
    for scores in tables.values():
        best = scores.argmax(axis=1)
        result = measure(answers(best.tolist()), truth.by_frames(111, 111, 2), scores)
        plain = np.mean(np.abs(best - np.arange(111)) <= 2)
        assert result.figures["accuracy"] == pytest.approx(plain)
        low, high = (result.figures[f"recall@1_{end}_ties"] for end in ("worst", "best"))
        assert low <= result.figures["recall@1"] <= high
