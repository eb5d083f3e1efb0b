"""Maps whose references are searched by an index, against those that compare all of them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import sum_again
from evplace.core import families
from evplace.core.errors import MissingExtraError, PlaceMapError, SettingsError
from evplace.core.storage import read_array, write_array
from evplace.core.zscores import ordered, robust_z
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid
from evplace.scorers import _indexed
from evplace.scorers._compressed import Compressed, compress
from evplace.scorers._indexed import IndexedRows, indexed, scale
from evplace.scorers.fused import Fused
from evplace.searchers import ABOUT


class Vectors:
    """A descriptor of images that are vectors already."""

    def __init__(self, of: slice) -> None:
        self._of = of

    def describe(self, images: Any) -> Any:
        return np.asarray(images[:, self._of], np.float32)


PARTS: Mapping[str, Any] = {"one": Vectors(slice(0, 30)), "two": Vectors(slice(30, 70))}
WEIGHTS = {"one": 1.0, "two": 2.0}
ITEMS = 5000


@pytest.fixture(scope="module")
def references() -> Any:
    rng = np.random.default_rng(0)
    vectors = 0.5 + rng.standard_normal((ITEMS, 70)) * 0.97 ** np.arange(70)
    return (vectors / np.linalg.norm(vectors, axis=1, keepdims=True)).astype(np.float32)


@pytest.fixture(scope="module")
def compressed(references: Any) -> dict[str, Compressed]:
    return {name: compress(part.describe(references), 20) for name, part in PARTS.items()}


def part_row(compressed: dict[str, Compressed], name: str, image: Any) -> Any:
    """The z-scores of one descriptor by all references."""
    return robust_z(compressed[name].rows(PARTS[name].describe(image[None]))[0])


def whole_row(compressed: dict[str, Compressed], image: Any) -> Any:
    """The z-scores that all references together give."""
    total = sum(weight * part_row(compressed, name, image) for name, weight in WEIGHTS.items())
    return robust_z(np.asarray(total))


@pytest.mark.parametrize("index", sorted(set(families.names("searchers")) - {"faiss"}))
def test_z_scores_of_what_is_listed_are_those_of_a_whole_row(
    references: Any, compressed: dict[str, Compressed], index: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What tells the scale is exact as well, so that a matcher makes the same z-scores of it again."""
    monkeypatch.setattr(_indexed, "LISTED", 100)
    opened = IndexedRows(PARTS, WEIGHTS, indexed(compressed, WEIGHTS, index), ITEMS)
    near = {"exact": 1e-4}.get(index, 0.06)
    rng = np.random.default_rng(1)
    for item in (0, 77, 4999):
        image = (references[item] + 0.02 * rng.standard_normal(70)).astype(np.float32)
        wanted, row = whole_row(compressed, image), opened.rows(image[None])[0]
        listed = np.flatnonzero(row)
        assert row.max() >= np.sort(wanted)[-10] - near
        np.testing.assert_allclose(row[listed], wanted[listed], atol=near)
        np.testing.assert_allclose(robust_z(row)[listed], wanted[listed], atol=near)
        np.testing.assert_allclose(opened.some(image[None], listed)[0], wanted[listed], atol=near)
        if not opened._search.compares_all:
            not_seen = set(np.arange(ITEMS)[ordered(ITEMS)]) - set(listed)
            assert len(not_seen) <= 1  # the median, which may be 0
            assert ITEMS // 2 < len(listed) <= ITEMS // 2 + 100


