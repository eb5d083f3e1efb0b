"""The whole way from seeds to weights, in small."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("torch", reason="the network needs the extra 'train'")

from evplace.cli import main
from evplace.core.errors import SettingsError
from evplace.scorers.trained import ABOUT, DescriptorGraph, Trained
from evplace_lab.descriptor import making
from evplace_lab.descriptor.bursts import BurstSettings
from evplace_lab.descriptor.making import Recipe, town_file
from evplace_lab.reproduction import Choice, descriptor, reproduce

SMALL = Recipe(towns=1, bursts=BurstSettings(routes=1, drives=2, places=6), steps=2)
ONE = Choice(seeds=1)


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("made")


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(descriptor, "make", lambda *_: SMALL)
    monkeypatch.setattr(making, "UNSEEN", making.UNSEEN[1:])


@pytest.fixture(scope="module")
def made(out: Path) -> dict[str, Any]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(descriptor, "make", lambda *_: SMALL)
        patch.setattr(making, "UNSEEN", making.UNSEEN[1:])
        return reproduce("descriptor", out, choice=ONE, workers=2)


def test_each_seed_gives_weights_that_describe(made: dict[str, Any], out: Path) -> None:
    first, shipped = made["rows"]
    assert (first["weights"], shipped["weights"]) == ("seed 0", "shipped")
    assert first["sha256"] == DescriptorGraph(out / "seed-0").checksum
    assert shipped["sha256"] == Trained().version
    assert set(first["recall"]) == {"streets", "halls"}
    assert json.loads((out / "descriptor.json").read_text()) == made


def test_what_is_there_is_kept(made: dict[str, Any], out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(making, "run_all", lambda _, jobs, *__: pytest.fail("made again") if jobs else None)
    before = (out / "seed-0" / ABOUT).stat().st_mtime_ns
    again = reproduce("descriptor", out, choice=ONE, workers=1)
    assert again["rows"] == made["rows"]
    assert (out / "seed-0" / ABOUT).stat().st_mtime_ns == before


def test_towns_of_other_settings_are_others(out: Path) -> None:
    assert town_file(out, SMALL, 1) != town_file(out, Recipe(), 1)
    assert town_file(out, SMALL, 1) == town_file(out, Recipe(towns=9, bursts=SMALL.bursts), 1)


def test_the_table_names_the_weights(
    made: dict[str, Any], out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["reproduce", "descriptor", "-o", str(out), "--seeds", "1"]) == 0
    printed = capsys.readouterr().out
    assert "seed 0" in printed
    assert "shipped" in printed


def test_unknown_settings_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    with pytest.raises(SettingsError, match=r"the descriptor's recipe: .*epochs"):
        reproduce("descriptor", tmp_path, choice=Choice(train={"epochs": 3}))
