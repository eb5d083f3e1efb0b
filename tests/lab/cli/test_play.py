"""`evplace play` after `evplace evaluate`, as a person types them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from PIL import Image

from conftest import make_drive, write_drive
from evplace.cli import main

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map of images, the recording of a later drive, and results by positions and by frames."""
    folder = tmp_path_factory.mktemp("play")
    for name, seed in (("day", 0), ("night", 1)):
        write_drive(folder, name, make_drive(seed=seed, windows=20))
    day = [f"{folder}/day.aedat4", "--track", f"{folder}/day.csv"]
    night = [f"{folder}/street.evp", f"{folder}/night.aedat4"]
    assert main(["train", *day, "-o", f"{folder}/street.evp", "--scorer", "ncc"]) == 0
    assert main(["evaluate", *night, "--track", f"{folder}/night.csv", "-o", f"{folder}/night.result"]) == 0
    assert main(["evaluate", *night, "--frames", "1", "-o", f"{folder}/frames.result"]) == 0
    return folder


def words(made: Path, result: str = "night.result") -> list[str]:
    return ["play", f"{made}/{result}", f"{made}/street.evp", f"{made}/night.aedat4"]


def test_a_result_becomes_a_film(made: Path, capsys: Capture) -> None:
    assert main(words(made)) == 0
    assert f"{made}/night.result/play.webp: open it in any browser" in capsys.readouterr().out
    with Image.open(made / "night.result" / "play.webp") as film:
        assert film.n_frames == 20  # type: ignore[attr-defined]
    assert main(words(made)) == 2
    assert "play.webp exists" in capsys.readouterr().err
    assert main([*words(made), "--overwrite"]) == 0


def test_a_shorter_film_is_of_fewer_images(made: Path, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "night.gif"
    assert main([*words(made), "-o", str(out), "--seconds", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"film": str(out)}
    with Image.open(out) as film:
        assert (film.format, film.n_frames, film.info["duration"]) == ("GIF", 10, 100)  # type: ignore[attr-defined]


def test_a_result_without_positions_says_that_the_route_is_missing(made: Path, capsys: Capture) -> None:
    assert main(words(made, "frames.result")) == 0
    assert "holds no positions: the film is without a route" in capsys.readouterr().err


def test_what_does_not_belong_together_is_one_line(made: Path, tmp_path: Path, capsys: Capture) -> None:
    write_drive(tmp_path, "other", make_drive(seed=2, windows=14))
    other = [f"{tmp_path}/other.aedat4", "--track", f"{tmp_path}/other.csv"]
    assert main(["train", *other, "-o", f"{tmp_path}/other.evp", "--scorer", "ncc"]) == 0
    capsys.readouterr()
    _, result, street, night = words(made)
    for named, told in (
        ([result, street, other[0]], "is a result of another drive than"),
        ([result, f"{tmp_path}/other.evp", night], "is a result of another map than"),
        ([street, street, night], "is a map"),
        (
            [result, street, night, "-o", f"{tmp_path}/film.avi"],
            "is no name of a film: let it end in",
        ),
        ([result, street, night, "--seconds", "0"], "--seconds is how long the film lasts"),
    ):
        assert main(["play", "-o", f"{tmp_path}/film.webp", *named]) == 2, named
        error = capsys.readouterr().err
        assert told in error
        assert len(error.splitlines()) == 1


def test_a_map_without_images_asks_for_its_drive(made: Path, tmp_path: Path, capsys: Capture) -> None:
    pytest.importorskip("torch", reason="a network is trained")
    day = [f"{made}/day.aedat4", "--track", f"{made}/day.csv"]
    assert main(["images", *day, "-o", f"{tmp_path}/day"]) == 0
    made_of = ["--scorer", "network", "--steps", "2", "--matcher", "best"]
    assert main(["train", f"{tmp_path}/day", "-o", f"{tmp_path}/net.evp", *made_of]) == 0
    night = [f"{tmp_path}/net.evp", f"{made}/night.aedat4"]
    out = ["-o", f"{tmp_path}/net.result"]
    assert main(["evaluate", *night, "--track", f"{made}/night.csv", *out]) == 0
    capsys.readouterr()
    assert main(["play", out[1], *night]) == 2
    assert "add --reference" in capsys.readouterr().err
    assert main(["play", out[1], *night, "--reference", f"{tmp_path}/day"]) == 0
