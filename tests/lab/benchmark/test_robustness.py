"""Drives that are worse, on a made one: what each disturbance does, and that a stopped call goes on."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from conftest import Drive
from evplace.core.errors import SettingsError
from evplace.core.workers import Workers
from evplace.imaging.traverse import Traverse
from evplace_lab.benchmark import _disturbances, robustness
from evplace_lab.benchmark._disturbances import MAPS, QUERIES, Night
from evplace_lab.benchmark._robust_page import page
from evplace_lab.benchmark.robustness import Recipe
from evplace_lab.city import CitySettings
from evplace_lab.reproduction._recipes import recipes


@pytest.fixture(scope="module")
def made(night_drive: Drive, night: Traverse) -> Night:
    return Night(night, night_drive.events, CitySettings(dt="1/30"))


def test_every_recipe_names_a_disturbance_and_is_clean_at_one_level() -> None:
    known = recipes("robustness", Recipe)
    assert sorted(recipe.kind for recipe in known) == sorted([*QUERIES, *MAPS])
    assert [recipe.order for recipe in known] == list(range(1, len(known) + 1))
    assert all(recipe.clean not in recipe.levels and recipe.about.endswith(".") for recipe in known)


def test_nothing_done_gives_the_clean_images(made: Night) -> None:
    clean = np.asarray(made.traverse.images)[1:]  # the first window begins with the first event
    for kind in ("dropout", "noise", "hot"):
        np.testing.assert_array_equal(QUERIES[kind](made, 0.0).images[1:], clean)
    np.testing.assert_array_equal(QUERIES["dt"](made, 1000 / 30).images[1:], clean)


def test_each_disturbance_grows_with_its_level(made: Night) -> None:
    clean = made.traverse.counts.sum()
    lost = [QUERIES["dropout"](made, level).counts.sum() / clean for level in (30, 70)]
    np.testing.assert_allclose(lost, [0.7, 0.3], atol=0.05)
    pixels, seconds = 80 * 60, len(made.traverse) / 30
    for level in (5.0, 20.0):
        more = QUERIES["noise"](made, level).counts.sum() - clean
        assert more == pytest.approx(level * pixels * seconds, rel=0.1)
    hot = QUERIES["hot"](made, 0.5)
    assert hot.counts.sum() - clean == pytest.approx(0.005 * pixels * 200 * seconds, rel=0.1)
    lit = [QUERIES["flicker"](made, level).counts.sum() for level in (10, 40)]
    assert clean < lit[0] < lit[1]
    longer = QUERIES["dt"](made, 100.0).counts
    assert longer[5:].sum() == pytest.approx(3 * made.traverse.counts[5:].sum(), rel=0.1)


def test_a_faster_drive_is_as_long_a_way_in_less_time(made: Night) -> None:
    fast = QUERIES["speed"](made, 2.0)
    clean = made.traverse
    assert len(fast) == pytest.approx(len(clean) / 2, abs=2)
    steps = [np.diff(one.xy[1:-1, 0]).mean() for one in (fast, clean)]
    assert steps[0] == pytest.approx(2 * steps[1], rel=0.1)
    assert fast.counts[2:-2].mean() == pytest.approx(2 * clean.counts[2:-2].mean(), rel=0.2)


def test_late_positions_are_those_of_before(day: Traverse) -> None:
    late = MAPS["gps"](day, 0.2)
    step = np.median(np.diff(day.xy[:, 0]))
    np.testing.assert_allclose(late.xy[10:, 0], day.xy[10:, 0] - 0.2 * 30 * step, atol=0.01)
    np.testing.assert_array_equal(late.t_us, day.t_us)


def test_a_camera_elsewhere_is_rendered_anew(tmp_path: Path) -> None:
    from evplace_lab.city import generate

    settings = CitySettings(
        fps=30, width=32, height=24, sensors=("ideal",), route_length_m=60.0, conditions=("night",),
        paths=(1,), keep_events=True,
    )  # fmt: skip
    (folder,) = generate(tmp_path / "city", settings, workers=1)
    night = Night.load(folder, settings)
    same = QUERIES["lateral"](night, 0.0)
    np.testing.assert_array_equal(same.images, night.traverse.images)
    np.testing.assert_allclose(same.xy, night.traverse.xy, atol=1e-6)
    right = QUERIES["lateral"](night, 2.0)
    away = right.xy - night.traverse.xy
    np.testing.assert_allclose(np.hypot(*away.T), 2.0, atol=1e-6)
    heading = np.radians(night.traverse.track.heading_deg)  # type: ignore[union-attr]
    np.testing.assert_allclose(away[:, 0] * np.cos(heading) - away[:, 1] * np.sin(heading), 2.0, atol=1e-6)
    assert (np.asarray(right.images) != np.asarray(night.traverse.images)).any()


def outcome(job: dict[str, Any]) -> dict[str, Any]:
    share = 0.9 if job["kind"] == "clean" else 0.5
    figures = {
        "accuracy": share,
        "within_5_m": share,
        "recall@1": share,
        "rejection_rate": 0.0,
        "chance": 0.1,
    }
    return {name: figures for name in robustness.METHODS if (job["kind"], name) != ("gps", "paper")}


def test_a_stopped_call_goes_on_and_the_page_shows_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[str] = []

    def run_all(module: str, jobs: Any, workers: Workers, out: Path, report: Any) -> None:
        assert (module, out) == ("evplace_lab.benchmark._robust_worker", tmp_path)
        assert len(jobs) <= workers.count
        for job in (job for share in jobs for job in share["jobs"]):
            ran.append(job["kind"])
            Path(job["file"]).parent.mkdir(exist_ok=True)
            Path(job["file"]).write_text(json.dumps(outcome(job)))
            report(0, job["kind"])

    monkeypatch.setattr(robustness, "run_all", run_all)
    monkeypatch.setattr(robustness, "generate", lambda *_: [])
    shown: list[tuple[int, int, str]] = []
    tmp_path.mkdir(exist_ok=True)
    run = [tmp_path, ["noise", "gps"], 2, lambda _: None, lambda *at: shown.append(at)]
    document = robustness.robustness(*run)  # type: ignore[arg-type]
    assert sorted(ran) == ["clean", *["gps"] * 3, *["noise"] * 4]
    assert shown[-1][:2] == (8, 8)
    again = robustness.robustness(*run)  # type: ignore[arg-type]
    assert len(ran) == 8
    assert again["rows"] == document["rows"]
    lost = {row["lost"] for row in document["rows"]}
    np.testing.assert_allclose(sorted(lost), [0.0, 0.4])
    (table,) = robustness.tables(document)
    assert ["late positions, s", "0.5", "50.0 (-40.0)", "50.0 (-40.0)", "-", "0.0"] in table.rows
    text = page(document, tmp_path / "page.html").read_text()
    assert text.count("<polyline") == 6
    assert "&lt;" not in text
    ElementTree.fromstring(text.partition("<body>")[2].partition("</body>")[0].join(("<body>", "</body>")))
    with pytest.raises(SettingsError, match="'rain' is no disturbance: known are dropout, noise"):
        robustness.robustness(tmp_path, ["rain"], 1, lambda _: None, lambda *_: None)


def test_the_street_is_the_demos() -> None:
    from evplace_lab.demonstration import USUAL

    assert (robustness.TOWN.route_length_m, robustness.TOWN.seed) == (USUAL.length_m, 0)
    assert dataclasses.replace(robustness.TOWN).keep_events
    assert _disturbances.drive_number("night", 1) == 101
