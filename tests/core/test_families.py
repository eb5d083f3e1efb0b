"""Broken parts of other packages: one line that names the part and its package, and no other harm."""

from __future__ import annotations

import dataclasses
import json
import re
import sys
import types
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from conftest import sum_again
from evplace.cli import main
from evplace.core import families
from evplace.core.errors import DatasetError, EvplaceError, PartError, RecordingError, TrackError
from evplace.drives.datasets import Drive, drives, open_drive
from evplace.drives.to_traverse import open_traverse
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.matchers import Answer
from evplace.matchers import Path as Answered
from evplace.matchers.best import Best
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid
from evplace.scorers import Learned, keep_images
from evplace.sources.readers import Block, Source, open_recording
from evplace.sources.tracks import open_track

Others = Callable[..., types.ModuleType]
OWN = f"of the package {__name__}"


@pytest.fixture
def others(monkeypatch: pytest.MonkeyPatch) -> Iterator[Others]:
    """Installs a module of a package `someone` as a part, `others("readers", "own", matches=...)`."""
    points: list[EntryPoint] = []

    def forget() -> None:
        for cached in (families._own, families._entry_points):
            cached.cache_clear()

    def install(family: str, name: str, value: str = "", **members: Any) -> types.ModuleType:
        module = types.ModuleType(f"someone_{family}_{name}")
        module.__dict__.update(members)
        monkeypatch.setitem(sys.modules, module.__name__, module)
        points.append(EntryPoint(name, value or module.__name__, f"evplace.{family}"))
        forget()
        return module

    def installed(group: str) -> list[EntryPoint]:
        return [point for point in points if point.group == group]

    monkeypatch.setattr(families, "installed", installed)
    forget()
    yield install
    forget()


# Matchers.


def matcher(**members: Any) -> Any:
    """A matcher whose members break what they promise."""

    def start(self: Any, distances: bool = False) -> Any:
        good = Best().start()
        own = {name: getattr(good, name) for name in ("step", "extend", "path")}
        return types.SimpleNamespace(**own | members)

    return dataclasses.make_dataclass("Odd", [], namespace={"start": start, "causal": True}, frozen=True)()


def path_of(items: int = 60, **changed: Any) -> Callable[[], Answered]:
    good = Answered(np.zeros(items, np.int64), np.zeros(items), np.ones(items, bool))
    return lambda: good._replace(**changed)


@pytest.mark.parametrize(
    "answer",
    [
        3,
        Answer(0, 60, 1.0, True),
        Answer(0, -2, 1.0, True),
        Answer(1, 0, 1.0, True),
        Answer(-1, 0, 1.0, True),
    ],
)
def test_a_step_that_is_no_answer(answer: object, image_map: PlaceMap, night: Traverse) -> None:
    where = Localizer(image_map, matcher(step=lambda row: answer))
    with pytest.raises(PartError, match=r"the matcher 'Odd' of the package types must answer one of the 1"):
        list(where.push_image(night.images[0], 0))
    with pytest.raises(PartError, match="must answer one of the 1 queries so far with an item of 60"):
        where.answers(night)


@pytest.mark.parametrize(
    "path",
    [
        lambda: None,
        path_of(59),
        path_of(item=np.full(60, 60)),
        path_of(item=np.full(60, -2)),
        path_of(item=np.zeros(60)),
        path_of(score=["x"] * 60),
        path_of(accepted=np.ones(60)),
        path_of(accepted=None),
    ],
)
def test_a_path_that_is_none(path: Any, image_map: PlaceMap, night: Traverse) -> None:
    where = Localizer(image_map, matcher(path=path))
    with pytest.raises(PartError, match=r"the matcher 'Odd' .* must answer each of 60 queries with an item"):
        where.answers(night, "hindsight")


def broken(*_: object) -> Any:
    raise KeyError("lost")


@pytest.mark.parametrize(
    ("member", "answers"), [("step", "live"), ("extend", "hindsight"), ("path", "hindsight")]
)
def test_a_matcher_that_fails(member: str, answers: Any, image_map: PlaceMap, night: Traverse) -> None:
    where = Localizer(image_map, matcher(**{member: broken}))
    with pytest.raises(PartError, match="the matcher 'Odd' of the package types failed: KeyError: 'lost'"):
        where.answers(night, answers)


