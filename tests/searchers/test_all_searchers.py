"""What holds for every way to search."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evplace.core import families
from evplace.core.errors import PlaceMapError, SettingsError
from evplace.core.storage import read_array, write_array
from evplace.searchers import ABOUT, MANY, Content, Searcher, Vectors, kept, opened, usual
from evplace.searchers.bits import BITS, Bits
from evplace.searchers.int8 import SMALL

NAMES = families.names("searchers")


def searcher(name: str) -> Searcher:
    if name == "faiss":
        pytest.importorskip("faiss", reason="faiss needs the extra 'index'")
    found: Searcher = families.make("searchers", name)
    return found


def street(many: int, dimensions: int = 40, seed: int = 0) -> Vectors:
    """Vectors that change slowly, in directions of which the first hold most, around one that all share."""
    rng = np.random.default_rng(seed)
    steps = np.cumsum(rng.standard_normal((many, dimensions)), axis=0) % 7 - 3.5
    return np.asarray(2 + steps * 0.9 ** np.arange(dimensions), np.float32)


def seen(references: Vectors, items: Any, seed: int = 1) -> Vectors:
    """What a later drive sees of some references."""
    rng = np.random.default_rng(seed)
    return np.asarray(references[items] + 0.1 * rng.standard_normal(references[items].shape), np.float32)


@pytest.mark.parametrize("name", NAMES)
def test_scores_are_products_and_the_top_is_their_top(name: str) -> None:
    references = street(500)
    searching = searcher(name).build(references)
    queries = seen(references, [3, 77, 499])
    wanted = queries @ references.T
    near = 0.05 * wanted.std()
    assert (searching.items, searching.dimensions) == references.shape
    np.testing.assert_allclose(searching.rows(queries), wanted, atol=near)
    some = np.array([499, 0, 77, 77])
    np.testing.assert_allclose(searching.scores(queries, some), wanted[:, some], atol=near)
    found = searching.top(queries, 5)
    assert found.items.dtype == np.int64
    assert found.items.shape == found.scores.shape == (3, 5)
    assert (np.diff(found.scores, axis=1) <= 0).all()
    np.testing.assert_allclose(found.scores, np.take_along_axis(wanted, found.items, 1), atol=near)
    np.testing.assert_allclose(found.scores[:, 0], wanted.max(axis=1), atol=near)
    assert searching.top(queries, 1000).items.shape == (3, 500)


@pytest.mark.parametrize("name", NAMES)
def test_a_query_is_answered_alike_alone_and_among_others(name: str) -> None:
    references = street(300)
    searching = searcher(name).build(references)
    queries = seen(references, [5, 6, 200])
    together = searching.top(queries, 9)
    for at in range(3):
        alone = searching.top(queries[at : at + 1], 9)
        np.testing.assert_array_equal(alone.items[0], together.items[at])
        np.testing.assert_allclose(alone.scores[0], together.scores[at], rtol=1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_what_is_kept_opens_from_a_memory_map_and_answers_alike(name: str, tmp_path: Path) -> None:
    references, part = street(300), searcher(name)
    searching, queries = part.build(references), seen(references, [1, 250])
    content = on_disk(kept(part, searching), tmp_path)
    again = opened(content, 300, 40)
    for one, other in ((searching.top(queries, 7), again.top(queries, 7)),):
        np.testing.assert_array_equal(one.items, other.items)
        np.testing.assert_array_equal(one.scores, other.scores)
    np.testing.assert_array_equal(searching.rows(queries), again.rows(queries))


def on_disk(content: Content, folder: Path) -> dict[str, Any]:
    for name, value in content.items():
        if isinstance(value, np.ndarray):
            write_array(folder / f"{name}.npy", value)
    return {
        name: read_array(folder / f"{name}.npy", "the index", memory_mapped=True)
        if isinstance(value, np.ndarray)
        else value
        for name, value in content.items()
    }


@pytest.mark.parametrize("name", NAMES)
def test_references_that_are_added_are_found_like_those_before_them(name: str, tmp_path: Path) -> None:
    references, part = street(400), searcher(name)
    searching = opened(on_disk(kept(part, part.build(references[:300])), tmp_path), 300, 40)
    searching.add(references[300:])
    assert searching.items == 400
    queries = seen(references, [20, 390])
    assert searching.top(queries, 1).items[:, 0].tolist() == (queries @ references.T).argmax(axis=1).tolist()
    wanted = queries @ references.T
    np.testing.assert_allclose(searching.rows(queries), wanted, atol=0.05 * wanted.std())


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("references", [np.zeros((3, 5)), np.ones((70, 5)), np.eye(1, 130)])
def test_references_that_are_all_alike_or_one_alone(name: str, references: Any) -> None:
    vectors = references.astype(np.float32)
    searching = searcher(name).build(vectors)
    found = searching.top(vectors[:1], 4)
    many = min(4, len(vectors))
    assert found.items.shape == (1, many)
    assert len(set(found.items[0].tolist())) == many
    np.testing.assert_allclose(found.scores[0], np.full(many, vectors[0] @ vectors[0]), atol=0.05)


@pytest.mark.parametrize("name", NAMES)
def test_an_index_that_does_not_fit_its_references_is_refused(name: str) -> None:
    part = searcher(name)
    content = kept(part, part.build(street(60)))
    for items, dimensions in ((61, 40), (60, 39)):
        words = (
            f"not fit its references: it says 60 vectors of 40 numbers, the map has {items} of {dimensions}"
        )
        with pytest.raises(PlaceMapError, match=words):
            opened(content, items, dimensions)
    about = json.loads(bytes(content[ABOUT])) | {"items": 61}
    with pytest.raises(PlaceMapError, match="it holds 60 vectors of 40"):
        opened({**content, ABOUT: json.dumps(about).encode()}, 61, 40)


@pytest.mark.parametrize("name", NAMES)
def test_what_was_not_kept_so_is_refused(name: str) -> None:
    part = searcher(name)
    content = kept(part, part.build(street(60)))
    for key, value in content.items():
        if key == ABOUT:
            continue
        assert isinstance(value, np.ndarray)
        wrong = [value[:-1], value[..., None], value.astype("c8"), value[:0], value.tobytes(), None]
        for other in wrong:
            with pytest.raises(PlaceMapError, match=r"the map's index|missing"):
                opened({**content, key: other} if other is not None else without(content, key), 60, 40)


def without(content: Content, key: str) -> dict[str, Any]:
    return {name: value for name, value in content.items() if name != key}


def test_an_index_of_another_version_or_searcher_is_refused() -> None:
    content = kept(Bits(), Bits().build(street(60)))
    about = json.loads(bytes(content[ABOUT]))
    for wrong, words in (
        (about | {"format": "evplace-index-9"}, "has the format 'evplace-index-9', this version reads"),
        (about | {"searcher": 3}, "lacks searcher, settings, shapes"),
        (without(about, "settings"), "lacks searcher, settings, shapes"),
    ):
        with pytest.raises(PlaceMapError, match=words):
            opened({**content, ABOUT: json.dumps(wrong).encode()}, 60, 40)
    for odd in (b"[", b"[]", b"\xff", None):
        with pytest.raises(PlaceMapError, match="does not say how its index was made"):
            opened({**content, ABOUT: odd} if odd is not None else without(content, ABOUT), 60, 40)
    with pytest.raises(SettingsError, match="'quick' is none of the searchers: known are bits, exact, faiss"):
        opened({**content, ABOUT: json.dumps(about | {"searcher": "quick"}).encode()}, 60, 40)


def test_bytes_that_are_altered_are_refused_by_faiss(tmp_path: Path) -> None:
    part = searcher("faiss")
    content = kept(part, part.build(street(200)))
    file = np.asarray(content["index_faiss"])
    for cut in (0, 1, 3, 30, 500, len(file) // 2, len(file) - 1):
        with pytest.raises(PlaceMapError, match=r"the map's index"):
            opened({**content, "index_faiss": file[:cut]}, 200, 40)


@given(
    st.integers(1, 200), st.integers(1, 3), st.integers(1, 70), st.integers(0, 9), st.integers(1, 4)
)  # fmt: skip
def test_the_nearest_by_bits_are_those_that_a_sort_finds(
    items: int, words: int, many: int, seed: int, kinds: int
) -> None:
    """With few kinds of references most differ in equally many bits: the first ones count."""
    rng = np.random.default_rng(seed)
    references = rng.integers(0, 1 << 63, (kinds, words)).astype(np.uint64)[rng.integers(kinds, size=items)]
    references ^= rng.integers(0, 2, references.shape).astype(np.uint64)
    query = rng.integers(0, 1 << 63, words).astype(np.uint64)
    differ = np.array(
        [sum(int(a ^ b).bit_count() for a, b in zip(query, one, strict=True)) for one in references]
    )
    wanted = np.sort(np.argsort(differ, kind="stable")[:many])
    small = np.zeros((items, 64 * words), np.int8)
    part = Bits().build(np.zeros((items, 64 * words), np.float32))
    opened_ = Bits().open({**part.content(), SMALL: small, BITS: references})
    np.testing.assert_array_equal(opened_._near(query, many), wanted)


def test_of_many_references_an_index_is_the_default() -> None:
    assert (usual(MANY), usual(MANY + 1)) == ("exact", "faiss")
    assert MANY == 300_000
    for wrong in ({"candidates": 0}, {"probes": 0}):
        with pytest.raises(SettingsError, match="is 1 or more, not 0"):
            families.make("searchers", "bits" if "candidates" in wrong else "faiss", values=wrong)
