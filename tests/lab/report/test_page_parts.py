"""The small parts of a page: which points, images and records are kept, and how figures are put."""

from __future__ import annotations

import base64
import dataclasses
import io
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from made_results import make_result, make_unanswered
from PIL import Image

from evplace.core.errors import InputError
from evplace.evaluation import flat
from evplace_lab.report import _tables
from evplace_lab.report._found import Ablation, Curve, Found, PaperCurve, Sheet, TableRow, _natural, look
from evplace_lab.report._html import Html, tag
from evplace_lab.report._panels import CLOSE, MOST_CURVES, STYLES, _visible, panels, result_line
from evplace_lab.report._pictures import LEVELS, _evenly, _source, sample_images

share = st.floats(0, 1) | st.integers(0, 9).map(lambda step: step * 0.0007) | st.just(math.nan)
names = st.text("ab12", min_size=1, max_size=6)


@given(st.lists(st.tuples(share, share, st.floats(allow_nan=True)), max_size=40))
@example([(0.1, 0.1, 1.0), (0.101, 0.1, 2.0)])
def test_points_are_left_out_only_beside_one_that_is_kept(points: list[tuple[float, float, float]]) -> None:
    kept = _visible(points)
    known = [point for point in points if not math.isnan(point[0]) and not math.isnan(point[1])]
    for recall, precision, _ in known:
        assert min(max(abs(recall - r), abs(precision - p)) for r, p, _ in kept) < CLOSE
    assert {point[:2] for point in kept} <= {point[:2] for point in known}
    assert all(value is None or math.isfinite(value) for _, _, value in kept)
    if points and points[-1] in known:
        assert kept[-1][:2] == points[-1][:2]


def found(**parts: Any) -> Found:
    return dataclasses.replace(Found("made", None, None, None, {}), **parts)


def test_results_share_one_panel_the_best_first() -> None:
    results = {f"r{n}": make_result(n) for n in range(MOST_CURVES + 3)}
    (panel,) = panels(found(results=results))
    precision = [line.average_precision for line in panel.lines]
    assert precision == sorted(precision, reverse=True)  # type: ignore[type-var]
    assert len(panel.lines) == MOST_CURVES
    assert str(MOST_CURVES) in panel.title
    assert [line.colour for line in panel.lines] == list(range(MOST_CURVES))
    (few,) = panels(found(results=dict(list(results.items())[:2])))
    assert few.title == "All results"
    assert panels(found(results={"one": make_result()})) == []


def test_a_result_without_answers_has_a_line_without_points() -> None:
    line = result_line("nothing", make_unanswered())
    assert [point for point in line.points if not math.isnan(point[1])] == line.points


def curve(**values: Any) -> Curve:
    return Curve(
        **({"panel": "p", "points": [[0.5, 0.1, 0.9]], "matcher": "local", "input": "events"} | values)
    )


def test_several_sensors_of_one_input_are_named_and_styled() -> None:
    curves = tuple(curve(sensor=f"s{n}") for n in range(6))
    (panel,) = panels(found(curves=Sheet(curves)))
    assert panel.lines[0].label == "events (s0), local, hindsight"
    assert [line.style for line in panel.lines] == [*STYLES, STYLES[-1], STYLES[-1]]
    (plain,) = panels(found(curves=Sheet((curve(), curve(input="colour", query="night")))))
    assert [line.label for line in plain.lines] == ["events, local, hindsight", "colour, local, hindsight"]
    assert plain.title == "p (night)"


def test_a_panel_of_the_paper_alone_is_shown_too() -> None:
    theirs = (PaperCurve("q", "SeqSLAM", [[0.5, None], [0.2, 0.9]]),)
    one, other = panels(found(curves=Sheet((curve(),), theirs)))
    assert (one.title, other.title) == ("p", "q")
    assert other.lines[0].points == [(0.2, 0.9, None)]