def test_a_matcher_that_fails_on_the_command_line(
    others: Others, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    np.save(tmp_path / "scores.npy", np.zeros((4, 3), np.float32))
    for number, made in enumerate((matcher(extend=broken), matcher(path=path_of(3)))):
        others("matchers", f"odd{number}", f"someone_matchers_odd{number}:Odd", Odd=type(made))
        command = ["match", str(tmp_path / "scores.npy"), "-o", str(tmp_path / "m.csv")]
        assert main([*command, "--matcher", f"odd{number}"]) == 2
        assert capsys.readouterr().err.startswith("evplace: the matcher 'Odd' of the package types ")
        assert not (tmp_path / "m.csv").exists()


# Scorers.


@dataclass(frozen=True)
class Odd:
    """A scorer whose rows, or what it learned, are the class's."""

    causal: ClassVar[bool] = True
    answer: ClassVar[Any] = None
    learned: ClassVar[Any] = None

    def learn(self, reference: Traverse, places: Any, _: Any) -> Any:
        return keep_images(reference, places) if self.learned is None else self.learned

    def open(self, content: Any) -> Any:
        return types.SimpleNamespace(distances=False, rows=lambda images: self.answer(len(images)))


def odd(**members: Any) -> Any:
    return type("Odd", (Odd,), {"__module__": __name__, **members})()


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (lambda _, n: np.zeros((n, 59), np.float32), r"it gave float32 \(1, 59\)"),
        (lambda _, n: np.zeros(60, np.float32), r"it gave float32 \(60,\)"),
        (lambda _, n: np.full((n, 60), np.nan), r"it gave float64 \(1, 60\) with NaN"),
        (lambda _, n: [[0.0] * 60] * n, "it gave list"),
        (lambda _, n: np.array([["x"] * 60]), "it gave <U1"),
        (lambda _, n: None, "it gave NoneType"),
    ],
)
def test_rows_that_are_none(answer: Any, words: str, day: Traverse, places: PlaceGrid) -> None:
    where = Localizer(train(day, places, odd(answer=answer)), "best")
    with pytest.raises(
        PartError, match=rf"the scorer 'Odd' {OWN} must give finite scores \(1, 60\).*{words}"
    ):
        where.answers(day)


@pytest.mark.parametrize(
    ("learned", "words"),
    [
        (3, "it gave int"),
        (Learned({}, np.array([60])), "its items are not some of the 60 images"),
        (Learned({}, [0, 1]), "its items are not some"),  # type: ignore[arg-type]
        (Learned({"a": 3}), "its content holds int"),  # type: ignore[dict-item]
        (Learned(None), "its content is NoneType"),  # type: ignore[arg-type]
    ],
)
def test_what_no_map_can_hold(learned: Any, words: str, day: Traverse, places: PlaceGrid) -> None:
    with pytest.raises(PartError, match=f"the scorer 'Odd' {OWN} must learn .*{words}"):
        train(day, places, odd(learned=learned))


def test_a_scorer_that_fails(day: Traverse, places: PlaceGrid) -> None:
    with pytest.raises(PartError, match=r"failed: KeyError: 'lost'"):
        train(day, places, odd(learn=broken))
    with pytest.raises(PartError, match=r"failed: KeyError: 'lost'"):
        Localizer(train(day, places, odd(open=broken)))
    with pytest.raises(PartError, match=r"the scorer 'Odd' .* failed: AttributeError"):
        Localizer(train(day, places, odd(open=lambda *_: object())))
    with pytest.raises(PartError, match=r"failed: KeyError: 'lost'"):
        Localizer(train(day, places, odd(answer=broken))).answers(day)


@pytest.mark.parametrize(
    "vectors", [None, np.zeros(60), np.zeros((60, 2, 2)), np.zeros((1, 2)), np.full((60, 2), np.nan)]
)
def test_vectors_that_are_none(vectors: Any, day: Traverse, places: PlaceGrid) -> None:
    made = type("Odd", (), {"__module__": __name__, "describe": lambda *_: vectors})
    with pytest.raises(PartError, match=f"the scorer 'Odd' {OWN} must give finite vectors"):
        Localizer(train(day, places, dataclasses.dataclass(frozen=True)(made)()))


# Readers, tracks, data sets.


def own(matches: Any = lambda path, head: head.startswith(b"OWN"), **changed: Any) -> dict[str, Any]:
    members = {"ABOUT": "Own.", "matches": matches, "read": lambda path, hints: Source((9, 9), broken)}
    return members | changed


