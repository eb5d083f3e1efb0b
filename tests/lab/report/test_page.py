"""The page as text: what stands in it, what must not, and how large it is."""

from __future__ import annotations

import base64
import dataclasses
import io
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_results import make_result, write_run
from PIL import Image

from evplace_lab.report._found import Curve, Found, PaperCurve, Sheet, look
from evplace_lab.report._html import Html, join, tag
from evplace_lab.report._page import _inline_json, page
from evplace_lab.report._panels import panels
from evplace_lab.report._pictures import sample_images

EVIL = "</script><script>alert(1)</script><img src=x onerror=alert(2)>"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Found:
    return look(write_run(tmp_path_factory.mktemp("made") / "run"))


def inlined(text: str) -> dict[str, Any]:
    """The data that the page's scripts draw."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert found
    data: dict[str, Any] = json.loads(found[1])
    return data


def test_every_part_is_there(run: Found) -> None:
    text = page(run)
    for words in (
        "Table 2: events and colour", "Algorithm 1, live", "90.0 ± 1.5", "85.8", "seen 88.2", "rejected 3.5",
        'data-rule="view" hidden', "10 of 10", "▲ better", "▼ worse", "= no effect seen", "321",
        "train.steps", "<title>run</title>",
    ):  # fmt: skip
        assert words in text, words
    data = inlined(text)
    assert [panel["title"] for panel in data["panels"]] == ["day-night (night-1)", "day-rain (rain-1)"]
    assert [result["name"] for result in data["results"]] == ["night-0 events", "night-1 events"]
    assert len(data["results"][0]["samples"]) == 8
    assert len(data["positions"]) == 2  # both results share query and item positions


def test_ablations_stand_from_best_to_worst(run: Found) -> None:
    text = page(run)
    names = ["no last ReLU", "no blur", "half the K"]
    places = [text.index(f">{name}<") for name in names]
    assert places == sorted(places)


def test_what_is_missing_is_left_out() -> None:
    text = page(Found("one", None, None, None, {"night": make_result()}))
    for name in ("table", "curves", "ablations", "results", "making"):
        assert f'<section id="{name}"' not in text
    assert '<section id="look"' in text
    assert inlined(text)["panels"] == []


def test_results_alone_have_a_panel_and_an_overview() -> None:
    found = Found("some", None, None, None, {f"r{n}": make_result(n) for n in range(12)})
    text = page(found)
    assert '<section id="results"' in text
    assert len(inlined(text)["panels"][0]["lines"]) == 8


def test_a_result_without_positions_images_or_truth() -> None:
    bare = dataclasses.replace(
        make_result(), query_xy=None, item_xy=None, samples=None, true_item=None, took_s=None
    )
    result = inlined(page(Found("bare", None, None, None, {"bare": bare})))["results"][0]
    assert (result["query_xy"], result["true"], result["samples"]) == (None, None, [])


def test_nothing_is_loaded_from_elsewhere(run: Found) -> None:
    text = page(run)
    addresses = set(re.findall(r"https?://[^\"'\s<]*", text))
    assert addresses == {"http://www.w3.org/2000/svg"}
    assert "default-src 'none'" in text
    assert not re.findall(r"<(?:link|iframe|object|base)\b", text)
    assert all(source.startswith("data:image/png") for source in re.findall(r'src="([^"]*)"', text))


def test_real_sets_have_a_section_of_their_own(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", results=0)
    rows = [
        {
            "database": "Summer", "query": name, "sensor": name, "input": "images", "matcher": matcher,
            "rule": rule, "mean": 77.25, "chance": 1.0, "paper": None,
        }
        for name, rule in (("Nordland", "within 0"), ("Nordland", "within 2"), ("Example", "given"))
        for matcher in ("best", "SeqSLAM")
    ]  # fmt: skip
    sheet = {"format": "evplace-table-1", "title": "Real drives: accuracy in %", "rows": rows}
    (run / "real.json").write_text(json.dumps(sheet))
    text = page(look(run))
    section = text[text.index('<section id="real"') :].partition("</section>")[0]
    assert text.index('<section id="table"') < text.index('<section id="real"')
    for words in ("Real drives: accuracy in %", ">within 0<", ">within 2<", ">given<", "Nordland", "77.2"):
        assert words in section
    assert "paper" not in section
    assert section.count('scope="colgroup"') == 6
    (run / "table2.json").unlink()
    assert "77.2 %" in page(look(run))


@pytest.mark.parametrize(("kind", "turned"), [("events", True), ("frames", False)])
def test_only_event_images_become_ink_on_paper(kind: str, turned: bool) -> None:
    result = make_result()
    assert result.samples is not None
    dark = dataclasses.replace(result.samples, images=np.zeros_like(result.samples.images))
    shaded = dataclasses.replace(result, settings={"map": {"recipe": {"kind": kind}}}, samples=dark)
    ((_, sources), *_) = sample_images({"r": shaded})["r"]
    picture = Image.open(io.BytesIO(base64.b64decode(sources[0].partition(",")[2])))
    assert np.asarray(picture.convert("L"))[0, 0] == (255 if turned else 0)


def test_names_cannot_become_markup(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", results=0)
    for sheet in run.glob("*.json"):
        content = json.loads(sheet.read_text()) | {EVIL: EVIL, "title": EVIL}
        changed = json.dumps(content)
        for word in ("night-1", "ideal", "Algorithm 1", "SeqSLAM", "no blur", "better", "day-night", "tau1"):
            changed = changed.replace(f'"{word}"', json.dumps(EVIL))
        sheet.write_text(changed)
    evil = dataclasses.replace(make_result(), settings={EVIL: EVIL}, versions={EVIL: EVIL})
    found = dataclasses.replace(look(run), name=EVIL, results={EVIL: evil, "other": make_result()})
    text = page(found, remark=EVIL)
    assert "<img src=x" not in text
    assert "<script>alert" not in text
    assert text.count("</script>") == 2
    data = inlined(text)
    assert data["results"][0]["name"] == EVIL
    assert data["panels"][0]["title"] == f"{EVIL} ({EVIL})"


@given(st.recursive(st.text() | st.integers(), lambda inner: st.lists(inner)))
def test_inlined_json_is_the_same_and_harmless(value: object) -> None:
    text = _inline_json(value)
    assert json.loads(text) == value
    assert not set("<>&\u2028") & set(text)


@given(st.text())
def test_text_is_escaped_and_markup_is_not(text: str) -> None:
    made = tag("p", text, tag("b", "x"), data_is=text)
    assert made.count("<") == 4
    assert made.endswith("<b>x</b></p>")
    assert join(Html("<i>"), None, "") == "<i>"


def test_a_page_of_many_results_stays_small() -> None:
    one = make_result(queries=2200)
    results = {f"result {n}": dataclasses.replace(one) for n in range(40)}
    text = page(Found("many", None, None, None, results))
    images = sum(len(source) for r in inlined(text)["results"] for _, s in r["samples"] for source in s)
    assert len(text) - images < 5_000_000


def test_images_keep_to_their_budget() -> None:
    results = {f"r{n}": make_result(n, size=(45, 80, 3)) for n in range(3)}
    whole = sample_images(results)
    size = sum(len(source) for shown in whole.values() for _, three in shown for source in three)
    half = sample_images(results, budget=size // 2)
    assert [len(shown) for shown in half.values()] == [4, 4, 4]
    assert half["r0"][-1] == whole["r0"][-1]
    assert [len(shown) for shown in sample_images(results, budget=1).values()] == [1, 1, 1]


def test_colours_tell_methods_and_styles_inputs() -> None:
    points = [[0.5, 0.1, 0.9], [0.6, None, 0.8]]
    ours = tuple(Curve("p", points, matcher="graph, 0.1", input=kind) for kind in ("events", "colour"))
    papers = (PaperCurve("p", "Graph, colour", [[0.1, 0.2]]), PaperCurve("p", "SeqSLAM", [[0.1, 0.2]]))
    (panel,) = panels(Found("f", None, Sheet(ours, papers), None, {}))
    assert [len(line.points) for line in panel.lines] == [1, 1, 1, 1]
    assert [line.colour for line in panel.lines] == [0, 0, 0, 1]
    assert [line.style for line in panel.lines] == ["solid", "thin", "dashed", "dashed"]


def test_thinned_curves_stay_close_to_the_exact_ones() -> None:
    result = make_result(queries=2000)
    found = Found("f", None, None, None, {"a": result, "b": result})
    kept = np.array([point[:2] for point in panels(found)[0].lines[0].points])
    exact = result.curve[:, [2, 1]]
    far = np.abs(exact[:, None] - kept[None]).max(axis=2).min(axis=1)
    assert len(kept) < len(exact)
    assert far.max() < 0.002
