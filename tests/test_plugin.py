"""Parts of another package, from the outside: installed, by the command line, in Python, and taken away."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from conftest import Drive, make_drive

PLUGIN = Path(__file__).parents[1] / "examples" / "plugin"
PARTS = {
    "matchers": "majority",
    "scorers": "thumbnail",
    "representations": "repeated",
    "readers": "diary",
}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that the example package is installed in, for those who ask for it."""
    pytest.importorskip("setuptools", minversion="77", reason="the example package is built by setuptools")
    folder = tmp_path_factory.mktemp("site")
    how = ["--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--disable-pip-version-check"]
    source = folder / "source"  # a build leaves things in its folder
    subprocess.run(["cp", "-r", str(PLUGIN), str(source)], check=True)
    command = [sys.executable, "-m", "pip", "install", *how, "--target", str(folder / "site"), str(source)]
    answer = subprocess.run(command, capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr
    return folder / "site"


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """day.diary and night.diary, with their logs."""
    folder = tmp_path_factory.mktemp("files")
    for name, drive in (("day", make_drive()), ("night", make_drive(seed=1, noise=0.02))):
        write_diary(folder / f"{name}.diary", drive)
        rows = ["timestamp,latitude,longitude"]
        for t_us, easting in zip(drive.track.t_us, drive.track.easting, strict=True):
            rows.append(f"{t_us},48.0,{11 + (easting - 500_000) / 74_600}")
        (folder / f"{name}.csv").write_text("\n".join(rows) + "\n")
    return folder


def write_diary(path: Path, drive: Drive) -> None:
    events = drive.events
    lines = [f"event diary {events.size[0]}x{events.size[1]}\n"]
    for t_us, x, y, p in zip(events.t_us, events.x, events.y, events.p, strict=True):
        lines.append(f"at {t_us} us, {x} {y} {'brighter' if p else 'darker'}\n")
    path.write_text("".join(lines))


def called(site: Path | None, *words: object) -> subprocess.CompletedProcess[str]:
    """A command of evplace, or of Python, where the example is installed in `site`, or nowhere."""
    found = [str(site)] if site is not None else []
    path = os.pathsep.join([*found, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))])
    command = [
        sys.executable,
        *(map(str, words) if words[0] == "-c" else ("-m", "evplace", *map(str, words))),
    ]
    return subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path})


def ran(site: Path | None, *words: object) -> str:
    answer = called(site, *words)
    assert answer.returncode == 0, answer.stderr
    return answer.stdout


def said(site: Path | None, *words: object) -> Any:
    return json.loads(ran(site, *words, "--json"))


def refused(site: Path | None, *words: object) -> str:
    """The one line that a command says why it cannot."""
    answer = called(site, *words)
    assert (answer.returncode, answer.stderr.count("\n")) == (2, 1), answer.stderr
    return answer.stderr


@pytest.fixture(scope="module")
def street(site: Path, files: Path) -> Path:
    """A map by its reader and its descriptor."""
    command = ("train", files / "day.diary", "--track", files / "day.csv", "-o", files / "street.evp")
    how = ("--scorer", "thumbnail", "--set", "width=20")
    assert said(site, *command, *how)["scorer"] == "thumbnail"
    return files / "street.evp"


def test_the_list_says_where_they_come_from(site: Path) -> None:
    found = said(site, "list")
    for family, name in PARTS.items():
        one = found[family][name]
        assert (one["package"], one["fault"]) == ("evplace-example", None)
    assert "best items of the last queries" in found["matchers"]["majority"]["about"]
    assert "(from evplace-example)" in ran(site, "list", "readers")
    assert not set(PARTS.values()) & {name for parts in said(None, "list").values() for name in parts}


def test_a_drive_is_read_and_examined(site: Path, files: Path) -> None:
    facts = said(site, "info", files / "day.diary")
    assert (facts["format"], facts["events"]) == ("diary", len(make_drive().events))
    assert said(site, "doctor", files / "day.diary", "--track", files / "day.csv")["facts"]
    assert "is of no known recording format" in refused(None, "info", files / "day.diary")


