"""The recipes in small: a street of 60 m in place of the benchmark, a moment's training."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evplace.cli import main
from evplace.core.errors import InputError, OutputError, SettingsError
from evplace.core.settings import to_dict
from evplace.imaging.traverse import Traverse
from evplace.scorers.network import Network
from evplace_lab.city import CitySettings, generate
from evplace_lab.reproduction import Choice, ablations, figure5, real, reproduce, table2
from evplace_lab.reproduction._cases import Case
from evplace_lab.reproduction._cities import Cities
from evplace_lab.reproduction._real_sets import RealSet
from evplace_lab.reproduction._recipes import inputs, methods, read_methods, recipes

pytest.importorskip("torch", reason="the network needs the extra 'train'")

SMALL = CitySettings(fps=10, route_length_m=60.0)
TRAINING = {"steps": 4, "batch": 8}
SOME = Choice(seeds=2, train=TRAINING, inputs=("events", "colour, augmented", "colour, both"))


@pytest.fixture(scope="module")
def city(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("benchmark") / "city"
    generate(folder, SMALL, workers=1)
    return folder


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("reproduced")


@pytest.fixture(scope="module")
def table(city: Path, out: Path) -> dict[str, Any]:
    return reproduce("table2", out, city, choice=SOME, workers=1)


def test_table_2_has_every_cell_by_both_rules(table: dict[str, Any], out: Path) -> None:
    rows = table["rows"]
    all_ways = methods().values()
    of_colour = sum(method.for_camera for method in all_ways)
    trained_of_colour = sum(method.for_camera and method.scorer == "network" for method in all_ways)
    live = [row for row in rows if row["answers"] == "live"]
    assert len(live) == 5 * (len(all_ways) + of_colour + trained_of_colour) * 2  # augmenting is for training
    assert {row["input"] for row in rows if row["matcher"] == "network, tuned"} == {"events"}
    late = {row["matcher"] for row in rows if row["answers"] == "hindsight"}
    assert late
    assert not late & {"global-max", "Algorithm 1", "raw correlation", "blurred correlation"}
    assert json.loads((out / "table2.json").read_text()) == table
    trained = [row for row in rows if row["trained"]]
    assert {row["seeds"] for row in trained} == {2}
    assert all(row["spread"] is not None and len(row["values"]) == 2 for row in trained)
    assert {row["spread"] for row in rows if not row["trained"]} == {None}
    assert all(0 <= row["mean"] <= 100 and 0 <= row["chance"] <= 100 for row in rows)


def test_results_of_other_settings_are_not_taken_for_ours(
    table: dict[str, Any], city: Path, out: Path
) -> None:
    """The kept results go by names; what they hold goes by the settings."""
    kept = out / "results" / "night-1, events, global-max" / "result.json"
    before = json.loads(kept.read_text())["settings"]["key"]
    quick = Choice(1, {**TRAINING, "steps": 2}, ("events",))
    reproduce("table2", out, city, choice=quick, workers=1)
    assert json.loads(kept.read_text())["settings"]["key"] != before
    assert reproduce("table2", out, city, choice=SOME, workers=1)["rows"] == table["rows"]
    assert json.loads(kept.read_text())["settings"]["key"] == before


def test_the_papers_numbers_stand_beside_ours(table: dict[str, Any]) -> None:
    printed = {
        (row["query"], row["matcher"]): row["paper"]
        for row in table["rows"]
        if row["input"] == "events" and row["rule"] == "places" and row["paper"] is not None
    }
    assert printed["night-1", "global-max"] == 85.80
    assert printed["rain-2", "graph, alpha 0.1"] == 37.91
    assert len(printed) == 25
    assert all(row["paper"] is None for row in table["rows"] if row["rule"] == "view")


def test_results_of_the_first_seed_are_kept_whole(table: dict[str, Any], out: Path) -> None:
    assert table
    kept = {folder.name for folder in (out / "results").iterdir()}
    assert "night-1, events, Algorithm 1" in kept
    assert len(kept) == 5 * len(table2.KEPT_METHODS)


def test_tables_are_printed(table: dict[str, Any]) -> None:
    made = list(table2.tables(table))
    assert len(made) == 6
    assert all(len(row) == len(one.columns) for one in made for row in one.rows)
    assert "93.2" in next(row[-1] for row in made[0].rows if row[:2] == ["night-1", "Algorithm 1"])


def test_nothing_is_run_twice_and_other_settings_are(
    table: dict[str, Any], city: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {file: file.stat().st_mtime_ns for file in (out / "runs").iterdir()}
    flags = ["reproduce", "table2", "--city", str(city), "-o", str(out), "--seeds", "2", "--json"]
    flags += ["--set", "steps=4", "--set", "batch=8", "--inputs", *SOME.inputs]
    assert main(flags) == 0
    assert json.loads(capsys.readouterr().out)["rows"] == table["rows"]
    assert {file: file.stat().st_mtime_ns for file in (out / "runs").iterdir()} == before
    (out / "runs" / sorted(before)[0].name).unlink()
    shutil.rmtree(out / "results" / "night-1, events, global-max")
    again = reproduce("table2", out, city, choice=SOME)
    assert again["rows"] == table["rows"]  # what was lost is made again, and comes out the same
    case = trained(table2.cases(Cities(city, out), SOME))
    longer = trained(table2.cases(Cities(city, out), Choice(1, {**TRAINING, "steps": 5}, SOME.inputs)))
    settings = Cities(city, out).settings
    assert case.key(settings) != longer.key(settings)
    assert case.key(settings) != case.key({**settings, "seed": 1})


def trained(cases: list[Case]) -> Case:
    """The first that needs a training."""
    return next(case for case in cases if case.train is not None)


def test_methods_of_ones_own_stand_beside_the_others(
    table: dict[str, Any], city: Path, out: Path, tmp_path: Path
) -> None:
    file = tmp_path / "own.toml"
    file.write_text(
        '[mine]\nscorer = "sad"\nmatcher = "best"\n["mine, later"]\nscorer = "sad"\nmatcher = "hmm"\n'
    )
    own = read_methods(file)
    made = reproduce("table2", out, city, choice=replace(SOME, methods=own), workers=1)
    rows = [row for row in made["rows"] if row["matcher"] not in own]
    assert rows == table["rows"]
    mine = [row for row in made["rows"] if row["matcher"] == "mine"]
    assert {row["input"] for row in mine} == {"events", "colour, both"}
    assert made["settings"]["methods"]["mine"]["scorer"] == "sad"
    assert (out / "results" / "night-1, events, mine" / "result.json").exists()
    figure = reproduce("figure5", out, city, choice=Choice(1, TRAINING, ("events",), own), workers=1)
    assert {curve["panel"] for curve in figure["curves"] if curve["matcher"] == "mine"} == {
        "day-night",
        "day-rain",
    }
    with pytest.raises(SettingsError, match="the method 'global-max' is the recipes' own"):
        reproduce("table2", out, city, choice=Choice(methods={"global-max": own["mine"]}))
    with pytest.raises(SettingsError, match="no others can stand in it"):
        reproduce("ablations", out, city, choice=Choice(methods=own))
    for text, words in (
        ("a = 3", "'a' is no method"),
        ("[a]\nscorer = 'sad'", "the method 'a' in .*matcher"),
        ("[a]\nscorers = 'sad'", "the method 'a' in .*did you mean 'scorer'"),
    ):
        file.write_text(text)
        with pytest.raises(SettingsError, match=words):
            read_methods(file)


def test_a_network_is_trained_as_the_paper_says_or_by_the_methods_preset_and_settings() -> None:
    def training(name: str, train: dict[str, Any], **changed: Any) -> dict[str, Any]:
        case = Case.of("day-1", "night-1", inputs()[name], replace(methods()["global-max"], **changed), train)
        assert case.train is not None
        assert replace(case, train=None).scorer_settings == {}
        return case.train

    printed, tuned = (to_dict(Network.presets[name]) for name in ("paper", "tuned"))
    assert training("events", {}) == printed
    assert training("events", {}, scorer_preset="tuned") == tuned
    assert training("events", {}, scorer_settings={"steps": 3, "batch": 5}) == printed | {
        "steps": 3,
        "batch": 5,
    }
    assert training("events", {"steps": 4}, scorer_settings={"steps": 3}) == printed | {"steps": 4}
    assert training("colour, augmented", {}) == printed | {"augment": "light"}
    with pytest.raises(SettingsError, match="no preset 'best'"):
        training("events", {}, scorer_preset="best")


def test_figure_5_has_a_curve_for_each_method(table: dict[str, Any], city: Path, out: Path) -> None:
    maps = {file: file.stat().st_mtime_ns for file in (out / "maps").iterdir()}
    figure = reproduce("figure5", out, city, choice=Choice(2, TRAINING, ("events",)), workers=1)
    assert [one["panel"] for one in figure["lacking"]] == ["Oxford RobotCar", "campus"]
    assert {file: file.stat().st_mtime_ns for file in (out / "maps").iterdir()} == maps
    assert [c["panel"] for c in figure["curves"] if c["answers"] == "live"].count("day-night") == 7
    for curve in figure["curves"]:
        points = np.array(curve["points"]).reshape(-1, 3)
        assert (np.diff(points[:, 1]) >= 0).all()
        assert 0 <= curve["average_precision"] <= 1
        assert (curve["seeds"], curve["spread"] is None) in {(1, True), (2, False)}
    assert figure["paper"][0]["points"][0] == [0.43, 1.0]


def test_ablations_compare_with_the_same_seeds(city: Path, out: Path) -> None:
    table = reproduce("ablations", out, city, choice=Choice(2, {**TRAINING, "batch": 64}), workers=1)
    rows = table["rows"]
    assert {row["verdict"] for row in rows} <= {"better", "worse", "no effect seen"}
    assert [abs(row["effect"]) for row in rows] == sorted((abs(row["effect"]) for row in rows), reverse=True)
    for row in rows:
        assert row["effect"] == pytest.approx(row["mean"] - row["before"])
        seen = abs(row["effect"]) > max(row["spread"], row["before_spread"])
        assert seen == (row["verdict"] != "no effect seen")


def test_images_made_anew_from_events_are_the_drives_own(city: Path, out: Path) -> None:
    """With the benchmark's own settings, what ablations compare is what the benchmark has."""
    case = Case.of("day-1", "night-1", inputs()["events"], methods()["global-max"])
    again = Case.from_dict({**case.to_dict(), "images": {"blur": True}})
    cities = Cities(city, out)
    cities.prepare([again], workers=2)
    for drive in ("day-1", "night-1"):
        made, given = cities.opened(drive, again), Traverse.load(city / drive / "ideal")
        np.testing.assert_array_equal(made.images, given.images)
        np.testing.assert_array_equal(made.counts, given.counts)
        np.testing.assert_array_equal(made.xy, given.xy)


