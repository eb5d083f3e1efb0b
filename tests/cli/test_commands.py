"""Each command as a person types it, on small made drives."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from conftest import make_drive, write_drive
from evplace.cli import commands, main
from evplace.imaging.traverse import Traverse

Capture = pytest.CaptureFixture[str]


def json_of(capsys: Capture, *arguments: object) -> Any:
    """What a command prints with --json."""
    capsys.readouterr()
    assert main([*map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_info(files: Path, capsys: Capture) -> None:
    facts = json_of(capsys, "info", files / "day.aedat4")
    assert {"format", "width", "height", "events", "t_first_us", "t_last_us", "dropped"} <= set(facts)
    assert (facts["format"], facts["width"], facts["height"]) == ("aedat4", 80, 60)
    assert facts["events"] == len(make_drive().events)
    assert not any(facts["dropped"].values())
    main(["info", str(files / "day.aedat4")])
    assert "80 x 60" in capsys.readouterr().out


def test_images(files: Path, tmp_path: Path, capsys: Capture) -> None:
    sheet = tmp_path / "sheet.png"
    out = ("images", files / "day.aedat4", "-o", tmp_path / "day", "--track", files / "day.csv")
    facts = json_of(capsys, *out, "--sheet", sheet)
    assert facts["images"] == 60
    assert facts["with_position"] == 60
    assert sheet.read_bytes().startswith(b"\x89PNG")
    facts = json_of(capsys, *out, "--overwrite", "--dt", "1/15", "--width", "40")
    assert (facts["images"], facts["shape"]) == (30, [90, 40])


def test_settings_come_from_a_file_and_flags_win(files: Path, tmp_path: Path, capsys: Capture) -> None:
    toml = tmp_path / "settings.toml"
    toml.write_text('[windows]\ndt = "1/15"\n[images]\nwidth = 40\nblur = false\n')
    out = ("images", files / "day.aedat4", "-o", tmp_path / "day", "--settings", toml)
    assert json_of(capsys, *out)["shape"] == [90, 40]
    assert json_of(capsys, *out, "--overwrite", "--width", "50")["shape"] == [90, 50]
    recipe = Traverse.load(tmp_path / "day").recipe
    assert recipe is not None
    assert (recipe.windows.dt, recipe.images.blur) == ("1/15", False)


def test_train_localize_evaluate_compare(files: Path, street: Path, tmp_path: Path, capsys: Capture) -> None:
    csv = tmp_path / "night.csv"
    assert main(["localize", str(street), f"{files}/night.aedat4", "--matcher", "best", "-o", str(csv)]) == 0
    lines = csv.read_text().splitlines()
    assert lines[0] == (
        "t_us,place,easting,northing,score,state,latitude,longitude,heading_deg,probability,uncertainty_m,"
        "compared"
    )
    assert abs(float(lines[1].split(",")[6])) < 90
    assert len(lines) == 61
    capsys.readouterr()
    assert main(["localize", str(street), f"{files}/night.aedat4", "--matcher", "best", "--json"]) == 0
    matches = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [match["place"] for match in matches] == [int(line.split(",")[1]) for line in lines[1:]]
    query = ("evaluate", street, files / "night.aedat4", "--track", files / "night.csv")
    figures = json_of(capsys, *query, "-o", tmp_path / "a.result", "--matcher", "best")
    assert figures["accuracy"] > 0.95
    json_of(capsys, *query, "-o", tmp_path / "b.result", "--matcher", "hmm", "--rule", "view")
    rows = json_of(capsys, "compare", tmp_path / "a.result", tmp_path / "b.result")["results"]
    assert [row["result"] for row in rows] == ["a.result", "b.result"]
    assert rows[0]["matcher.name"] == "best"
    assert main(["compare", f"{tmp_path}/a.result", f"{tmp_path}/b.result"]) == 0


def test_matches_that_lie_aside_are_told(
    files: Path, street: Path, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evplace.cli.evaluate.aside", lambda result: f"{len(result.t_us)} lie aside")
    query = ("evaluate", street, files / "night.aedat4", "--track", files / "night.csv", "--matcher", "best")
    assert main([*map(str, query), "-o", f"{tmp_path}/a.result"]) == 0
    assert "evplace: 60 lie aside\n" in capsys.readouterr().err


def test_a_traverse_is_answered_as_its_recording_is(
    files: Path, street: Path, tmp_path: Path, capsys: Capture
) -> None:
    main(["images", f"{files}/night.aedat4", "-o", f"{tmp_path}/night"])
    capsys.readouterr()
    answers = []
    for drive in (files / "night.aedat4", tmp_path / "night"):
        assert main(["localize", str(street), str(drive), "--matcher", "best"]) == 0
        answers.append(capsys.readouterr().out)
    assert answers[0] == answers[1]


def test_the_network_from_the_command_line(files: Path, tmp_path: Path, capsys: Capture) -> None:
    pytest.importorskip("torch", reason="the network needs the extra 'train'")
    out = ("train", files / "day.aedat4", "--track", files / "day.csv", "-o", tmp_path / "net.evp")
    facts = json_of(capsys, *out, "--preset", "paper", "--steps", 3, "--batch", 8)
    assert (facts["scorer"], facts["items"]) == ("network", facts["places"])
    train = json.loads((tmp_path / "net.evp" / "map.json").read_text())["scorer"]["settings"]
    assert (train["last_relu"], train["steps"]) == (True, 3)


def test_without_positions_and_by_frames(files: Path, tmp_path: Path, capsys: Capture) -> None:
    out = ("train", files / "day.aedat4", "-o", tmp_path / "runs.evp", "--scorer", "sad")
    assert json_of(capsys, *out, "--run-length", 10)["places"] == 6
    query = ("evaluate", tmp_path / "runs.evp", files / "night.aedat4", "--matcher", "best")
    assert json_of(capsys, *query, "-o", tmp_path / "a", "--frames", 2)["accuracy"] > 0.9
    for flags, words in (
        (("--frames", -3), "not -3"),
        (("--frames", 2, "--truth", "t.npy"), "give one of them"),
    ):
        capsys.readouterr()
        assert main([*map(str, (*query, "-o", tmp_path / "b", *flags))]) == 2
        assert words in capsys.readouterr().err
    assert json_of(capsys, *query, "-o", tmp_path / "b")["accuracy"] > 0.9
    np.save(tmp_path / "truth.npy", np.eye(60))
    with_truth = (*query, "-o", tmp_path / "c", "--overwrite", "--truth", tmp_path / "truth.npy")
    assert json_of(capsys, *with_truth)["recall@1"] > 0.5
    main([*map(str, with_truth)])
    assert "rows of" in capsys.readouterr().err.splitlines()[0]
    np.save(tmp_path / "truth.npy", np.eye(60, k=3))
    turned = json_of(capsys, *with_truth, "--layout", "reference-query")
    assert capsys.readouterr().err == ""
    np.save(tmp_path / "truth.npy", np.eye(60, k=-3))
    straight = json_of(capsys, *with_truth, "--layout", "query-reference")
    assert {**turned, "took_s": 0} == {**straight, "took_s": 0}
    assert main([*map(str, (*query, "-o", tmp_path / "d", "--layout", "reference-query"))]) == 2
    assert "--layout says what the rows of --truth are" in capsys.readouterr().err


def test_convert_and_simulate_and_list(files: Path, tmp_path: Path, capsys: Capture) -> None:
    assert json_of(capsys, "convert", files / "day.aedat4", tmp_path / "day.npz")["events"] > 0
    assert json_of(capsys, "info", tmp_path / "day.npz")["format"] == "npz"
    main(["images", f"{files}/day.aedat4", "-o", f"{tmp_path}/t"])
    from PIL import Image

    (tmp_path / "film").mkdir()
    for number, image in enumerate(np.load(tmp_path / "t" / "images.npy")[:4]):
        Image.fromarray(image).save(tmp_path / "film" / f"{number}.png")
    assert json_of(capsys, "simulate", tmp_path / "film", "-o", tmp_path / "film.npz")["events"] > 0
    assert "seqslam" in json_of(capsys, "list")["matchers"]


@pytest.mark.parametrize("command", sorted(commands()))
def test_help_shows_examples(command: str, capsys: Capture) -> None:
    with pytest.raises(SystemExit) as stop:
        main([command, "--help"])
    assert not stop.value.code
    assert "Examples:" in capsys.readouterr().out


def test_the_overview_is_light_and_complete() -> None:
    code = (
        "import sys; from evplace.cli import main; main(['--help']);"
        "print([name for name in ('numba', 'tyro', 'numpy', 'torch') if name in sys.modules])"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert answer.splitlines()[-1] == "[]"
    assert all(f"  {command} " in answer for command in commands())


def test_version_and_module(capsys: Capture) -> None:
    assert main(["--version"]) == 0
    run = subprocess.run([sys.executable, "-m", "evplace", "--version"], capture_output=True, text=True)
    assert run.stdout == capsys.readouterr().out


def test_a_folder_of_images_with_a_list(tmp_path: Path, capsys: Capture) -> None:
    from PIL import Image

    (tmp_path / "film").mkdir()
    for number in range(4):
        Image.fromarray(np.full((12, 16), number, np.uint8)).save(tmp_path / "film" / f"{number}.png")
    (tmp_path / "list.csv").write_text("name,index\n2.png,0\n0.png,1\n")
    command = ("images", tmp_path / "film", "-o", tmp_path / "t", "--list", tmp_path / "list.csv")
    assert json_of(capsys, *command, "--fps", 10)["images"] == 2
    assert np.load(tmp_path / "t" / "images.npy")[:, 0, 0].tolist() == [2, 0]
    assert np.load(tmp_path / "t" / "t_us.npy").tolist() == [0, 100_000]


def test_a_settings_file_may_say_a_default(tmp_path: Path, capsys: Capture) -> None:
    write_drive(tmp_path, "day", make_drive(windows=4))
    toml = tmp_path / "s.toml"
    command = ("images", tmp_path / "day.aedat4", "--settings", toml, "-o")
    for number, blur in enumerate((True, False)):
        toml.write_text(f"json = false\n[images]\nblur = {str(blur).lower()}\n[cleaning]\nmask_hot = false\n")
        json_of(capsys, *command, tmp_path / f"{number}")
        recipe = Traverse.load(tmp_path / f"{number}").recipe
        assert recipe is not None
        assert recipe.images.blur is blur


def test_a_track_that_needs_settings(tmp_path: Path, capsys: Capture) -> None:
    write_drive(tmp_path, "day", make_drive(windows=20))
    lines = (tmp_path / "day.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines[1:]]
    odd = [f"{(int(t_us) - 5_000_000) / 1e6},{lat},{lon}" for t_us, lat, lon in rows]
    (tmp_path / "odd.csv").write_text("\n".join(["when,latitude,longitude", *odd]))
    command = ("images", tmp_path / "day.aedat4", "-o")
    plain = json_of(capsys, *command, tmp_path / "plain", "--track", tmp_path / "day.csv")
    flags = ("--track-preset", "robotcar", "--track-set", "time=when", "--track-set", "time_unit=s")
    shifted = ("--track", tmp_path / "odd.csv", *flags, "--track-offset", 5)
    assert json_of(capsys, *command, tmp_path / "odd", *shifted) == plain
    tracks = [np.load(tmp_path / name / "track.npy") for name in ("plain", "odd")]
    np.testing.assert_allclose(*tracks)


@pytest.fixture(scope="module")
def avenue(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map of 240 m by the default, and the drives of it."""
    folder = tmp_path_factory.mktemp("avenue")
    write_drive(folder, "day", make_drive(windows=120))
    write_drive(folder, "night", make_drive(seed=1, windows=120, noise=0.02))
    day = ["train", f"{folder}/day.aedat4", "--track", f"{folder}/day.csv", "-o", f"{folder}/avenue.evp"]
    assert main(day) == 0
    return folder


