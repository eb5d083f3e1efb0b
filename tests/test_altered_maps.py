"""Maps, traverses and results are inputs: altered, they give answers or one clear line, nothing else."""

from __future__ import annotations

import resource
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from altered import Alteration, altered, array_alterations, file_alterations, json_alterations
from conftest import sum_again
from evplace.core.errors import EvplaceError, PlaceMapError
from evplace.drives.to_traverse import open_traverse
from evplace.evaluation import Result, compare
from evplace.evaluation._evaluate import evaluate
from evplace.imaging.recipe import Recipe
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.matchers.best import Best
from evplace.placemap import PlaceMap, add, train
from evplace.places import PlaceGrid, PlaceRuns
from evplace.scorers.network import Network
from evplace.sources.tracks import Track

MOST_MB = 300
"""By which all of them together may raise the memory of this process."""


def drive(seed: int, n: int = 12) -> Traverse:
    """Small images of a road, 8 m an image."""
    rng = np.random.default_rng(seed)
    images = (
        np.random.default_rng(9).integers(0, 250, (n, 16, 24)) + rng.integers(0, 5, (n, 16, 24))
    ).astype("u1")
    t_us = np.arange(n, dtype=np.int64) * 100_000
    track = Track.local(t_us, np.stack([500_000 + 8.0 * np.arange(n), np.full(n, 4e6)], axis=1))
    recipe = Recipe("events", (24, 21)).changed(width=24, height=16)
    return Traverse(images, t_us, np.full(n, 7, np.int64), track, recipe, {"source": "made"})


@pytest.fixture(scope="module")
def query() -> Traverse:
    return drive(1)


def grid() -> PlaceGrid:
    track = drive(0).track
    assert track is not None
    return PlaceGrid.from_track(track)