@pytest.mark.parametrize("index", sorted(set(families.names("searchers")) - {"faiss"}))
def test_what_verifies_is_of_the_first_descriptor_alone(
    references: Any, compressed: dict[str, Compressed], index: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of what is listed and of what tells the scale; all else is usual."""
    monkeypatch.setattr(_indexed, "LISTED", 100)
    opened = IndexedRows(PARTS, WEIGHTS, indexed(compressed, WEIGHTS, index), ITEMS)
    near = {"exact": 1e-4}.get(index, 0.1)
    image = references[77:78] + 0.02 * np.random.default_rng(1).standard_normal((1, 70)).astype(np.float32)
    wanted = part_row(compressed, "one", image[0])
    rows, verifying = (one[0] for one in opened.scored(image))
    listed = np.flatnonzero(rows)
    np.testing.assert_allclose(verifying[listed], wanted[listed], atol=near)
    np.testing.assert_allclose(robust_z(verifying)[listed], wanted[listed], atol=near)
    np.testing.assert_allclose(opened.scored(image, listed).verifying[0], wanted[listed], atol=near)
    unseen = np.setdiff1d(np.arange(ITEMS), [*listed, *np.arange(ITEMS)[ordered(ITEMS)]])
    assert (verifying[unseen] == 0).all()


@given(st.integers(2, 60), st.integers(0, 99), st.floats(0.1, 3))
def test_a_scale_is_that_of_z_scores_in_turn(many: int, seed: int, weight: float) -> None:
    rng = np.random.default_rng(seed)
    scores = [rng.standard_normal(many).astype(np.float32) * size for size in (1, 50)]
    by = scale(scores, [1.0, weight])
    wanted = robust_z(robust_z(scores[0]) + np.float32(weight) * robust_z(scores[1]))
    found = sum(factor * one for factor, one in zip(by.factors, scores, strict=True)) - by.shift
    np.testing.assert_allclose(found, wanted, atol=1e-3 * (1 + np.abs(wanted).max()))


def test_scores_that_are_all_alike_count_nothing() -> None:
    flat = np.full(9, 3.0, np.float32)
    assert scale([flat, flat], [1.0, 2.0]) == ((0.0, 0.0), 0.0)


@pytest.mark.parametrize("index", ["int8", "bits"])
def test_a_saved_map_with_an_index_answers_as_before(
    index: str, day: Traverse, night: Traverse, places: PlaceGrid, tmp_path: Path
) -> None:
    street = train(day, places, index=index)
    street.save(tmp_path / "map")
    loaded = Localizer(PlaceMap.load(tmp_path / "map", unchecked=True))
    np.testing.assert_array_equal(loaded.rows(night.images[:9]), Localizer(street).rows(night.images[:9]))
    exact = Localizer(train(day, places)).rows(night.images[:9])
    np.testing.assert_allclose(loaded.rows(night.images[:9]), exact, atol=0.1)


def test_a_map_whose_index_was_altered_is_refused(day: Traverse, places: PlaceGrid, tmp_path: Path) -> None:
    """Even where its checksums are made anew: cut off, of another map, of another version, of odd numbers."""
    folder = tmp_path / "map"
    train(day, places, index="bits").save(folder)
    whole = {file.name: file.read_bytes() for file in folder.iterdir()}
    bits = folder / "index_bits.npy"
    bits.write_bytes(whole[bits.name][:-8])
    refused(folder, "has changed since it was saved", sums=False)
    refused(folder, "is not a whole .npy array")
    write_array(bits, np.zeros((61, 6), np.uint64))
    refused(folder, "'index_bits' is not of the shape")
    bits.write_bytes(whole[bits.name])
    about = json.loads(whole[ABOUT])
    for wrong, words in (
        (about | {"format": "evplace-index-2"}, "has the format 'evplace-index-2'"),
        (about | {"items": 61}, "does not fit its references: it says 61 vectors"),
    ):
        (folder / ABOUT).write_text(json.dumps(wrong))
        refused(folder, words)
    (folder / ABOUT).write_bytes(whole[ABOUT])
    for name in ("edges_usual", "spreads", "trained_basis"):
        array = read_array(folder / f"{name}.npy", "it")
        write_array(folder / f"{name}.npy", np.full_like(array, np.nan))
        refused(folder, f"'{name}' holds NaN")
        write_array(folder / f"{name}.npy", array[:-1])
        refused(folder, r"the map's (index|vectors)")
        (folder / f"{name}.npy").write_bytes(whole[f"{name}.npy"])
    sum_again(folder)
    Localizer(PlaceMap.load(folder))


def refused(folder: Path, words: str, sums: bool = True) -> None:
    if sums:
        sum_again(folder)
    with pytest.raises(PlaceMapError, match=words):
        Localizer(PlaceMap.load(folder))


def test_an_index_is_named_and_there(
    monkeypatch: pytest.MonkeyPatch, day: Traverse, places: PlaceGrid
) -> None:
    with pytest.raises(SettingsError, match="'tree' is none of the searchers: known are bits, exact, faiss"):
        Fused(index="tree")
    monkeypatch.setitem(__import__("sys").modules, "faiss", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'evplace\[index\]'"):
        train(day, places, index="faiss")


def test_of_many_references_an_index_is_made_unasked(
    monkeypatch: pytest.MonkeyPatch, day: Traverse, places: PlaceGrid
) -> None:
    monkeypatch.setattr("evplace.searchers.MANY", 59)
    pytest.importorskip("faiss", reason="faiss needs the extra 'index'")
    street = train(day, places)
    about = json.loads(bytes(street.content[ABOUT]))
    assert (about["searcher"], about["items"]) == ("faiss", 60)
    assert train(day, places, index="exact").content.keys() >= {"edges_vectors"}