def test_the_default_finds_the_night_and_says_how_sure_it_is(avenue: Path, capsys: Capture) -> None:
    assert main(["localize", f"{avenue}/avenue.evp", f"{avenue}/night.aedat4", "--json"]) == 0
    matches = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert len(matches) == 120
    assert sum(match["state"] == "localised" for match in matches) > 60
    assert all(0 <= match["probability"] <= 1 for match in matches)
    late = ["localize", f"{avenue}/avenue.evp", f"{avenue}/night.aedat4", "--lag-s", "1", "--json"]
    assert main(late) == 0
    assert len(capsys.readouterr().out.splitlines()) == 120


def test_more_false_accepts_may_be_allowed(avenue: Path, tmp_path: Path, capsys: Capture) -> None:
    query = ("evaluate", avenue / "avenue.evp", avenue / "night.aedat4", "--track", avenue / "night.csv")
    strict = json_of(capsys, *query, "-o", tmp_path / "a", "--false-accept", 0.001)
    loose = json_of(capsys, *query, "-o", tmp_path / "b", "--false-accept", 0.5)
    assert strict["accuracy"] <= loose["accuracy"]
    assert loose["within_20_m"] > 0.9
    assert (tmp_path / "b" / "reliability.png").read_bytes().startswith(b"\x89PNG")
    assert main([*map(str, query), "-o", f"{tmp_path}/c", "--matcher", "best", "--false-accept", "0.1"]) == 2
    assert "false_accept" in capsys.readouterr().err


def test_calibrate_measures_a_map_anew(avenue: Path, street: Path, tmp_path: Path, capsys: Capture) -> None:
    shutil.copytree(avenue / "avenue.evp", tmp_path / "map")
    facts = json_of(capsys, "calibrate", tmp_path / "map")
    assert facts["matcher"] == "bayes"
    assert 0 < facts["threshold_live"] < 1
    shutil.copytree(street, tmp_path / "short")
    assert main(["calibrate", f"{tmp_path}/short"]) == 0
    assert "could not be measured on itself" in capsys.readouterr().err


def test_that_nothing_was_accepted_is_said(avenue: Path, tmp_path: Path, capsys: Capture) -> None:
    query = ["localize", f"{avenue}/avenue.evp", f"{avenue}/night.aedat4"]
    assert main([*query, "--set", "threshold=1.0"]) == 0
    told = capsys.readouterr().err
    assert "none of the 120 matches was accepted" in told
    assert "--matcher best" in told