@pytest.fixture
def shorter(data: Path, tmp_path: Path) -> Path:
    """The real sets, of the longest one the first images alone."""
    folder = tmp_path / "data" / "traverses"
    folder.mkdir(parents=True)
    (folder / "lens").symlink_to(data.resolve() / "traverses" / "lens")
    with np.load(data / "traverses" / "nordland_64x32.npz") as film:
        np.savez(folder / "nordland_64x32.npz", **{season: film[season][:600] for season in film.files})
    return folder.parent


def test_real_sets_are_judged_by_their_own_truth(shorter: Path, out: Path) -> None:
    table = reproduce("real", out, data=shorter, choice=Choice(1, TRAINING), workers=1)
    found = {(row["query"], row["matcher"], row["rule"]): row["mean"] for row in table["rows"]}
    # What raw correlation finds is known of these sets (9 %, 67 % within 2; 8.4 %).
    assert found["LENS example", "raw correlation", "within 0"] == pytest.approx(9)
    assert found["LENS example", "raw correlation", "within 2"] == pytest.approx(67)
    assert found["Brisbane, 7x7 pixels", "raw correlation", "given"] == pytest.approx(8.4, abs=0.1)
    assert found["Nordland, 64x32 grey", "blurred correlation, sequence", "within 10"] > 95
    assert len(list(real.tables(table))) == 3