@pytest.fixture(scope="module", params=["grid", "runs", "seqslam", "network"])
def saved(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("maps") / "map"
    if request.param == "network":
        pytest.importorskip("torch", reason="the network needs the extra 'train'")
    saved_as(f"map-{request.param}", folder, drive(1))
    return folder


@pytest.fixture(autouse=True)
def bounded() -> Iterator[None]:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    yield
    if sys.platform == "linux":
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MOST_MB << 10


def one_line(what: str, use: Callable[[], object]) -> object | None:
    """What comes out; None for an EvplaceError, which must be a line of a sensible length."""
    try:
        return use()
    except EvplaceError as error:
        told = str(error)
    except BaseException as error:
        raise AssertionError(f"{what}: {type(error).__name__}: {error}") from error
    assert "\n" not in told, what
    assert len(told) < 2000, (what, told[:3000])
    return None


def answers(folder: Path, query: Traverse) -> bytes:
    where = Localizer(PlaceMap.load(folder), Best())
    rows = where.rows(query.images)
    assert np.isfinite(rows).all()
    figures = evaluate(where, query).figures
    return rows.tobytes() + repr(figures).encode()


def saved_as(name: str, folder: Path, query: Traverse) -> tuple[Callable[[Path], object], str]:
    """A map, a traverse or a result in a new folder; what uses such a folder, and the file that marks it."""
    if name == "traverse":
        query.save(folder)
        street = train(drive(0), grid(), "ncc")
        return partial(traverse_used, street), "traverse.json"
    if name == "result":
        evaluate(Localizer(train(drive(0), grid(), "ncc"), Best()), query).save(folder, with_scores=True)
        return result_used, "result.json"
    places: Any = PlaceRuns(12, 3) if name == "map-runs" else grid()
    if name == "map-several":
        add(train(drive(0), grid(), "ncc", matcher="best"), drive(2)).save(folder)
        return lambda place: answers(place, query), "map.json"
    parts: dict[str, Any] = {"map-grid": "ncc", "map-runs": "sad", "map-network": Network(steps=1, batch=4)}
    train(drive(0), places, parts.get(name, "seqslam")).save(folder)
    return lambda place: answers(place, query), "map.json"


def traverse_used(street: PlaceMap, folder: Path) -> object:
    found = Traverse.load(folder)
    _ = found.xy, found[2:4].images.sum(), open_traverse(folder)
    where = Localizer(street, Best())
    return evaluate(where, street.open(folder)).figures, train(found, PlaceRuns(12, 3), "sad")


def result_used(folder: Path) -> object:
    found = Result.load(folder)
    _ = found.error_m, found.outcome, found.timing
    return compare([folder])


def test_maps(saved: Path, query: Traverse, tmp_path: Path) -> None:
    arrays = sorted(file.name for file in saved.glob("*.npy"))
    changes: list[Alteration] = list(json_alterations(saved, "map.json"))
    for name in arrays:
        changes += array_alterations(saved, name)
    changes += file_alterations(saved)
    refused = held(saved, query, tmp_path / "map", changes)
    assert len(changes) > 200
    assert refused > len(changes) // 3


def test_maps_of_several_drives(query: Traverse, tmp_path: Path) -> None:
    """What they have besides."""
    saved_as("map-several", tmp_path / "several", drive(1))
    changes = [
        change for change in json_alterations(tmp_path / "several", "map.json") if "drives" in change[0]
    ]
    changes += array_alterations(tmp_path / "several", "belongs.npy")
    refused = held(tmp_path / "several", query, tmp_path / "map", changes)
    assert len(changes) > 80
    assert refused > len(changes) // 2


def held(saved: Path, query: Traverse, place: Path, changes: list[Alteration]) -> int:
    """Each change is noticed, or changes nothing; how many are refused that come with their sums."""
    good, refused = answers(saved, query), 0
    for what, alteration in changes:
        altered(saved, place, alteration)
        found = one_line(what, lambda: answers(place, query))
        assert found in (None, good), f"{what} is answered without being noticed"
        if "cannot be read" not in what and "device" not in what and (place / "SHA256SUMS").is_file():
            sum_again(place)
            found = one_line(f"{what}, with its sums", lambda: answers(place, query))
            refused += found is None
    return refused


@pytest.mark.parametrize(
    "sums",
    ["", "x", "a  b\n", "0" * 64 + "  ../../x\n", "0" * 64 + "  /dev/zero\n", "\x00", "map.json\n", "\n" * 9],
)
def test_sums_that_are_none(saved: Path, query: Traverse, tmp_path: Path, sums: str) -> None:
    good = (saved / "SHA256SUMS").read_text()
    for text in (
        sums,
        good + sums if sums.strip() else good[:-70],
        good.replace("map.json", sums[:9] or "x"),
    ):
        place = altered(
            saved, tmp_path / "map", lambda folder, text=text: (folder / "SHA256SUMS").write_text(text)
        )
        with pytest.raises(PlaceMapError):
            answers(place, query)


def test_content_that_calls_for_other_files(saved: Path, query: Traverse, tmp_path: Path) -> None:
    for name in ("../../x", "/dev/zero", "map.json", "items.npy", "SHA256SUMS", "a/b.npy", "."):

        def alteration(folder: Path, name: str = name) -> None:
            text = (folder / "map.json").read_text()
            about = text.replace('"content": [', f'"content": ["{name}", ')
            assert about != text
            (folder / "map.json").write_text(about)

        place = altered(saved, tmp_path / "map", alteration)
        sum_again(place)
        with pytest.raises(PlaceMapError):
            answers(place, query)


def test_traverses(query: Traverse, tmp_path: Path) -> None:
    masked = Traverse(
        query.images,
        query.t_us,
        query.counts,
        query.track,
        query.recipe,
        query.info,
        np.zeros((21, 24), bool),
    )
    masked.save(tmp_path / "saved")
    count, use = 0, partial(traverse_used, train(drive(0), grid(), "ncc"))
    changes = list(json_alterations(tmp_path / "saved", "traverse.json"))
    for name in ("images", "t_us", "counts", "track", "mask"):
        changes += array_alterations(tmp_path / "saved", f"{name}.npy")
    changes += file_alterations(tmp_path / "saved")
    for what, alteration in changes:
        place = altered(tmp_path / "saved", tmp_path / "traverse", alteration)
        one_line(what, partial(use, place))
        count += 1
    assert count > 100


def test_results(query: Traverse, tmp_path: Path) -> None:
    result = evaluate(Localizer(train(drive(0), grid(), "ncc"), Best()), query)
    result.save(tmp_path / "saved", with_scores=True)
    saved, count = tmp_path / "saved", 0
    changes = list(json_alterations(saved, "result.json"))
    for file in sorted(saved.glob("*.npy")):
        changes += array_alterations(saved, file.name)
    changes += [*file_alterations(saved), *csv_alterations(saved)]
    for what, alteration in changes:
        place = altered(saved, tmp_path / "result", alteration)
        one_line(what, partial(result_used, place))
        count += 1
    assert count > 100


def csv_alterations(folder: Path) -> Iterator[Alteration]:
    """Every column of matches.csv removed, and a value of each replaced."""
    lines = (folder / "matches.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines]

    def write(table: list[list[str]]) -> Callable[[Path], None]:
        text = "\n".join(map(",".join, table)) + "\n"
        return lambda place: (place / "matches.csv").write_text(text) and None

    for n, name in enumerate(rows[0]):
        yield f"matches.csv without {name}", write([row[:n] + row[n + 1 :] for row in rows])
        for text in ("", "x", "-1", "-2", "1e400", "nan", "9" * 30, "0.5", '"', "\x00", "x" * 200_000):
            changed = [row[:] for row in rows]
            changed[2][n] = text
            yield f"matches.csv with {name} = {text[:9]!r}", write(changed)
    yield "matches.csv cut", lambda place: (place / "matches.csv").write_text("\n".join(lines[:-1])) and None
    yield "a longer row", write([*rows, [*rows[-1], "3", "4"]])
    yield "a shorter row", write([*rows, rows[-1][:2]])
