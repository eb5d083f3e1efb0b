"""Settings and inputs that would fill a disk, a memory or a day: one clear line before the work."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from conftest import make_drive, write_drive
from evplace.cli import images as images_command
from evplace.cli import main
from evplace.core.errors import SettingsError
from evplace.imaging.images import ImageSettings
from evplace.imaging.windows import WindowSettings

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    recording, _ = write_drive(tmp_path, "day", make_drive(windows=20))
    return recording


@pytest.mark.parametrize(
    "settings",
    [
        {"width": 10**6}, {"height": 10**9}, {"width": 8192, "height": 8192}, {"bins": 10**6},
        {"tau_ms": 1e300}, {"width": 4000, "height": 4000, "bins": 200}, {"saturation": 10**30},
    ],
)  # fmt: skip
def test_images_that_no_memory_holds(settings: dict[str, int]) -> None:
    with pytest.raises(SettingsError, match=r"cannot be|too large"):
        ImageSettings(**settings)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "dt",
    ["1e999999999", "1e-999999999", "1e400", "86401", "1/0", "9" * 5000, "1/" + "9" * 5000, "-1", "", "inf"],
)
def test_windows_of_any_length(dt: str) -> None:
    """A number is bounded before it is computed with."""
    with pytest.raises(SettingsError, match="'dt' cannot be"):
        WindowSettings(dt)


def test_more_than_a_gigabyte_is_asked_about_first(drive: Path, tmp_path: Path, capsys: Capture) -> None:
    """Nothing is written before; the line says how many images there would be."""
    command = ["images", str(drive), "-o", str(tmp_path / "x"), "--dt", "1/1000000"]
    assert main(command) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    for words in ("images of 14,400 bytes are 9.", "GB, in all", "--yes writes them all"):
        assert words in told
    assert not (tmp_path / "x").exists()


def test_what_cannot_be_foretold_stops_at_the_limit(
    drive: Path, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(images_command, "MOST_BYTES", 100_000)
    command = ["images", str(drive), "-o", str(tmp_path / "x"), "--count", "100"]
    assert main(command) == 2
    assert "7 images of 14,400 bytes are 0.0 GB, and more may come" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()
    assert main([*command, "--yes"]) == 0


def test_one_image_of_all_is_remarked_on(drive: Path, tmp_path: Path, capsys: Capture) -> None:
    assert main(["images", str(drive), "-o", str(tmp_path / "x"), "--dt", "3600"]) == 0
    assert "there is one image only" in capsys.readouterr().err


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
@pytest.mark.parametrize(
    "arguments",
    [
        ["info", "{pipe}"], ["doctor", "{pipe}"], ["images", "{pipe}", "-o", "{out}"],
        ["convert", "{pipe}", "{out}.npz"], ["images", "{day}", "-o", "{out}", "--track", "{pipe}"],
        ["images", "{day}", "-o", "{out}", "--mask", "{pipe}"], ["simulate", "{pipe}", "{out}.npz"],
        ["images", "{day}", "-o", "{out}", "--settings", "{pipe}"], ["match", "{pipe}"],
        ["train", "{pipe}", "-o", "{out}"], ["localize", "{pipe}", "{day}"], ["compare", "{pipe}"],
        ["report", "{pipe}"],
    ],
)  # fmt: skip
def test_pipes_block_nobody(arguments: list[str], drive: Path, tmp_path: Path, capsys: Capture) -> None:
    pipe, out = tmp_path / "pipe.png", tmp_path / "out"
    os.mkfifo(pipe)
    assert main([part.format(pipe=pipe, day=drive, out=out) for part in arguments]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert not list(tmp_path.glob("out*"))
