"""What a network sees in an image, trained once and for all on made towns and halls; its weights come along.

It knows no place of any map: it has learned which two event images show the same place, whatever the light,
the weather and the sensor (`evplace reproduce descriptor` makes it anew). Answering needs no torch.
"""

from __future__ import annotations

import functools
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import InputError, TraverseError
from evplace.core.storage import read_bytes, read_json
from evplace.scorers._reduction import small

FOLDER = Path(__file__).parent / "_trained"
WEIGHTS, ABOUT = "descriptor.onnx", "descriptor.json"
INPUT, OUTPUT = "images", "vectors"
HEIGHT, WIDTH = 45, 80
"""Rows and columns of what the network sees."""
DIMENSIONS = 256
FLAT = 1e-3
"""An image whose grey levels differ by no more than this has no contrast."""


@dataclass(frozen=True)
class Trained:
    """The descriptor has no settings; scores go from -1 to 1."""

    @property
    def version(self) -> str:
        """The checksum of the weights: vectors of other weights cannot be compared with these."""
        return _shipped().checksum

    def describe(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        """(n, h, w) or (n, h, w, C) uint8 of any size -> (n, 256), of length 1; 0 where there is no contrast.

        Raises TraverseError for other arrays.
        """
        return _shipped().describe(images)


class DescriptorGraph:
    """A network that describes images, as `evplace reproduce descriptor` writes it."""

    def __init__(self, folder: Path) -> None:
        """Of the weights in a folder; InputError where they are not those that its description is of."""
        about = read_json(folder / ABOUT, "the description of a descriptor")
        content = read_bytes(folder / WEIGHTS, "the weights of a descriptor")
        self.checksum = hashlib.sha256(content).hexdigest()
        if self.checksum != about.get("sha256"):
            raise InputError(
                f"{folder / WEIGHTS} is not the file that {ABOUT} beside it describes: "
                "install or make it again"
            )
        self._session = _session(content)

    def describe(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        """See `Trained`. Each image for itself, so that its vector does not depend on what else is asked."""
        if images.dtype != np.uint8 or images.ndim not in (3, 4) or 0 in images.shape[1:]:
            raise TraverseError(
                f"images must be uint8 (n, h, w) or (n, h, w, C), these are {images.dtype} {images.shape}"
            )
        vectors = np.zeros((len(images), DIMENSIONS), np.float32)
        for number in range(len(images)):
            seen = np.ascontiguousarray(small(images[number : number + 1], HEIGHT, WIDTH))
            if np.ptp(seen) > FLAT:
                vectors[number] = self._session.run(None, {INPUT: seen})[0][0]
        return vectors


@functools.cache
def _shipped() -> DescriptorGraph:
    return DescriptorGraph(FOLDER)


def _session(graph: bytes) -> Any:
    """ONNX Runtime on one thread, which is the fastest for one image at a time."""
    import onnxruntime as ort

    options = ort.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.log_severity_level = 3
    how = {"providers": ["CPUExecutionProvider"], "enable_fallback": 0}
    return ort.InferenceSession(graph, options, **how)
