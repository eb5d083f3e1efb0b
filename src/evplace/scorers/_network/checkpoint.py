"""The state of a training run in one safetensors file, so that a killed run goes on where it stopped."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor, nn
from torch.optim import Optimizer

from evplace.core.storage import new_file

EVERY = 100
"""Steps between two saves."""


def fingerprint(settings: object, labels: NDArray[np.int64], images: NDArray[np.uint8]) -> str:
    """What makes two runs the same run: settings, labels, and a sample of the images."""
    sample = np.ascontiguousarray(images[:: max(1, len(images) // 16)])
    return hashlib.sha256(repr(settings).encode() + labels.tobytes() + sample.tobytes()).hexdigest()


class Checkpoint:
    """Saves and restores weights and the optimiser's state; without a path it does nothing."""

    def __init__(self, path: Path | None, run: str) -> None:
        """For the run with the fingerprint `run`; other runs' files at `path` are passed over."""
        self._path = path
        self._run = run

    def load(self, network: nn.Module, optimiser: Optimizer) -> int:
        """Restore the saved step of this run and return its number; 0 where there is none."""
        if self._path is None or not self._path.exists():
            return 0
        try:
            with safe_open(self._path, "pt") as file:
                metadata = file.metadata() or {}
                tensors = {name: file.get_tensor(name) for name in list(file.keys())}
        except SafetensorError:
            return 0
        if metadata.get("run") != self._run:
            return 0
        prefix = "network."
        network.load_state_dict({k[len(prefix) :]: v for k, v in tensors.items() if k.startswith(prefix)})
        optimiser.load_state_dict({**optimiser.state_dict(), "state": _optimiser_state(tensors)})
        return int(metadata["step"])

    def keep(self, step: int, network: nn.Module, optimiser: Optimizer) -> None:
        """Save every `EVERY` steps, replacing the save before."""
        if self._path is None or step % EVERY:
            return
        tensors = {f"network.{name}": value.contiguous() for name, value in network.state_dict().items()}
        for index, values in optimiser.state_dict()["state"].items():
            tensors |= {f"optimiser.{index}.{key}": value.contiguous() for key, value in values.items()}
        with new_file(self._path, overwrite=True) as partial:
            partial.write_bytes(save(tensors, {"run": self._run, "step": str(step)}))

    def remove(self) -> None:
        """The run is over: nothing is left to go on with."""
        if self._path is not None:
            self._path.unlink(missing_ok=True)


def _optimiser_state(tensors: dict[str, Tensor]) -> dict[int, dict[str, Tensor]]:
    state: dict[int, dict[str, Tensor]] = {}
    for name, value in tensors.items():
        kind, _, rest = name.partition(".")
        if kind == "optimiser":
            index, _, key = rest.partition(".")
            state.setdefault(int(index), {})[key] = value
    return state