def test_a_map_is_trained_and_a_drive_is_found(site: Path, files: Path, street: Path, tmp_path: Path) -> None:
    about = json.loads((street / "map.json").read_text())
    assert about["scorer"] == {
        "name": "thumbnail",
        "package": "evplace_example",
        "settings": {"width": 20, "height": 9},
    }
    query = (street, files / "night.diary")
    lines = ran(site, "localize", *query, "--matcher", "majority", "--set", "n=3").splitlines()
    assert sum("localised" in line for line in lines) > 50
    out = tmp_path / "night.result"
    flags = ("--track", files / "night.csv", "-o", out, "--matcher", "majority", "--preset", "strict")
    figures = said(site, "evaluate", *query, *flags)
    assert figures["precision"] > 0.9
    settings = json.loads((out / "result.json").read_text())["settings"]
    assert settings["matcher"] == {"name": "majority", "n": 9, "near": 9, "share": 0.8}
    pytest.importorskip("matplotlib", reason="plots need the extra 'report'")
    assert Path(said(site, "report", out)["page"]).exists()


def test_scores_are_matched(site: Path, tmp_path: Path) -> None:
    scores = np.random.default_rng(0).uniform(0, 0.5, (30, 20)).astype(np.float32)
    scores[np.arange(20), np.arange(20)] = 1
    np.save(tmp_path / "scores.npy", scores)
    command = ("match", tmp_path / "scores.npy", "-o", tmp_path / "matches.csv", "--matcher", "majority")
    assert said(site, *command)["accepted"] >= 15
    assert "known are n, near, share" in refused(site, *command, "--set", "votes=3", "--overwrite")


def test_a_recipe_reproduces_with_them(site: Path, tmp_path: Path) -> None:
    """A case of a table, answered by the worker that answers all of them."""
    code = f"""
import json
from pathlib import Path
from evplace.core.workers import Here, run_all
from evplace_lab.city import CitySettings, generate
from evplace_lab.reproduction._cases import Case, Method
from evplace_lab.reproduction._panels import Panels
from evplace_lab.reproduction._recipes import inputs
from evplace_lab.reproduction._runs import Runs

folder = Path({str(tmp_path)!r})
generate(folder / "city", CitySettings(fps=10, route_length_m=60.0), workers=1)
method = Method("thumbnail", "majority", "strict", {{"n": 3}}, {{"width": 20}})
case = Case.of("day-1", "night-1", inputs()["events"], method)
drives = Panels(folder / "city", folder)
drives.prepare([case], Here(1))
runs = Runs(folder, drives.source)
job = {{"kind": "Panels", "drives": drives.to_dict(), "out": str(folder), "groups": [[case.to_dict()]]}}
run_all("evplace_lab.reproduction._worker", [job], Here(1), folder, lambda _, line: None)
print(json.dumps([case.to_dict(), runs.found(case)]))
"""
    case, found = json.loads(ran(site, "-c", code))
    assert (case["scorer"], case["scorer_settings"]) == ("thumbnail", {"width": 20, "height": 9})
    assert case["matcher_settings"] == {"n": 3, "near": 9, "share": 0.8}
    assert 0 <= found["live"]["places"]["figures"]["accuracy"] <= 1


def test_the_same_objects_need_no_installation(street: Path) -> None:
    """Handed over in Python, by an object; a map is opened with the object too."""
    code = f"""
import sys; sys.path.insert(0, {str(PLUGIN / "src")!r})
import evplace as ev
from evplace.core import families
from evplace_example.descriptor import Thumbnail
from evplace_example.matcher import Majority

assert "majority" not in families.names("matchers")
street = ev.PlaceMap.load({str(street)!r}, Thumbnail(width=20))
print(ev.Localizer(street, Majority(n=3)).settings)
rows = ev.Localizer(street, Majority()).rows(street.references)
assert (rows.argmax(axis=1) == range(len(rows))).all()
"""
    assert ran(None, "-c", code).strip() == "{'name': 'Majority', 'n': 3, 'near': 3, 'share': 0.5}"


def test_a_map_of_a_part_that_is_gone_is_one_line(
    site: Path, files: Path, street: Path, tmp_path: Path
) -> None:
    told = refused(None, "localize", street, files / "day.csv")
    assert "wants the scorer 'thumbnail' of the package 'evplace_example', which is not installed" in told
    how = ("--run-length", 10, "--scorer", "ncc", "--representation", "repeated")
    ran(site, "train", files / "day.diary", *how, "-o", tmp_path / "street.evp")
    told = refused(None, "localize", tmp_path / "street.evp", files / "day.csv")
    assert "the setting 'representation' cannot be 'repeated': known are binary" in told


def test_what_it_is_tested_with_itself(site: Path, tmp_path: Path) -> None:
    code = f"import pytest, sys; sys.exit(pytest.main(['-q', '-p', 'no:cacheprovider', {str(PLUGIN)!r}]))"
    assert "4 passed" in ran(site, "-c", code)
