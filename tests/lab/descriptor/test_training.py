"""Batches, the loss, and training that a stop does not change."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="the network needs the extra 'train'")

from evplace.scorers import Learning  # noqa: E402
from evplace.scorers._network import checkpoint  # noqa: E402
from evplace_lab.descriptor.augmentation import NOISE, _noise, augmented  # noqa: E402
from evplace_lab.descriptor.batches import Batch, Routes, draw_batch  # noqa: E402
from evplace_lab.descriptor.bursts import Bursts  # noqa: E402
from evplace_lab.descriptor.training import (  # noqa: E402
    TrainingSettings,
    as_arrays,
    info_nce,
    train_descriptor,
)

FEW = TrainingSettings(steps=4, routes=2, places=3, bfloat16=False)


@pytest.fixture(scope="module")
def towns() -> list[Bursts]:
    """Two made-up towns: a picture of its own for each place, with noise in each drive."""
    rng = np.random.default_rng(0)
    made = []
    for _ in range(2):
        places = rng.integers(0, 200, (2, 1, 9, 1, 45, 80))
        images = places + rng.integers(0, 50, (2, 3, 9, 2, 45, 80))
        poses = np.zeros((2, 3, 9, 3), np.float32)
        poses[..., 0] = 30 * np.arange(9)
        made.append(Bursts(images.astype(np.uint8), poses))
    return made


def test_a_batch_depends_on_seed_and_step_alone(towns: list[Bursts]) -> None:
    routes = Routes.of(towns, "cpu")
    one, again = (draw_batch(routes, 5, 7, 2, 3) for _ in range(2))
    np.testing.assert_array_equal(one.images, again.images)
    assert not np.array_equal(one.images, draw_batch(routes, 5, 8, 2, 3).images)
    assert not np.array_equal(one.images, draw_batch(routes, 6, 7, 2, 3).images)


def test_a_batch_has_each_place_in_every_drive(towns: list[Bursts]) -> None:
    batch = draw_batch(Routes.of(towns, "cpu"), 0, 0, 2, 3)
    assert batch.images.shape == (2 * 3 * 3, 45, 80)
    assert batch.route.tolist() == [0] * 9 + [1] * 9


def test_noise_lights_a_share_of_the_dark_in_some_images() -> None:
    torch.manual_seed(2)
    lit = _noise(torch.zeros(200, 45, 80)).mean((1, 2))
    assert 0.25 < float((lit > 0.001).float().mean()) < 0.55
    assert 0.1 < float(lit.max()) < NOISE + 0.02


def test_augmented_images_are_others_in_the_same_range() -> None:
    images = torch.full((64, 45, 80), 100.0)
    images[:, :, 40:] = 0
    torch.manual_seed(1)
    seen = augmented(images)
    assert seen.shape == images.shape
    assert seen.min() >= 0
    assert seen.max() <= 255
    assert all((one != other).any() for one, other in zip(seen, images, strict=True))


def loss(vectors: list[list[float]], x: list[float], route: list[int]) -> float:
    poses = torch.zeros(len(x), 3)
    poses[:, 0] = torch.tensor(x)
    batch = Batch(torch.zeros(len(x), 45, 80), poses, torch.tensor(route))
    return float(info_nce(torch.tensor(vectors), batch))


ALIKE = [[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]]


def test_images_of_one_place_shall_be_alike() -> None:
    assert loss(ALIKE, [0, 1, 100, 101], [0, 0, 0, 0]) < 0.01
    assert loss(ALIKE, [0, 100, 1, 101], [0, 0, 0, 0]) > 5


def test_two_routes_never_share_a_place() -> None:
    assert loss(ALIKE, [0, 1, 0, 1], [0, 0, 1, 1]) < 0.01


def test_nothing_is_said_of_what_is_neither_near_nor_far() -> None:
    between = loss([[1.0, 0.0], [1.0, 0.0], [1.0, 0.0]], [0, 1, 15], [0, 0, 0])
    assert between < 0.01


def test_training_twice_gives_the_same_weights(towns: list[Bursts]) -> None:
    one, again = (as_arrays(train_descriptor(towns, FEW, Learning())) for _ in range(2))
    for name, value in one.items():
        np.testing.assert_array_equal(value, again[name], name)


def test_a_stopped_training_ends_in_the_same_weights(
    towns: list[Bursts], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checkpoint, "EVERY", 2)
    whole = as_arrays(train_descriptor(towns, FEW, Learning()))

    def stop(step: int, *_: object) -> None:
        if step == 3:
            raise KeyboardInterrupt

    kept = tmp_path / "training.safetensors"
    with pytest.raises(KeyboardInterrupt):
        train_descriptor(towns, FEW, Learning(stop, kept), "these")
    other: list[int] = []
    copied = shutil.copy(kept, tmp_path / "copied.safetensors")
    train_descriptor(towns, FEW, Learning(lambda step, *_: other.append(step), copied), "those")
    assert other[0] == 1
    steps: list[int] = []
    resumed = train_descriptor(towns, FEW, Learning(lambda step, *_: steps.append(step), kept), "these")
    assert steps == [3, 4]
    for name, value in as_arrays(resumed).items():
        np.testing.assert_array_equal(value, whole[name], name)
    assert not kept.exists()