@given(st.lists(st.integers(0, 99), min_size=1, max_size=30), st.integers(1, 40))
def test_an_even_choice_keeps_both_ends_and_the_order(queries: list[int], many: int) -> None:
    samples = [(query, ["", "", ""]) for query in queries]
    chosen = _evenly(samples, many)
    assert len(chosen) == many
    assert chosen[0] == samples[0]
    assert many == 1 or chosen[-1] == samples[-1]
    places = [next(n for n, sample in enumerate(samples) if sample is one) for one in chosen]
    assert places == sorted(places)
    assert _evenly([], many) == []


def decoded(source: str) -> Image.Image:
    head, _, body = source.partition(",")
    assert head == "data:image/png;base64"
    return Image.open(io.BytesIO(base64.b64decode(body)))


@pytest.mark.parametrize(("shape", "kind"), [((20, 30), "grey"), ((20, 30, 3), "colours")])
def test_pictures_keep_their_size_and_few_shades(shape: tuple[int, ...], kind: str) -> None:
    image = np.random.default_rng(0).integers(0, 256, shape, np.uint8)
    picture = decoded(_source(image, events=False))
    assert picture.size == (30, 20)
    shown = np.asarray(picture.convert("RGB")).reshape(-1, 3)
    assert len(np.unique(shown, axis=0)) <= LEVELS[kind]
    smooth = np.tile(np.linspace(0, 255, 30).astype(np.uint8), (20, 1))
    shades = np.asarray(decoded(_source(smooth, events=False)).convert("L"), int)
    assert np.abs(shades - smooth).max() <= 256 // LEVELS["grey"]


def test_only_images_that_exist_are_shown() -> None:
    result = make_result()
    assert result.samples is not None
    item = result.answers.item.copy()
    item[result.samples.query[0]] = -1
    unanswered = dataclasses.replace(result, answers=result.answers._replace(item=item), true_item=None)
    (_, three), *_ = sample_images({"r": unanswered})["r"]
    assert [bool(source) for source in three] == [True, False, True]
    assert sample_images({"r": dataclasses.replace(result, samples=None)}) == {}


@given(st.lists(st.integers(0, 2000), unique=True), names)
def test_numbers_in_names_count_as_numbers(numbers: list[int], word: str) -> None:
    files = [Path(f"{word.strip('12')} {n} x") for n in numbers]
    assert sorted(files, key=_natural) == [file for _, file in sorted(zip(numbers, files, strict=True))]


@pytest.mark.parametrize(
    ("record", "words"),
    [
        ({"query": "q", "input": "i", "matcher": "m"}, "without 'mean'"),
        ({"query": "q", "input": "i", "matcher": "m", "mean": True}, "the mean True, which is no number"),
        ({"query": 3, "input": "i", "matcher": "m", "mean": 1}, "the query 3, which is no text"),
        ({"query": "q", "input": "i", "matcher": "m", "mean": 1, "spread": "x"}, "the spread 'x'"),
        ("text", ""),
        (7, ""),
    ],
)
def test_a_record_that_does_not_fit_is_named(tmp_path: Path, record: object, words: str) -> None:
    text = json.dumps({"format": "evplace-table-1", "rows": [record]})
    (tmp_path / "table2.json").write_text(text)
    with pytest.raises(InputError, match=f"table2.json is damaged: its rows hold.*{words}"):
        look(tmp_path)


def test_a_number_too_large_to_be_one_is_refused(tmp_path: Path) -> None:
    record = '{"query": "q", "input": "i", "matcher": "m", "mean": 1e999}'
    (tmp_path / "table2.json").write_text(f'{{"format": "evplace-table-1", "rows": [{record}]}}')
    with pytest.raises(InputError, match="no finite number"):
        look(tmp_path)


@pytest.mark.parametrize(
    ("given_format", "words"),
    [
        ("evplace-table-2", "newer version"),
        ("evplace-table-0", "make it again"),
        ("x", "not evplace-table-1"),
        (None, "None"),
    ],
)
def test_another_format_is_told_from_a_newer_one(tmp_path: Path, given_format: object, words: str) -> None:
    (tmp_path / "table2.json").write_text(json.dumps({"format": given_format, "rows": []}))
    with pytest.raises(InputError, match=words):
        look(tmp_path)


