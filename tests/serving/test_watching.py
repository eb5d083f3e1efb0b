"""What a terminal shows, and the demo that ends in a page."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path
from typing import Any

import pytest

from conftest import Drive
from evplace.cli import main
from evplace.localizer import Match
from evplace.placemap import PlaceMap
from evplace.serving._feed import Counters
from evplace.serving._report import Report
from evplace.serving.watching import EVERY_S, Lines, line
from evplace.sources.writers import write_recording

AT = Match(12_030_000, 5, 17, (586_108.0, 4_134_189.9), 0.5, "localised", 0.96, 8.2, 214.0)


def reported(match: Match, host_s: float = 0.0) -> Report:
    return Report(match, host_s, 0.0012, 1.24e6, 0.0, Counters(skipped=3))


def test_a_line_says_all_in_columns(image_map: PlaceMap) -> None:
    city = dataclasses.replace(image_map, zone=(10, True))
    said = line(reported(AT), city)
    assert re.fullmatch(
        r" +12\.03 s  localised +place 17 +96 % +± 8\.2 m  37\.\d{6}, -122\.\d{6}  214° +1\.2 ms +1\.24 Mev/s"
        r"  skipped 3",
        said,
    )
    gone = line(reported(Match(1_000_000, -1, -1, None, math.nan, "no-events")), city)
    assert "nan" not in gone


def test_lines_come_with_what_is_new(image_map: PlaceMap) -> None:
    said: list[str] = []
    lines = Lines(image_map, said.append)
    lines.publish(reported(AT))
    lines.publish(reported(AT, EVERY_S / 2))
    assert len(said) == 1
    lines.publish(reported(dataclasses.replace(AT, place=18), EVERY_S / 2))
    lines.publish(reported(dataclasses.replace(AT, place=18), 2 * EVERY_S))
    assert len(said) == 3


def test_localize_watches(
    image_map: PlaceMap, night_drive: Drive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    image_map.save(tmp_path / "street.evp")
    write_recording(tmp_path / "night.raw", [night_drive.events], (80, 60))
    arguments = ["localize", str(tmp_path / "street.evp"), str(tmp_path / "night.raw"), "--watch"]
    assert main([*arguments, "--matcher", "best"]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert len(shown) > 4
    assert all("localised" in one for one in shown)
    assert main([*arguments, "--json"]) == 2
    assert "--watch shows lines in a terminal" in capsys.readouterr().err


def test_the_demo_ends_in_a_page(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Its city and its map are made once; the service gets the night's recording, for ever."""
    pytest.importorskip("uvicorn", reason="the service needs the extra 'web': pip install 'evplace[web]'")
    from evplace.cli import serve
    from evplace_lab.cli import demo

    (tmp_path / "live.evp").mkdir()
    (tmp_path / "live.evp" / "map.json").write_text("{}")
    drives = {name: tmp_path / "live" / name for name in ("day-1", "night-1")}
    monkeypatch.setattr(demo, "_driven", lambda folder, settings: drives)
    asked: list[Any] = []

    def run(args: Any) -> int:
        asked.append(args)
        return 0

    monkeypatch.setattr(serve, "run", run)
    assert main(["demo", "--live", "--out", str(tmp_path), "--port", "0"]) == 0
    (args,) = asked
    assert args.source == str(tmp_path / "live" / "night-1" / "ideal.aedat4")
    assert (args.map, dict(args.source_set), args.open) == (tmp_path / "live.evp", {"loops": 0}, True)
