"""The network left in training mode: its own statistics, dropout on, and the plain network without both."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from evplace.core.errors import PlaceMapError
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid
from evplace.scorers.network import Network
from evplace.scorers.notebook import Notebook

pytest.importorskip("torch", reason="the network needs the extra 'train'")


def reading(place_map: PlaceMap, batch_statistics: bool, dropout: float) -> Localizer:
    return Localizer(dataclasses.replace(place_map, scorer=Notebook(batch_statistics, dropout)), "best")


def test_with_neither_habit_it_is_the_network(network_map: PlaceMap, night: Traverse) -> None:
    plain = Localizer(network_map, "best").rows(night.images)
    np.testing.assert_allclose(reading(network_map, False, 0.0).rows(night.images), plain, atol=1e-5)


def test_a_tuned_network_is_read_as_it_was_trained(day: Traverse, places: PlaceGrid, night: Traverse) -> None:
    tuned = dataclasses.replace(Network.presets["tuned"], steps=3, batch=8)
    learned = train(day, places, tuned)
    reader = dataclasses.replace(learned, scorer=Notebook(False, 0.0, tuned))
    wanted = Localizer(reader, "best").rows(night.images)
    np.testing.assert_allclose(Localizer(learned, "best").rows(night.images), wanted, atol=1e-5)
    unscaled = dataclasses.replace(learned, scorer=Notebook(False, 0.0))
    assert not np.allclose(Localizer(unscaled, "best").rows(night.images), wanted, atol=1e-3)


def test_answers_depend_on_who_is_asked_together(network_map: PlaceMap, night: Traverse) -> None:
    where = reading(network_map, True, 0.0)
    together, alone = where.rows(night.images), where.rows(night.images[:5])
    assert not np.allclose(together[:5], alone, atol=1e-3)
    np.testing.assert_allclose(together.sum(axis=1), 1, atol=1e-5)


def test_dropout_stays_on_and_is_drawn_alike_each_time(network_map: PlaceMap, night: Traverse) -> None:
    where = reading(network_map, False, 0.5)
    first = where.rows(night.images)
    assert np.array_equal(first, where.rows(night.images))
    assert not np.allclose(first, reading(network_map, False, 0.0).rows(night.images), atol=1e-3)


def test_a_map_of_images_has_no_network(image_map: PlaceMap) -> None:
    with pytest.raises(PlaceMapError, match=r"no weights\.safetensors"):
        reading(image_map, True, 0.5)