@given(st.recursive(st.integers(), lambda inner: st.dictionaries(names, inner, max_size=3), max_leaves=12))
def test_a_flat_mapping_has_every_leaf_under_its_whole_name(values: Any) -> None:
    whole = {"root": values}
    for name, leaf in flat(whole).items():
        here: Any = whole
        for part in name.split("."):
            here = here[part]
        assert here == leaf
        assert not isinstance(leaf, dict)

    def leaves(value: Any) -> int:
        return sum(map(leaves, value.values())) if isinstance(value, dict) else 1

    assert len(flat(whole)) == leaves(values)


def test_attributes_stand_where_they_have_a_value() -> None:
    made = tag("td", None, "a<b", class_="x", data_rule='"', hidden=True, title=None, inert=False, rowspan=2)
    assert made == '<td class="x" data-rule="&quot;" hidden rowspan="2">a&lt;b</td>'
    assert isinstance(made, Html)


def row(**values: Any) -> TableRow:
    plain = {"query": "night", "input": "events", "matcher": "Algorithm 1", "mean": 90.0}
    return TableRow(**(plain | values))


def tiles(**parts: Any) -> list[tuple[str, str, str]]:
    return _tables._headline_figures(found(**parts))


def test_the_headline_sets_events_beside_colour() -> None:
    rows = (row(spread=1.25, paper=85.8), row(input="colour", mean=40.0), row(input="edges", mean=95.0))
    assert tiles(table=Sheet(rows)) == [
        ("90.0 ± 1.2 %", "night, events, Algorithm 1, hindsight", "colour 40.0, paper 85.8"),
        ("1 of 1", "events better than colour", "all queries and matchers"),
    ]
    alone = tiles(table=Sheet((row(matcher="other"),)))
    assert alone == [("90.0 %", "night, events, other, hindsight", "")]
    other_rule = (*rows, row(rule="view", mean=1.0))
    assert tiles(table=Sheet(other_rule)) == tiles(table=Sheet(rows))


def test_the_headline_takes_what_there_is() -> None:
    assert tiles() == []
    assert tiles(ablations=Sheet(())) == []
    changes = (Ablation("a", "b", 90, -2.0), Ablation("c", "d", 90, 3.5))
    assert tiles(ablations=Sheet(changes)) == [("+3.5 points", "the best change", "c")]
    results = {"a": make_result(0), "b": make_result(3)}
    assert tiles(results={"a": results["a"]})[0][1:] == ("accuracy", "")
    number, accuracy, *_ = tiles(results=results)
    assert number == ("2", "results", "")
    best = max(results, key=lambda name: results[name].figures["accuracy"] or 0)
    assert accuracy[1:] == ("best accuracy", best)


@given(st.floats(-1, 1))
def test_a_bar_goes_from_the_middle_to_its_side(effect: float) -> None:
    rect = str(_tables._bar(effect)).split("<rect")[1]
    x, width = (float(rect.split(f' {key}="')[1].split('"')[0]) for key in ("x", "width"))
    middle, length = _tables.BAR_PX, abs(effect) * _tables.BAR_PX
    assert x == pytest.approx(middle if effect >= 0 else middle - length, abs=0.06)
    assert width == pytest.approx(max(length, 1.0), abs=0.06)
    assert ("gain" in rect) == (effect >= 0)


def test_a_table_has_a_column_for_each_input_and_the_papers_figures() -> None:
    rows = [
        row(chance=4.0, paper=85.0), row(input="colour", mean=50.0), row(query="rain", mean=70.0, seen=66.0),
    ]  # fmt: skip
    table = str(_tables._block("Algorithm 1", "live", rows))
    assert table.count("<tr>") == 4
    assert table.count("paper</th>") == 1
    assert "<td>–</td>" not in table
    assert table.count("–") == 3, "rain has no colour, no figure of the paper and no chance"
    assert "seen 66.0" in table
