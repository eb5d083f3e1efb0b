"""What is done to training images: from torch's random state alone, within full scale, each image its own."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch", reason="the network needs the extra 'train'")

from evplace.scorers._network import augmentation  # noqa: E402 - needs torch
from evplace.scorers._network.augmentation import GAINS, augmented  # noqa: E402

KINDS = ("light", "events")


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_state_gives_the_same_images(kind: str) -> None:
    images = torch.rand(4, 3, 9, 16)
    torch.manual_seed(1)
    first = augmented(images, kind)
    torch.manual_seed(1)
    assert torch.equal(first, augmented(images, kind))
    assert not torch.equal(first, augmented(images, kind))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("shape", [(30, 1, 90, 160), (30, 3, 9, 16), (30, 1, 8, 8), (1, 5, 33, 70)])
def test_images_of_any_size_stay_within_full_scale(kind: str, shape: tuple[int, ...]) -> None:
    images = torch.rand(shape)
    given = images.clone()
    changed = augmented(images, kind)
    assert changed.shape == shape
    assert changed.min() >= 0
    assert changed.max() <= 1
    assert changed.is_contiguous(memory_format=torch.channels_last)
    assert torch.equal(images, given)


def test_nothing_is_nothing() -> None:
    images = torch.rand(2, 1, 8, 8)
    before = torch.get_rng_state()
    assert augmented(images, "none") is images
    assert torch.equal(torch.get_rng_state(), before)


def test_light_differs_between_images() -> None:
    torch.manual_seed(0)
    levels = augmented(torch.full((200, 3, 8, 8), 0.5), "light").mean(dim=(1, 2, 3))
    assert levels.min() < 0.5 * GAINS[0] * 4
    assert levels.max() > 0.5


def test_shifts_reach_12_columns_and_6_rows_and_mirror_the_border() -> None:
    torch.manual_seed(0)
    image = torch.arange(90)[:, None] * 1000.0 + torch.arange(160)
    moved = augmentation.shifted(image.expand(500, 1, 90, 160))[:, 0]
    down = (moved[:, 45, 80] // 1000).int() - 45
    across = (moved[:, 45, 80] % 1000).int() - 80
    assert set(across.tolist()) == set(range(-12, 13))
    assert set(down.tolist()) == set(range(-6, 7))
    for one, row, column in zip(moved[:50], down.tolist(), across.tolist(), strict=False):
        rows, columns = torch.arange(90) + row, torch.arange(160) + column
        rows = torch.where(rows > 89, 178 - rows, rows.abs())
        columns = torch.where(columns > 159, 318 - columns, columns.abs())
        assert torch.equal(one, image[rows][:, columns])


def test_events_are_lost_from_no_pixel_to_half_of_them() -> None:
    torch.manual_seed(0)
    lost = 1 - augmentation.thinned(torch.ones(300, 2, 20, 20)).mean(dim=(1, 2, 3))
    assert 0.2 < (lost == 0).float().mean() < 0.4
    assert 0.4 < lost.max() < 0.6


def test_noise_only_adds_events() -> None:
    torch.manual_seed(0)
    images = 0.5 * torch.rand(300, 1, 20, 20)
    added = augmentation.noisy(images) - images
    assert added.min() == 0
    some = (added > 0).flatten(1).any(1).float().mean()
    assert 0.5 < some < 0.8
    assert augmentation.noisy(torch.zeros(300, 1, 20, 20)).max() <= 1


def test_blocks_hide_a_part_below_the_sky_of_some_images() -> None:
    torch.manual_seed(0)
    hidden = augmentation.hidden(torch.ones(300, 1, 90, 160))[:, 0] == 0
    some = hidden.flatten(1).any(1)
    assert 0.5 < some.float().mean() < 0.7
    assert not hidden[:, :20].any()
    for block in hidden[some]:
        rows, columns = (block.any(1 - axis).sum().item() for axis in (0, 1))
        assert block.sum() == rows * columns
        assert 14 <= rows <= 46
        assert 19 <= columns <= 71
