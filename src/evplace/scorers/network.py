"""The trained network through ONNX Runtime: softmax probabilities of places, without torch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import PlaceMapError
from evplace.placemap import PlaceMap

BATCH = 64
"""Images scored at once: larger batches gain nothing and cost memory."""


@dataclass(frozen=True)
class Settings:
    """The network has none of its own: see TrainSettings."""


class NetworkScorer:
    """One score a place."""

    distances = False

    def __init__(self, network: bytes) -> None:
        """From an ONNX graph; one thread, which is the fastest for one image at a time."""
        import onnxruntime as ort

        options = ort.SessionOptions()
        options.intra_op_num_threads = 1
        options.inter_op_num_threads = 1
        options.log_severity_level = 3
        try:
            self._session = ort.InferenceSession(network, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # onnxruntime's errors share no public base
            raise PlaceMapError(f"the map's network.onnx cannot be run: {error}") from error

    def rows(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        """See Scorer."""
        layers = images[:, None] if images.ndim == 3 else np.moveaxis(images, -1, 1)
        parts = [layers[start : start + BATCH] for start in range(0, len(layers), BATCH)]
        scores = [self._session.run(None, {"images": np.ascontiguousarray(part)})[0] for part in parts]
        return np.concatenate(scores)


def scorer(place_map: PlaceMap) -> NetworkScorer:
    """The network of a map."""
    if place_map.network is None:
        raise PlaceMapError("the map holds no network: train it with the scorer 'network'")
    return NetworkScorer(place_map.network)
