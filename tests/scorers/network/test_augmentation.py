"""Another light: from torch's random state alone, within full scale, and different for each image."""

from __future__ import annotations

import pytest

torch = pytest.importorskip("torch", reason="the network needs the extra 'train'")

from evplace.scorers._network.augmentation import GAINS, in_another_light  # noqa: E402 - needs torch


def test_the_same_state_gives_the_same_light() -> None:
    images = torch.rand(4, 3, 9, 16)
    torch.manual_seed(1)
    first = in_another_light(images)
    torch.manual_seed(1)
    assert torch.equal(first, in_another_light(images))
    assert not torch.equal(first, in_another_light(images))


def test_light_stays_within_full_scale_and_differs_between_images() -> None:
    torch.manual_seed(0)
    lit = in_another_light(torch.full((200, 3, 8, 8), 0.5))
    assert lit.shape == (200, 3, 8, 8)
    assert lit.min() >= 0
    assert lit.max() <= 1
    levels = lit.mean(dim=(1, 2, 3))
    assert levels.min() < 0.5 * GAINS[0] * 4
    assert levels.max() > 0.5
