"""Traverses for PyTorch: a map-style `Dataset`, to train networks of one's own. Needs the extra `train`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import MissingExtraError, TraverseError
from evplace.imaging.traverse import Traverse
from evplace.places import Places

try:
    import torch
    from torch.utils.data import Dataset
except ModuleNotFoundError as error:
    raise MissingExtraError("torch", "train", "a PyTorch data set") from error

__all__ = ["TraverseDataset"]


class TraverseDataset(Dataset[tuple[Any, Any]]):
    """The images of some traverses, one after the other, each with its target.

    An image is a float32 tensor (C, H, W) from 0 to 1, or what `transform` makes of the uint8 array (H, W) or
    (H, W, C). A target is the index of its place in `places`, -1 where there is none; without `places` the
    float64 tensor (2,) of easting and northing in metres, NaN where unknown. `drive` and `t_us` (n,) say of
    each image which traverse it is of, and when it was taken.
    """

    def __init__(
        self,
        traverses: Traverse | Sequence[Traverse],
        places: Places | None = None,
        transform: Callable[[NDArray[np.uint8]], Any] | None = None,
        target_transform: Callable[[Any], Any] | None = None,
    ) -> None:
        """TraverseError without any traverse, and where their images differ in shape."""
        self._traverses = [traverses] if isinstance(traverses, Traverse) else list(traverses)
        shapes = sorted({one.images.shape[1:] for one in self._traverses})
        if len(shapes) != 1:
            raise TraverseError(f"a data set is of traverses with images of one shape, these have {shapes}")
        self._transform, self._target_transform = transform, target_transform
        lengths = [len(one) for one in self._traverses]
        self._starts = np.cumsum([0, *lengths])
        self.drive = np.repeat(np.arange(len(lengths)), lengths)
        self.t_us = np.concatenate([one.t_us for one in self._traverses])
        self._xy = np.concatenate([one.xy for one in self._traverses])
        self._place = None
        if places is not None:
            self._place = np.concatenate([_places(places, one) for one in self._traverses])

    def __len__(self) -> int:
        return len(self.t_us)

    def __getitem__(self, index: int) -> tuple[Any, Any]:
        at = range(len(self))[index]
        drive = int(self.drive[at])
        image = np.array(self._traverses[drive].images[at - self._starts[drive]])
        shown = _tensor(image) if self._transform is None else self._transform(image)
        target = torch.from_numpy(self._xy[at]) if self._place is None else int(self._place[at])
        return shown, target if self._target_transform is None else self._target_transform(target)


def _places(places: Places, traverse: Traverse) -> NDArray[np.int64]:
    """(n,) the place of each image."""
    return np.asarray(places.label(places.where(traverse.xy)), np.int64)


def _tensor(image: NDArray[np.uint8]) -> torch.Tensor:
    layers = image[None] if image.ndim == 2 else np.moveaxis(image, -1, 0)
    return torch.from_numpy(np.ascontiguousarray(layers)).float() / 255
