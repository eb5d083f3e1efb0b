"""The default scorer."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from conftest import make_drive, make_traverse
from evplace.core.errors import PlaceMapError, SettingsError, TraverseError
from evplace.core.zscores import robust_z
from evplace.imaging.traverse import Traverse
from evplace.placemap import train
from evplace.places import PlaceGrid, PlaceRuns
from evplace.scorers import ComparesSome, Learning, Verifies
from evplace.scorers.edges import Edges
from evplace.scorers.fused import VERSIONS, Fused
from evplace.scorers.trained import Trained
from evplace.testing import check_scorer


@pytest.mark.parametrize("settings", [Fused(), Fused(trained=False), Fused(every_m=0, components=5)])
def test_it_keeps_what_scorers_promise(settings: Fused) -> None:
    check_scorer(settings)


@pytest.mark.parametrize("few", [False, True])
def test_rows_are_the_sum_of_both_parts_by_weights(day: Traverse, places: PlaceGrid, few: bool) -> None:
    """The trained one counts twice, but where images have few pixels."""
    part = Fused()
    if few:
        day = dataclasses.replace(day, images=np.ascontiguousarray(day.images[:, ::8, ::8]))
    learned = part.learn(day, places, Learning())
    references = np.asarray(learned.content["references"])
    queries = references[::7]
    rows = part.open(learned.content).rows(queries)
    wanted = [
        robust_z(
            sum(
                weight * robust_z(one.describe(image[None])[0] @ one.describe(references).T)
                for one, weight in {Edges(): 1, Trained(): 1 if few else 2}.items()
            )
        )
        for image in queries
    ]
    np.testing.assert_allclose(rows, wanted, atol=3e-2)


def opened(part: Fused, day: Traverse, places: PlaceGrid) -> Verifies:
    found = part.open(part.learn(day, places, Learning()).content)
    assert isinstance(found, Verifies)
    return found


SOME = np.array([41, 3, 3, 20])


@pytest.mark.parametrize("every", [1, 6])
def test_edges_alone_verify_what_both_find(
    day: Traverse, night: Traverse, places: PlaceGrid, every: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As z-scores of their own; where every so many-th of them tells what is usual, too."""
    monkeypatch.setattr("evplace.core.zscores.MOST_ORDERED", len(day) // every)
    content = Fused().learn(day, places, Learning()).content
    basis, vectors = np.asarray(content["edges_basis"]), np.asarray(content["edges_vectors"])
    images = night.images[::9]
    where = opened(Fused(), day, places)
    rows, verifying = where.scored(images)
    alone = (Edges().describe(images) @ basis) @ vectors.T
    np.testing.assert_allclose(verifying, [robust_z(row) for row in alone], atol=1e-4)
    assert np.abs(rows - verifying).max() > 0.5
    some = where.scored(images, SOME)
    np.testing.assert_allclose(some.verifying, verifying[:, SOME], atol=1e-4)
    np.testing.assert_allclose(some.rows, rows[:, SOME], atol=1e-4)


@pytest.mark.parametrize("settings", [Fused(), Fused(trained=False), Fused(index="int8")])
def test_what_verifies_comes_with_the_same_rows(
    settings: Fused, day: Traverse, night: Traverse, places: PlaceGrid
) -> None:
    """To the bit, of all items or some, whatever other images are asked about at once."""
    images = night.images[::9]
    where = opened(settings, day, places)
    assert isinstance(where, ComparesSome)
    for items in (None, SOME):
        rows, verifying = where.scored(images, items)
        alone = where.rows(images) if items is None else where.some(images, items)  # type: ignore[attr-defined]
        np.testing.assert_array_equal(rows, alone)
        assert rows.shape == verifying.shape == (len(images), len(day) if items is None else len(SOME))
        assert rows.dtype == verifying.dtype == np.float32
        for at in range(len(images)):
            one = where.scored(images[at : at + 1], items)
            np.testing.assert_array_equal(one.rows[0], rows[at])
            np.testing.assert_array_equal(one.verifying[0], verifying[at])


def test_edges_alone_verify_themselves(day: Traverse, night: Traverse, places: PlaceGrid) -> None:
    where = opened(Fused(trained=False), day, places)
    for items in (None, SOME):
        rows, verifying = where.scored(night.images[::9], items)
        np.testing.assert_allclose(verifying, rows, atol=1e-5)


@pytest.mark.parametrize("index", ["int8", "bits"])
def test_with_an_index_edges_verify_nearly_as_well(
    index: str, day: Traverse, night: Traverse, places: PlaceGrid
) -> None:
    images = night.images[::9]
    wanted = opened(Fused(), day, places).scored(images).verifying
    where = opened(Fused(index=index), day, places)
    np.testing.assert_allclose(where.scored(images).verifying, wanted, atol=0.1)
    np.testing.assert_allclose(where.scored(images, SOME).verifying, wanted[:, SOME], atol=0.1)


def test_a_reference_a_metre_and_none_of_a_camera_that_stands(day: Traverse, places: PlaceGrid) -> None:
    """The made street has an image every two metres."""
    assert day.track is not None
    assert len(train(day, places, Fused()).items) == len(day)
    thinned = train(day, places, Fused(every_m=5)).items
    steps = np.hypot(*np.diff(thinned.position, axis=0).T)
    assert (steps >= 5).all()
    assert thinned.t_us is not None
    standing = day.images.copy()
    standing[10:20] //= 16
    lost = dataclasses.replace(day, images=standing, track=None)
    kept = Fused().learn(lost, PlaceRuns(len(day), every=10), Learning()).images
    assert kept is not None
    assert kept.tolist() == [*range(10), *range(20, len(day))]


def test_vectors_of_other_descriptors_are_refused(day: Traverse, places: PlaceGrid) -> None:
    content = dict(Fused().learn(day, places, Learning()).content)
    about = json.loads(bytes(content[VERSIONS]))
    for wrong, words in (
        (about | {"trained": "0" * 64}, "version 000000000000 of the descriptor 'trained'"),
        ({"trained": about["trained"]}, "version None of the descriptor 'edges'"),
    ):
        content[VERSIONS] = json.dumps(wrong).encode()
        with pytest.raises(PlaceMapError, match=words):
            Fused().open(content)
    for odd in (b"[", b"[]"):
        content[VERSIONS] = odd
        with pytest.raises(PlaceMapError, match="does not say which descriptors"):
            Fused().open(content)


def test_content_that_does_not_fit_is_refused(day: Traverse, places: PlaceGrid) -> None:
    whole = dict(Fused().learn(day, places, Learning()).content)
    vectors = np.asarray(whole["edges_vectors"])
    holed = vectors.copy()
    holed[0, 0] = np.nan
    for wrong in (None, vectors[:-1], vectors[:, :-1], vectors.astype(np.float64), holed):
        content = {**whole, "edges_vectors": wrong} if wrong is not None else dict(whole)
        if wrong is None:
            del content["edges_vectors"]
        with pytest.raises(PlaceMapError, match="vectors of 'edges'"):
            Fused().open(content)


def test_settings_that_cannot_be_are_refused() -> None:
    for wrong in ({"every_m": -1.0}, {"components": 1}):
        with pytest.raises(SettingsError, match="settings of fused"):
            Fused(**wrong)


def test_a_drive_without_any_place_is_refused(places: PlaceGrid) -> None:
    lost = make_traverse(make_drive(3))
    assert lost.track is not None
    nowhere = dataclasses.replace(lost.track, easting=np.full(len(lost), np.nan))
    with pytest.raises(TraverseError, match="no image of the traverse has a place"):
        train(dataclasses.replace(lost, track=nowhere), places)