def block(n: int = 3, **changed: Any) -> Block:
    zeros = np.zeros(n, np.uint16)
    return Block(np.arange(n, dtype=np.int64), zeros, zeros, zeros > 0)._replace(**changed)


@pytest.mark.parametrize(
    ("blocks", "words"),
    [
        (broken, "failed: KeyError: 'lost'"),
        (lambda: [block(), broken()], "failed: KeyError"),
        (lambda: [block(x=np.zeros(2, np.uint16))], r"it gave int64 \(3,\), uint16 \(2,\), uint16"),
        (lambda: [block(t_us=np.zeros(3))], r"it gave float64 \(3,\)"),
        (lambda: [block(p=None)], "it gave int64"),
        (lambda: [3], "it gave int"),
        (lambda: None, "failed: TypeError"),
    ],
)
def test_blocks_that_are_none(blocks: Any, words: str, others: Others, tmp_path: Path) -> None:
    others("readers", "own", **own(read=lambda path, hints: Source((9, 9), blocks)))
    (tmp_path / "a.own").write_bytes(b"OWN")
    with pytest.raises(PartError, match=f"the reader 'own' of the package someone_readers_own .*{words}"):
        list(open_recording(tmp_path / "a.own").packets())
    others("readers", "sizeless", **own(read=lambda path, hints: Source(None, blocks)))
    with pytest.raises(PartError, match="the reader 'sizeless'"):
        open_recording(tmp_path / "a.own", format="sizeless")


def test_a_reader_that_fails_stops_no_other(others: Others, tmp_path: Path, night: Traverse) -> None:
    others("readers", "own", **own(matches=broken, read=broken))
    others("readers", "aaa", "nowhere.reader")
    np.savez(tmp_path / "a.npz", t=[1, 2], x=[0, 0], y=[0, 0], p=[0, 1], size=[9, 9])
    assert open_recording(tmp_path / "a.npz", time_unit="us").format == "npz"
    (tmp_path / "a.own").write_bytes(b"OWN")
    with pytest.raises(
        RecordingError, match=r"known are aaa, .*; besides, the reader 'aaa' of the package now"
    ):
        open_recording(tmp_path / "a.own")
    with pytest.raises(PartError, match=r"the reader 'own' of .* failed: KeyError: 'lost'"):
        open_recording(tmp_path / "a.own", format="own")
    with pytest.raises(PartError, match="'aaa' of the package nowhere cannot be loaded: ModuleNotFoundError"):
        open_recording(tmp_path / "a.own", format="aaa")
    night.save(tmp_path / "night")
    assert len(open_traverse(tmp_path / "night")) == len(night)


def test_a_source_that_is_none(others: Others, tmp_path: Path) -> None:
    others("readers", "own", **own(read=lambda path, hints: (9, 9)))
    (tmp_path / "a.own").write_bytes(b"OWN")
    with pytest.raises(PartError, match=r"the reader 'own' .* must open a Source, it gave tuple"):
        open_recording(tmp_path / "a.own")


def test_a_file_that_a_reader_cannot_open_is_no_fault_of_it(others: Others, tmp_path: Path) -> None:
    others("readers", "own", **own(read=lambda path, hints: (path / "part").read_bytes()))
    (tmp_path / "a.own").write_bytes(b"OWN")
    with pytest.raises(RecordingError, match=r"cannot read .* as own: Not a directory"):
        open_recording(tmp_path / "a.own")


def test_a_track_format_that_fails(others: Others, tmp_path: Path) -> None:
    settings = dataclasses.make_dataclass("Settings", [], frozen=True)
    others("tracks", "own", recognises=lambda head: b"OWN" in head, read=broken, Settings=settings)
    others("tracks", "odd", recognises=broken)
    (tmp_path / "a.own").write_bytes(b"OWN")
    with pytest.raises(PartError, match="the track 'own' of the package someone_tracks_own failed: KeyError"):
        open_track(tmp_path / "a.own")
    (tmp_path / "a.other").write_bytes(b"other")
    with pytest.raises(TrackError, match="besides, the track 'odd' of the package someone_tracks_odd failed"):
        open_track(tmp_path / "a.other")


