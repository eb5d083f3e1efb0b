"""Learn a route: one drive and its places -> a PlaceMap.

The network's loop reads from top to bottom in `train_network`. Every batch depends on the seed and the step
alone, so a run that was killed goes on from its checkpoint and ends in the same weights.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from evplace.core import settings as settings_room
from evplace.core.errors import SettingsError, TraverseError
from evplace.imaging.traverse import Traverse
from evplace.placemap import Items, PlaceMap
from evplace.places import Places

if TYPE_CHECKING:
    import torch

    from evplace.scorers._network.network import Network

Progress = Callable[[int, int, float], None]
"""Called with (step, steps, loss) after each step."""


@dataclass(frozen=True)
class TrainSettings:
    """How the network is trained."""

    last_relu: bool = False
    """ReLU on the last layer (paper, Table 1: yes). Off by default: a place whose logit falls below zero gets
    no gradient from its own images any more."""
    dropout: float = 0.0
    """Share of activations dropped before each fully connected layer (paper: not mentioned)."""
    optimiser: Literal["adam", "sgd"] = "adam"
    """adam or sgd (paper: not said; 0.001 is Adam's usual rate)."""
    learning_rate: float = 0.001
    """(paper: 0.001)"""
    batch: int = 64
    """Images in a step (paper: 64)."""
    steps: int = 1000
    """Steps of one batch each (paper: "1000 iterations")."""
    epochs: int = 0
    """If above 0, this many passes over all images in place of `steps`."""
    seed: int = 0
    """Draws the first weights and the order of the images."""
    augment: Literal["none", "light"] = "none"
    """light: each image of a batch in another light (ours; see `augmentation`). For camera images."""
    precision: Literal["auto", "float32", "bfloat16"] = "auto"
    """auto takes bfloat16 where the processor has it: with channels-last 2.4 times plain float32."""

    def __post_init__(self) -> None:
        for name in ("learning_rate", "batch", "steps"):
            if getattr(self, name) <= 0:
                raise SettingsError(
                    f"the setting '{name}' cannot be {getattr(self, name)}: it must be above 0"
                )
        if self.epochs < 0 or self.seed < 0:
            raise SettingsError("the settings 'epochs' and 'seed' cannot be below 0")


PRESETS = {
    "paper": TrainSettings(last_relu=True),
    "notebook": TrainSettings(dropout=0.5, optimiser="sgd", epochs=1000),
}
"""paper: as printed. notebook: as the author's published notebook does."""


KEPT = ("source", "input", "sensor", "windows", "images", "cleaning", "spacing")
"""What a map keeps of how its traverse was made."""
TRAINED = ("network", "notebook")
"""Scorers whose map is a trained network; to all others the images themselves are the map."""


def train(
    day: Traverse,
    places: Places,
    scorer: str = "network",
    settings: TrainSettings | None = None,
    progress: Progress | None = None,
    checkpoint: Path | None = None,
    scorer_settings: dict[str, Any] | None = None,
    **values: object,
) -> PlaceMap:
    """Learn the map of `places` from the traverse `day`.

    `scorer` is network (trained), or one such as ncc, to which the images themselves are the map; `values`
    are fields of TrainSettings, over those of `settings`. With `checkpoint`, a file name, training goes on
    where a killed run of the same settings and images stopped. Raises TraverseError where no image has a
    place.
    """
    settings = settings_room.make(TrainSettings, values, settings)
    labels = places.label(places.where(day.xy))
    used = (labels >= 0) & (day.counts != 0)
    if not used.any():
        raise TraverseError("no image of the traverse has a place: check its track and its times")
    description = {
        **{key: day.info.get(key) for key in KEPT},
        "image_shape": list(day.images.shape[1:]),
        "zone": [day.track.zone, day.track.northern] if day.track is not None else None,
        "scorer": scorer_settings or {},
    }
    heading = day.track.heading_deg if day.track is not None else np.full(len(day), np.nan)
    drive = np.column_stack([day.xy, heading])[used]
    if scorer not in TRAINED:
        items = Items(labels[used], drive[:, :2], drive[:, 2])
        return PlaceMap(scorer, places, items, drive, description, references=np.asarray(day.images[used]))
    from evplace.scorers._network.network_onnx import onnx_bytes

    weights = train_network(day.images, labels, used, places.n, settings, progress, checkpoint)
    description["train"] = settings_room.to_dict(settings)
    network = onnx_bytes(weights, image_shape(day.images), settings.last_relu)
    return PlaceMap(scorer, places, _place_items(places), drive, description, network, weights)


def train_network(
    images: NDArray[np.uint8],
    labels: NDArray[np.int64],
    used: NDArray[np.bool_],
    n_places: int,
    settings: TrainSettings,
    progress: Progress | None = None,
    checkpoint: Path | None = None,
) -> dict[str, NDArray[np.float32]]:
    """Train Table 1 on the images (n, h, w[, C]) that are `used`; returns its weights by name."""
    import torch
    from torch.nn.functional import cross_entropy

    from evplace.scorers._network.augmentation import in_another_light
    from evplace.scorers._network.checkpoint import Checkpoint, fingerprint
    from evplace.scorers._network.network import Network, NetworkSettings, to_input, weights_of

    torch.manual_seed(settings.seed)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    network = Network(n_places, image_shape(images), NetworkSettings(settings.last_relu, settings.dropout))
    # torch's own types know no `to` with a device and a memory format, which it has.
    network.to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]
    optimiser = _optimiser(network, settings)
    chosen = np.flatnonzero(used)
    steps = settings.steps if not settings.epochs else settings.epochs * -(-len(chosen) // settings.batch)
    saved = Checkpoint(checkpoint, fingerprint(settings, labels, images))
    first = saved.load(network, optimiser)
    network.train()
    for step, batch in enumerate(
        batches(len(chosen), settings.batch, settings.seed, first, steps), first + 1
    ):
        torch.manual_seed(settings.seed + step)  # what is drawn, too, depends on the step alone
        index = np.sort(chosen[batch])
        target = torch.from_numpy(labels[index]).to(device)
        inputs = to_input(images[index], device)
        if settings.augment == "light":
            inputs = in_another_light(inputs)
        with torch.autocast(device, torch.bfloat16, enabled=_bfloat16(settings, device)):
            loss = cross_entropy(network(inputs), target)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        if progress is not None:
            progress(step, steps, float(loss.detach()))
        saved.keep(step, network, optimiser)
    saved.remove()
    return weights_of(network)


def batches(n: int, size: int, seed: int, first: int, steps: int) -> Iterator[NDArray[np.int64]]:
    """The batches of steps `first` .. `steps`-1: each pass a new shuffle, its last batch smaller."""
    per_pass = -(-n // size)
    for step in range(first, steps):
        order = np.random.default_rng([seed, step // per_pass]).permutation(n)
        start = step % per_pass * size
        yield order[start : start + size]


def image_shape(images: NDArray[np.uint8]) -> tuple[int, int, int]:
    """(C, h, w) of a stack of images (n, h, w) or (n, h, w, C)."""
    return (images.shape[3] if images.ndim == 4 else 1, images.shape[1], images.shape[2])


def _optimiser(network: Network, settings: TrainSettings) -> torch.optim.Optimizer:
    import torch

    kind = torch.optim.Adam if settings.optimiser == "adam" else torch.optim.SGD
    return kind(network.parameters(), lr=settings.learning_rate)


def _bfloat16(settings: TrainSettings, device: str) -> bool:
    import torch

    if settings.precision != "auto":
        return settings.precision == "bfloat16"
    if device == "cuda":
        return bool(torch.cuda.is_bf16_supported())
    capability = torch.backends.cpu.get_cpu_capability()
    return capability.startswith("AVX512") and bool(torch.ops.mkldnn._is_mkldnn_bf16_supported())


def _place_items(places: Places) -> Items:
    centres = places.centres()
    return Items(np.arange(places.n), centres, np.full(places.n, np.nan))
