"""The trained network as the author's published notebook runs it: left in training mode.

There `eval()` is never called: batch norm takes the statistics of the queries, all in one batch, in place of
those of the training, and dropout stays on. Answers then depend on which queries are asked together, so this
is for comparison only; it needs torch.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from evplace.imaging.traverse import Traverse
from evplace.places import Places
from evplace.scorers import Content, Learned, Learning, Rows
from evplace.scorers.network import WEIGHTS, Network, file_of

SEED = 0
"""Draws what dropout drops."""


@dataclass(frozen=True)
class Notebook:
    """Which of the two habits to follow; a score is the softmax probability of a place."""

    batch_statistics: bool = True
    """Normalise by the queries' own statistics (notebook: yes)."""
    dropout: float = 0.5
    """Share of activations dropped before each fully connected layer while answering (notebook: 0.5)."""
    network: Network = field(default_factory=Network)
    """How the network is trained."""

    def learn(self, reference: Traverse, places: Places, learning: Learning) -> Learned:
        """See Scorer."""
        return self.network.learn(reference, places, learning)

    def require(self) -> None:
        """MissingExtraError where what trains the network is not installed."""
        self.network.require()

    def open(self, content: Content) -> NotebookRows:
        """See Scorer; MissingExtraError without torch."""
        self.require()
        return NotebookRows(file_of(content, WEIGHTS), self)


class NotebookRows:
    """See OpenScorer."""

    distances = False

    def __init__(self, weights: bytes, settings: Notebook) -> None:
        """From a network's weights as safetensors."""
        from safetensors.torch import load

        from evplace.scorers._network.network import NetworkSettings, network_of

        trained = settings.network
        of_network = NetworkSettings(trained.last_relu, settings.dropout, trained.own_scale)
        self._network = network_of(load(weights), of_network).eval()
        self._network.dropout.train(settings.dropout > 0)
        for norm in (self._network.norm1, self._network.norm2):
            norm.train(settings.batch_statistics)

    def rows(self, images: NDArray[np.uint8]) -> Rows:
        """See OpenScorer; all of `images` are one batch."""
        import torch

        from evplace.scorers._network.network import to_input

        torch.manual_seed(SEED)
        with torch.inference_mode():
            rows: Rows = torch.softmax(self._network(to_input(images)), dim=1).numpy()
        return rows
