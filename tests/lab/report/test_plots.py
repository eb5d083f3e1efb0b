"""The files of a report: the page and the plots beside it."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from made_results import make_result, make_unanswered, write_run

from evplace.core.errors import OutputError
from evplace_lab.report import report


def test_a_page_and_its_plots(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="plots need the extra 'report'")
    run = write_run(tmp_path / "run")
    written = report(run)
    assert written.page == run / "report.html"
    assert [plot.name for plot in written.plots] == [
        "report-accuracy.png", "report-curves-day-night-night-1.png", "report-curves-day-rain-rain-1.png",
        "report-items.png", "report-route.png",
    ]  # fmt: skip
    for plot in written.plots:
        assert plot.read_bytes().startswith(b"\x89PNG")
    assert written.remark is None
    with pytest.raises(OutputError, match="exists"):
        report(run)
    report(run, overwrite=True)


def test_no_plot_is_replaced_unasked(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="plots need the extra 'report'")
    run = write_run(tmp_path / "run")
    (run / "report-route.png").write_bytes(b"mine")
    with pytest.raises(OutputError, match=r"report-route\.png exists"):
        report(run)
    assert (run / "report-route.png").read_bytes() == b"mine"
    assert not (run / "report-accuracy.png").exists()
    assert not (run / "report.html").exists()


def test_plots_of_a_report_that_was_stopped_are_drawn_again(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="plots need the extra 'report'")
    run = write_run(tmp_path / "run")
    report(run)
    (run / "report.html").unlink()  # it is written last
    (run / "report-items.png").unlink()
    assert len(report(run).plots) == 5
    assert (run / "report-items.png").exists()


def test_panels_that_are_named_alike_keep_their_own_plots(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="plots need the extra 'report'")
    panels = [{"panel": name, "points": [[0.5, 0.5, 0.5]]} for name in ("day/night", "day night")]
    sheet = {"format": "evplace-curves-1", "curves": panels}
    (tmp_path / "figure5.json").write_text(json.dumps(sheet))
    names = ["report-curves-day-night.png", "report-curves-day-night-2.png"]
    assert [plot.name for plot in report(tmp_path).plots] == names


def test_one_result_elsewhere(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="plots need the extra 'report'")
    make_result().save(tmp_path / "night.result")
    before = sorted((tmp_path / "night.result").iterdir())
    written = report(tmp_path / "night.result", tmp_path / "out" / "night.html")
    assert {plot.name for plot in written.plots} == {"night-curves.png", "night-items.png", "night-route.png"}
    assert sorted((tmp_path / "night.result").iterdir()) == before


def test_without_matplotlib_there_is_still_a_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    written = report(write_run(tmp_path / "run"))
    assert written.plots == []
    assert written.remark is not None
    assert "pip install 'evplace[report]'" in written.remark
    assert "pip install &#x27;evplace[report]&#x27;" in written.page.read_text()


def test_a_drive_without_answers(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="plots need the extra 'report'")
    make_unanswered().save(tmp_path / "nothing")
    assert len(report(tmp_path / "nothing").plots) == 3
