"""The trained network as the author's published notebook runs it: left in training mode.

There `eval()` is never called: batch norm takes the statistics of the queries, all in one batch, in place of
those of the training, and dropout stays on. Answers then depend on which queries are asked together, so this
is for comparison only; it needs torch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import PlaceMapError
from evplace.core.settings import make
from evplace.placemap import PlaceMap

SEED = 0
"""Draws what dropout drops."""


@dataclass(frozen=True)
class Settings:
    """Which of the two habits to follow."""

    batch_statistics: bool = True
    """Normalise by the queries' own statistics (notebook: yes)."""
    dropout: float = 0.5
    """Share of activations dropped before each fully connected layer while answering (notebook: 0.5)."""


class NotebookScorer:
    """One score a place."""

    distances = False

    def __init__(self, place_map: PlaceMap, settings: Settings) -> None:
        """From a map with a network's weights."""
        import torch

        from evplace.scorers._network.network import Network, NetworkSettings
        from evplace.scorers._network.training import image_shape

        height, width, *channels = place_map.image_shape
        shape = image_shape(np.empty((0, height, width, *channels), np.uint8))
        last_relu = place_map.settings["train"]["last_relu"]
        network = Network(place_map.places.n, shape, NetworkSettings(last_relu, settings.dropout))
        weights = {name: torch.from_numpy(value) for name, value in place_map.weights.items()}
        network.load_state_dict(weights, strict=False)  # but for the counts of batches, which nothing reads
        self._network = network.eval()
        self._network.dropout.train(settings.dropout > 0)
        for norm in (network.norm1, network.norm2):
            norm.train(settings.batch_statistics)

    def rows(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        """See Scorer; all of `images` are one batch."""
        import torch

        from evplace.scorers._network.network import to_input

        torch.manual_seed(SEED)
        with torch.inference_mode():
            rows: NDArray[np.float32] = torch.softmax(self._network(to_input(images)), dim=1).numpy()
        return rows


def scorer(place_map: PlaceMap) -> NotebookScorer:
    """The network of a map."""
    if place_map.network is None:
        raise PlaceMapError("the map holds no network: train it with the scorer 'network'")
    return NotebookScorer(place_map, make(Settings, place_map.settings["scorer"]))