def test_a_data_set_that_fails(others: Others, tmp_path: Path) -> None:
    def recognises(folder: Path) -> bool:
        return folder == tmp_path

    good = {"NEEDS": "a file", "recognises": recognises, "drives": lambda folder: ["day"]}
    others("datasets", "zzz", **good | {"recognises": broken})
    with pytest.raises(DatasetError, match="besides, the dataset 'zzz' of the package someone_datasets_zzz"):
        drives(tmp_path)
    for name, changed, words in (
        ("one", {"drives": broken}, "failed: KeyError: 'lost'"),
        ("two", {"drives": lambda folder: None}, "must list its drives' names, it gave None"),
        ("three", {"drives": lambda folder: [3]}, r"must list its drives' names, it gave \[3\]"),
        ("four", {"open_drive": broken}, "failed: KeyError: 'lost'"),
        ("five", {"open_drive": lambda folder, name: 3}, "must open a Drive, it gave int"),
    ):
        others("datasets", name, **good | changed)
        with pytest.raises(PartError, match=f"the dataset '{name}' of the package .*{words}"):
            open_drive(tmp_path, None, name)


def test_a_data_sets_own_recording_that_fails(others: Others, tmp_path: Path) -> None:
    from evplace.sources.readers import Recording

    def open_one(folder: Path, name: str) -> Drive:
        return Drive(Recording(folder, "own", Source((9, 9), broken), None))

    members = {"NEEDS": "", "recognises": lambda folder: True, "drives": lambda folder: ["day"]}
    others("datasets", "mine", **members, open_drive=open_one)
    source = open_drive(tmp_path, "day", "mine").source
    with pytest.raises(
        PartError, match="the dataset 'mine' of the package someone_datasets_mine failed: KeyErr"
    ):
        list(source.packets())  # type: ignore[union-attr]


# What the list shows.


def listed(capsys: pytest.CaptureFixture[str], family: str) -> Any:
    capsys.readouterr()
    assert main(["list", family, "--json"]) == 0
    return json.loads(capsys.readouterr().out)[family]


def test_the_list_shows_what_cannot_be_loaded_or_is_hidden(
    others: Others, capsys: pytest.CaptureFixture[str]
) -> None:
    others("matchers", "own", "nowhere.matcher:Own")
    others("matchers", "local", Local=Best)
    others("matchers", "mine", "someone_matchers_mine:Odd", Odd=Odd)
    others("matchers", "mine", "somebody.matcher:Odd")
    found = listed(capsys, "matchers")
    assert found["local"]["package"] == "evplace"
    assert found["own"]["fault"].endswith("cannot be loaded: ModuleNotFoundError: No module named 'nowhere'")
    hidden = found["local (someone_matchers_local)"]["fault"]
    assert hidden == (
        "hidden by evplace's own: the package someone_matchers_local must give its matcher another name"
    )
    assert {one["package"] for name, one in found.items() if name.startswith("mine")} == {
        "somebody",
        "someone_matchers_mine",
    }
    assert "hidden by that of the package somebody" in found["mine (someone_matchers_mine)"]["fault"]
    assert main(["list", "matchers"]) == 0
    assert "hidden by evplace's own" in capsys.readouterr().out


def test_help_is_shown_whatever_cannot_be_loaded(others: Others, capsys: pytest.CaptureFixture[str]) -> None:
    for family in ("matchers", "scorers", "representations", "tracks"):
        others(family, "own", "nowhere.part:Own")
    for command in ("localize", "train", "images"):
        with pytest.raises(SystemExit) as stop:
            main([command, "--help"])
        assert not stop.value.code
    assert "Examples:" in capsys.readouterr().out


def test_a_command_that_cannot_be_loaded(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    points = [
        EntryPoint("odd", "nowhere.odd", "evplace.commands"),
        EntryPoint("bad", "bad", "evplace.commands"),
    ]
    monkeypatch.setattr(families, "installed", lambda group: points)
    assert main(["--help"]) == 0
    assert re.search("odd +cannot be loaded", capsys.readouterr().out)
    assert main(["odd"]) == 2
    told = capsys.readouterr().err
    assert (
        told
        == "evplace: the command 'odd' cannot be loaded: ModuleNotFoundError: No module named 'nowhere'\n"
    )


def test_a_map_of_a_scorer_of_another_package(others: Others, image_map: PlaceMap, tmp_path: Path) -> None:
    image_map.save(tmp_path / "map")
    about = json.loads((tmp_path / "map" / "map.json").read_text())
    about["scorer"]["package"] = "someone"
    (tmp_path / "map" / "map.json").write_text(json.dumps(about))
    sum_again(tmp_path / "map")
    with pytest.raises(
        EvplaceError, match="'ncc' of the package 'someone', but the one installed is of 'evpl"
    ):
        PlaceMap.load(tmp_path / "map")
