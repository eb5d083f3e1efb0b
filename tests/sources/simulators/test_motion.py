"""Image motion, against blobs that move by known amounts."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from evplace.sources.simulators.motion import image_motion


def blob(at: float) -> NDArray[np.float32]:
    y, x = np.mgrid[:48, :64]
    return (0.05 + np.exp(-((x - at) ** 2 + (y - 24.0) ** 2) / 60.0)).astype(np.float32)


def test_motion_is_measured_in_pixels() -> None:
    for pixels in (0.25, 0.5, 1.0):
        assert image_motion(blob(30), blob(30 + pixels)) == pytest.approx(pixels, rel=0.45)
    assert image_motion(blob(20), blob(34)) > 2.0
    assert image_motion(blob(30), blob(30)) == 0.0
