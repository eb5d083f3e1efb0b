"""Traverses as a PyTorch data set."""

from __future__ import annotations

import dataclasses
import importlib
import sys

import numpy as np
import pytest

from evplace.core.errors import MissingExtraError, TraverseError
from evplace.imaging.traverse import Traverse
from evplace.places import PlaceGrid

torch = pytest.importorskip("torch", reason="torch is not installed")


def test_images_and_targets_of_several_traverses(day: Traverse, night: Traverse, places: PlaceGrid) -> None:
    from evplace.torch import TraverseDataset

    found = TraverseDataset([day, night], places)
    assert len(found) == len(day) + len(night)
    image, place = found[len(day) + 3]
    assert image.shape == (1, *night.images.shape[1:])
    assert image.dtype == torch.float32
    np.testing.assert_array_equal(image.numpy()[0] * 255, night.images[3])
    assert place == places.label(places.where(night.xy))[3]
    assert found[-1][1] == found[len(found) - 1][1]
    assert found.drive.tolist() == [0] * len(day) + [1] * len(night)
    with pytest.raises(IndexError):
        found[len(found)]
    batches = list(torch.utils.data.DataLoader(found, batch_size=16))
    assert batches[0][0].shape == (16, 1, *day.images.shape[1:])
    assert batches[0][1].dtype == torch.int64


def test_positions_where_no_places_are_given_and_own_transforms(day: Traverse) -> None:
    from evplace.torch import TraverseDataset

    colour = dataclasses.replace(day, images=np.repeat(np.asarray(day.images)[..., None], 3, axis=3))
    image, xy = TraverseDataset(colour)[2]
    assert image.shape[0] == 3
    np.testing.assert_array_equal(xy.numpy(), day.xy[2])
    mean, east = TraverseDataset(day, None, lambda one: one.mean(), lambda at: at[0])[2]
    assert mean == np.asarray(day.images[2]).mean()
    assert float(east) == day.xy[2, 0]
    with pytest.raises(TraverseError, match="of one shape"):
        TraverseDataset([day, colour])
    with pytest.raises(TraverseError, match="of one shape"):
        TraverseDataset([])


def test_without_torch_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.delitem(sys.modules, "evplace.torch", raising=False)
    with pytest.raises(MissingExtraError, match=r"pip install 'evplace\[train\]'"):
        importlib.import_module("evplace.torch")