def test_real_sets_that_are_not_there_are_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="give the folder that holds them with `data`"):
        reproduce("real", tmp_path / "out")
    with pytest.raises(InputError, match="holds none of the real sets"):
        reproduce("real", tmp_path / "out", data=tmp_path)
    with pytest.raises(InputError, match="there is no folder of data"):
        reproduce("real", tmp_path / "out", data=tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("family", "kind"),
    [
        ("table2", table2.Recipe),
        ("figure5", figure5.Recipe),
        ("ablations", ablations.Recipe),
        ("real", RealSet),
    ],
)
def test_every_recipe_is_read(family: str, kind: type[Any]) -> None:
    found = recipes(family, kind)
    assert [recipe.order for recipe in found] == list(range(1, len(found) + 1))


def test_wrong_wishes_are_one_clear_line(
    city: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SettingsError, match="known are ablations, descriptor, figure5, known, real"):
        reproduce("table3", tmp_path, city)
    with pytest.raises(InputError, match="holds no drives: make them with evplace city"):
        reproduce("table2", tmp_path / "out", tmp_path)
    assert not (tmp_path / "out").exists()
    with pytest.raises(
        SettingsError, match="'sound' is no input that table2 can be limited to: known are events"
    ):
        reproduce("table2", tmp_path / "out", city, choice=Choice(inputs=("sound",)))
    with pytest.raises(SettingsError, match="known are none"):
        reproduce("ablations", tmp_path / "out", city, choice=Choice(inputs=("events",)))
    with pytest.raises(SettingsError, match="'seed' cannot be set for all"):
        Choice(train={"seed": 7})
    with pytest.raises(SettingsError, match="0 processes can do nothing"):
        reproduce("table2", tmp_path / "out", city, workers=0)
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot write"):
        reproduce("table2", tmp_path / "file" / "out", city)
    (tmp_path / "bare").mkdir()
    (tmp_path / "bare" / "city.json").write_bytes((city / "city.json").read_bytes())
    with pytest.raises(InputError, match="lacks day-1/ideal: make a city with all drives and sensors"):
        reproduce("table2", tmp_path / "out", tmp_path / "bare")
    with pytest.raises(SettingsError, match="at least 1"):
        Choice(seeds=0)
    assert (
        main(["reproduce", "table2", "--city", str(city), "-o", str(tmp_path / "o"), "--set", "stps=3"]) == 2
    )
    assert "did you mean 'steps'" in capsys.readouterr().err
