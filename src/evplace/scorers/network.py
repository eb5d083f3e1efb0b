"""The paper's network (Table 1): one score a place. Training needs torch; answering does not.

The weights are kept as safetensors, and as the ONNX graph that answers.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import MissingExtraError, PlaceMapError, SettingsError
from evplace.imaging.traverse import Traverse
from evplace.places import Places
from evplace.scorers import Content, Learned, Learning, usable

BATCH = 64
"""Images scored at once: larger batches gain nothing and cost memory."""
MOST_S = 10.0
"""Seconds after which a network that scores one image is stopped."""
GRAPH, WEIGHTS = "network.onnx", "weights.safetensors"


@dataclass(frozen=True)
class Network:
    """How the network is trained; a score is the softmax probability of a place."""

    last_relu: bool = False
    """ReLU on the last layer (paper, Table 1: yes). Off by default: a place whose logit falls below zero gets
    no gradient from its own images any more."""
    own_scale: bool = False
    """Divide each image by its own root mean square, so that more or fewer events all over change nothing
    (paper: not mentioned)."""
    dropout: float = 0.0
    """Share of activations dropped before each fully connected layer (paper: not mentioned)."""
    label_smoothing: float = 0.0
    """Share of each image's label that all places get alike (paper: not mentioned)."""
    optimiser: Literal["adam", "sgd"] = "adam"
    """adam or sgd (paper: not said; 0.001 is Adam's usual rate)."""
    learning_rate: float = 0.001
    """(paper: 0.001)"""
    schedule: Literal["constant", "cosine"] = "constant"
    """cosine: the learning rate falls along half a cosine, to nearly nothing at the last step."""
    weight_decay: float = 0.0
    """How much all weights shrink in a step, in learning rates (AdamW; paper: not mentioned)."""
    batch: int = 64
    """Images in a step (paper: 64)."""
    steps: int = 1000
    """Steps of one batch each (paper: "1000 iterations")."""
    epochs: int = 0
    """If above 0, this many passes over all images in place of `steps`."""
    seed: int = 0
    """Draws the first weights and the order of the images."""
    augment: Literal["none", "light", "events"] = "none"
    """What is done to each image of a batch (ours; see `augmentation`). light: another light, for camera
    images; events: shifts, lost events, noise and things in the way, for event images."""
    precision: Literal["auto", "float32", "bfloat16"] = "auto"
    """auto takes bfloat16 where the processor has it: with channels-last 2.4 times plain float32."""

    def __post_init__(self) -> None:
        for name in ("learning_rate", "batch", "steps"):
            if getattr(self, name) <= 0:
                raise SettingsError(
                    f"the setting '{name}' cannot be {getattr(self, name)}: it must be above 0"
                )
        for name in ("epochs", "seed", "weight_decay"):
            if not getattr(self, name) >= 0:
                raise SettingsError(f"the setting '{name}' cannot be {getattr(self, name)}: it is 0 or more")
        if not 0 <= self.label_smoothing < 1:
            raise SettingsError(
                f"the setting 'label_smoothing' cannot be {self.label_smoothing}: it takes 0 to below 1"
            )

    presets: ClassVar[Mapping[str, Network]]

    def require(self) -> None:
        """MissingExtraError where what trains it is not installed."""
        for package in ("torch", "onnx"):
            try:
                __import__(package)
            except ImportError as error:
                raise MissingExtraError(package, "train", "training the network") from error

    def learn(self, reference: Traverse, places: Places, learning: Learning) -> Learned:
        """See Scorer; a run that was killed goes on from its checkpoint and ends in the same weights."""
        labels, used = usable(reference, places)
        from safetensors.numpy import save

        from evplace.scorers._network.network_onnx import onnx_bytes
        from evplace.scorers._network.training import image_shape, train_network

        weights = train_network(reference.images, labels, used, places.n, self, learning)
        graph = onnx_bytes(weights, image_shape(reference.images), self.last_relu, self.own_scale)
        return Learned({GRAPH: graph, WEIGHTS: save(weights)})

    def open(self, content: Content) -> NetworkRows:
        """See Scorer."""
        return NetworkRows(file_of(content, GRAPH))


Network.presets = {
    "paper": Network(last_relu=True),
    "notebook": Network(dropout=0.5, optimiser="sgd", epochs=1000),
    "tuned": Network(
        own_scale=True, label_smoothing=0.1, schedule="cosine", weight_decay=0.01, augment="events"
    ),
}
"""paper: as printed. notebook: as the author's published notebook does. tuned: ours, for event images."""


TrainSettings = Network
"""Its name at the front door."""


class NetworkRows:
    """See OpenScorer: through ONNX Runtime, without torch."""

    distances = False

    def __init__(self, network: bytes) -> None:
        """From an ONNX graph; one thread, which is the fastest for one image at a time."""
        import onnxruntime as ort

        from evplace.scorers._network.network_onnx import INPUT, check_graph

        check_graph(network)
        options = ort.SessionOptions()
        options.intra_op_num_threads = 1
        options.inter_op_num_threads = 1
        options.log_severity_level = 3
        try:
            # With a fallback, which would be the same processor again, it prints to the standard output.
            how = {"providers": ["CPUExecutionProvider"], "enable_fallback": 0}
            self._session = ort.InferenceSession(network, options, **how)
        except Exception as error:  # onnxruntime's errors share no public base
            raise _unfit(error) from error
        if [one.name for one in self._session.get_inputs()] != [INPUT]:
            raise PlaceMapError(f"the map's {GRAPH} does not take '{INPUT}' alone")
        _try(self._session)

    def rows(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        """See OpenScorer."""
        layers = images[:, None] if images.ndim == 3 else np.moveaxis(images, -1, 1)
        parts = [layers[start : start + BATCH] for start in range(0, len(layers), BATCH)]
        try:
            scores = [self._session.run(None, {"images": np.ascontiguousarray(part)})[0] for part in parts]
            return np.concatenate(scores)
        except Exception as error:  # likewise; so is a graph that fits neither these images nor itself
            raise _unfit(error) from error


def _try(session: Any) -> None:
    """Run a network once on a black image, in bounded time; PlaceMapError where it gives no row of scores."""
    import onnxruntime as ort

    from evplace.scorers._network.network_onnx import INPUT, MOST_PIXELS

    shape = session.get_inputs()[0].shape[1:]
    sizes = [side for side in shape if type(side) is int and side > 0]
    if len(shape) != 3 or len(sizes) != 3 or math.prod(sizes) > MOST_PIXELS:
        raise PlaceMapError(f"the map's {GRAPH} takes images of shape {shape!r}, which none has")
    how = ort.RunOptions()
    late = threading.Timer(MOST_S, lambda: setattr(how, "terminate", True))
    late.start()
    try:
        scores = session.run(None, {INPUT: np.zeros((1, *shape), np.uint8)}, how)[0]
    except Exception as error:  # onnxruntime's errors share no public base
        raise _unfit(error) from error
    finally:
        late.cancel()
    if scores.ndim != 2 or len(scores) != 1 or scores.dtype != np.float32:
        raise PlaceMapError(f"the map's {GRAPH} gives {scores.dtype} {scores.shape}, not a row of scores")


def file_of(content: Content, name: str) -> bytes:
    """A file of a map with a network; PlaceMapError where it holds none."""
    found = content.get(name)
    if not isinstance(found, bytes):
        raise PlaceMapError(f"the map holds no {name}: train it with the scorer 'network'")
    return found


def _unfit(error: Exception) -> PlaceMapError:
    reason = " ".join(str(error).split())[:300]
    return PlaceMapError(f"the map's {GRAPH} cannot be run: {reason}")
