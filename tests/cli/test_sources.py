"""`evplace images` on data sets, videos and films; `convert` to a folder of images; `list` of one family."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from conftest import make_drive, write_drive
from evplace.cli import main
from evplace.imaging.recipe import Recipe
from evplace.imaging.traverse import Traverse
from made_sets import SAN_FRANCISCO, picture, write_gta, write_lens, write_own, write_robotcar, write_utm

Capture = pytest.CaptureFixture[str]
DATE = "2014-12-09-13-21-02"


def json_of(capsys: Capture, *arguments: object) -> Any:
    """What a command prints with --json."""
    capsys.readouterr()
    assert main([*map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def fault(capsys: Capture, *arguments: object) -> str:
    """The one line on standard error of a command that fails with code 2."""
    capsys.readouterr()
    assert main([*map(str, arguments)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1, lines
    return lines[0]


def write_video(path: Path, images: int = 12) -> Path:
    av = pytest.importorskip("av", reason="needs the extra 'video'")
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=60)
        stream.width, stream.height, stream.pix_fmt, stream.bit_rate = 64, 48, "yuv420p", 4_000_000
        for n in range(images):
            image = np.stack([picture(0.4 * n), picture(0), picture(0)], axis=-1)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode())
    return path


def recipe_of(traverse: Path) -> Recipe:
    recipe = Traverse.load(traverse).recipe
    assert recipe is not None
    return recipe


def test_a_drive_of_a_data_set(tmp_path: Path, capsys: Capture) -> None:
    write_robotcar(tmp_path / "oxford")
    out = tmp_path / "t"
    facts = json_of(capsys, "images", tmp_path / "oxford", "--drive", DATE, "-o", out)
    assert facts["shape"] == [90, 160]
    assert facts["with_position"] > 0
    assert recipe_of(out).kind == "events"
    assert recipe_of(out).windows.dt == "1/16"
    again = ("images", tmp_path / "oxford", "--overwrite", "-o", out)
    assert json_of(capsys, *again, "--kind", "frames", "--width", 40)["shape"] == [90, 40, 3]
    json_of(capsys, *again, "--dt", "1/30")
    assert recipe_of(out).windows.dt == "1/30"


def test_what_is_not_said_is_the_data_sets_own(tmp_path: Path, capsys: Capture) -> None:
    write_lens(tmp_path)
    out = ("images", tmp_path, "-o", tmp_path / "t", "--overwrite")
    assert json_of(capsys, *out)["shape"] == [7, 7]
    assert json_of(capsys, *out, "--width=14")["shape"] == [7, 14]
    toml = tmp_path / "s.toml"
    toml.write_text("[images]\nheight = 21\n")
    assert json_of(capsys, *out, "--settings", toml)["shape"] == [21, 7]
    toml.write_text('given = "width"\n')
    assert "unknown setting 'given'" in fault(capsys, *out, "--settings", toml)


def test_the_settings_that_are_shown_are_those_of_the_data_set(tmp_path: Path, capsys: Capture) -> None:
    write_robotcar(tmp_path)
    shown = json_of(capsys, "images", tmp_path, "--drive", DATE, "--height=30", "--show-settings")
    assert shown["windows.dt"] == {"value": "1/16", "from": "input"}
    assert shown["images.height"] == {"value": 30, "from": "flag"}
    assert json_of(capsys, "images", "--show-settings")["windows.dt"] == {"value": "1/30", "from": "default"}


def test_a_video_is_simulated_or_kept(tmp_path: Path, capsys: Capture) -> None:
    video, out = write_video(tmp_path / "film.mp4"), tmp_path / "t"
    assert json_of(capsys, "images", video, "-o", out)["shape"] == [90, 160]
    assert Traverse.load(out).info["simulated"]["seed"] == 0
    facts = json_of(capsys, "images", video, "-o", out, "--kind", "frames", "--overwrite")
    assert (facts["images"], facts["shape"]) == (12, [90, 160, 3])
    assert Traverse.load(out).info["timed"]


def test_a_query_is_made_as_its_map_was(tmp_path: Path, capsys: Capture) -> None:
    video = write_video(tmp_path / "film.mp4")
    for kind in ("events", "frames"):
        json_of(capsys, "images", video, "-o", tmp_path / kind, "--kind", kind)
        made = ("-o", tmp_path / f"{kind}.evp", "--scorer", "sad", "--run-length", 2)
        json_of(capsys, "train", tmp_path / kind, *made)
        query = ("evaluate", tmp_path / f"{kind}.evp", video, "--matcher", "best")
        assert json_of(capsys, *query, "-o", tmp_path / f"{kind}.result")["accuracy"] > 0.8


def test_a_folder_of_images_is_kept_or_simulated(tmp_path: Path, capsys: Capture) -> None:
    write_gta(tmp_path)
    folder = tmp_path / "day" / "images"
    (tmp_path / "day" / "6dpose_list.txt").unlink()
    out = ("images", "-o", tmp_path / "t", "--fps", 60, "--overwrite")
    assert json_of(capsys, *out, folder)["images"] == 6
    assert json_of(capsys, *out, folder.parent)["images"] == 6
    assert json_of(capsys, *out, folder, "--kind", "events")["shape"] == [90, 160]


def test_fast_films_are_remarked_upon(tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "film").mkdir()
    for n in range(8):
        Image.fromarray(picture(9 * n)).save(tmp_path / "film" / f"{n}.png")
    assert main(["images", f"{tmp_path}/film", "-o", f"{tmp_path}/t", "--kind", "events"]) == 0
    assert "pixel" in capsys.readouterr().err


def test_a_traverse_becomes_a_folder_of_images(tmp_path: Path, capsys: Capture) -> None:
    write_drive(tmp_path, "day", make_drive(windows=8))
    day, images = tmp_path / "day", tmp_path / "campus" / "database"
    json_of(capsys, "images", f"{day}.aedat4", "--track", f"{day}.csv", "-o", day)
    assert json_of(capsys, "convert", day, images) == {"images": 8, "without_position": 0}
    assert json_of(capsys, "images", images.parent, "-o", tmp_path / "back")["with_position"] == 8
    assert np.allclose(
        np.load(day / "track.npy")[:, 2:4], np.load(tmp_path / "back" / "track.npy")[:, 2:4], atol=0.01
    )
    assert "exists" in fault(capsys, "convert", day, images)


def test_the_list_of_one_family(capsys: Capture) -> None:
    parts = json_of(capsys, "list", "datasets")
    assert list(parts) == ["datasets"]
    assert "Needs DATE/stereo/centre/*.png" in parts["datasets"]["robotcar"]["about"]
    assert set(parts) < set(json_of(capsys, "list"))
    assert "colours" in fault(capsys, "list", "colours")


def test_faults_of_folders(tmp_path: Path, capsys: Capture) -> None:
    out = ("-o", tmp_path / "t")
    images = ("images", tmp_path / "set")
    assert "there is no folder" in fault(capsys, *images, "--drive", "day", *out)
    (tmp_path / "set").mkdir()
    assert "layout of no known data set" in fault(capsys, *images, "--drive", "day", *out)
    assert "none of the datasets" in fault(capsys, *images, "--dataset", "kitty", *out)
    write_gta(tmp_path / "set")
    assert "holds no drive 'dya': it holds day" in fault(capsys, *images, "--drive", "dya", *out)
    assert "leave out --size" in fault(capsys, *images, "--drive", "day", "--size", 4, 4, *out)
    write_own(tmp_path / "set", ("day",))
    assert "may be gta or own: say which with --dataset" in fault(capsys, *images, *out)
    assert "no camera images" in fault(
        capsys, *images, "--dataset", "own", "--drive", "day", "--kind", "frames", *out
    )
    write_lens(tmp_path / "lens")
    assert "are no film" in fault(capsys, "images", tmp_path / "lens", "--kind", "events", *out)
    write_utm(tmp_path / "utm", "queries", [SAN_FRANCISCO, "@nan@1.0"])
    assert "not a number" in fault(capsys, "images", tmp_path / "utm", *out)
    assert not (tmp_path / "t").exists()


def test_a_picture_beside_a_data_set_changes_nothing(tmp_path: Path, capsys: Capture) -> None:
    write_own(tmp_path, ("day",))
    Image.fromarray(picture(0)).save(tmp_path / "preview.png")
    (tmp_path / "notes.csv").mkdir()
    assert json_of(capsys, "images", tmp_path, "-o", tmp_path / "t")["with_position"] > 0


def test_a_folder_of_named_positions_keeps_them(tmp_path: Path, capsys: Capture) -> None:
    folder = write_utm(tmp_path, "database", [SAN_FRANCISCO])
    assert json_of(capsys, "images", folder, "-o", tmp_path / "t")["with_position"] == 1


def test_a_film_that_breaks_off_keeps_its_good_part(tmp_path: Path, capsys: Capture) -> None:
    film = tmp_path / "film"
    film.mkdir()
    for n in range(6):
        Image.fromarray(picture(0.5 * n)).save(film / f"{n}.png")
    content = (film / "4.png").read_bytes()
    (film / "4.png").write_bytes(content[: len(content) // 2])
    for command in (["images"], ["images", "--kind", "events"], ["simulate"]):
        out = tmp_path / ("made.npz" if command == ["simulate"] else "made")
        again = ["--overwrite"] if out.exists() else []
        capsys.readouterr()
        assert main([*command, str(film), "-o", str(out), *again, "--json"]) == 3
        printed = capsys.readouterr()
        assert "4.png" in json.loads(printed.out)["fault"]
        assert len(printed.err.splitlines()) == 1
    assert json_of(capsys, "info", tmp_path / "made.npz")["events"] > 0


def test_flags_without_a_meaning_are_refused(tmp_path: Path, capsys: Capture) -> None:
    own, frames = tmp_path / "own", tmp_path / "frames"
    write_own(own, ("day",))
    frames.mkdir()
    Image.fromarray(picture(0)).save(frames / "0.png")
    video, npz = write_video(tmp_path / "v.mp4"), own / "day.npz"
    for source, flags, wanted in (
        (own, ("--size", 3, 3, "--time-unit", "ns"), "leave out --size and --time-unit"),
        (npz, ("--fps", 5, "--list", "nope.csv"), "leave out --list and --fps"),
        (npz, ("--tone", "edges"), "--tone means nothing for the events"),
        (video, ("--size", 10, 10), "leave out --size"),
        (frames, ("--dt", "1/60", "--representation", "count"), "--dt and --representation mean nothing"),
        (frames, ("--size", 10, 10), "leave out --size"),
    ):
        assert wanted in fault(capsys, "images", source, *flags, "-o", tmp_path / "t")
    (frames / "timestamps.txt").write_text("1.5\n")
    assert "leave out --fps" in fault(capsys, "images", frames, "--fps", 9, "-o", tmp_path / "t")


def test_an_unknown_video_is_told_which_are_known(tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "film.wmv").write_bytes(b"\x30\x26\xb2\x75" * 99)
    assert "videos are .mp4, " in fault(capsys, "images", tmp_path / "film.wmv", "-o", tmp_path / "t")


def test_a_drive_of_another_time_does_not_overlap(tmp_path: Path, capsys: Capture) -> None:
    write_own(tmp_path, ("day",))
    log = tmp_path / "day.csv"
    log.write_text(log.read_text().replace("\n17", "\n16"))
    assert "do not overlap" in fault(capsys, "images", tmp_path, "-o", tmp_path / "t")
