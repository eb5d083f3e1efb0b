"""A package that is missing is one line before the work."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from evplace.cli import main
from evplace.core.errors import MissingExtraError, SettingsError
from evplace.imaging.traverse import Traverse
from evplace.placemap import train
from evplace.places import PlaceGrid
from evplace_lab.reproduction import reproduce

PIP = r"pip install 'evplace\[train\]'"


@pytest.fixture
def no_torch(monkeypatch: pytest.MonkeyPatch) -> None:
    main(["list", "scorers", "--json"])  # when it first reads flags, tyro imports what sys.modules names
    monkeypatch.setitem(sys.modules, "torch", None)


@pytest.mark.parametrize("scorer", ["network", "notebook"])
def test_training_without_torch_is_refused_before_the_drive_is_read(
    scorer: str, no_torch: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = tmp_path / "no-such-drive"
    assert main(["train", str(missing), "-o", str(tmp_path / "a.evp"), "--scorer", scorer]) == 2
    assert "pip install 'evplace[train]'" in capsys.readouterr().err


def test_demo_and_tables_say_so_before_the_city_is_made(
    no_torch: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["demo", "--train", "--out", str(out)]) == 2
    assert "pip install 'evplace[train]'" in capsys.readouterr().err
    with pytest.raises(MissingExtraError, match=PIP):
        reproduce("table2", out)
    assert not out.exists()


def test_a_wrong_name_is_told_before_the_map_is_learned(
    day: Traverse, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evplace.placemap._training.learned_map", lambda *_: pytest.fail("it has learned"))
    assert day.track is not None
    places = PlaceGrid.from_track(day.track)
    with pytest.raises(SettingsError, match="'nonsense' is none of the scorers"):
        train(day, places, scorer="nonsense")
    with pytest.raises(SettingsError, match="'nonsense' is none of the matchers"):
        train(day, places, matcher="nonsense")
