"""The weights of `_known`, as `evplace reproduce known` fits them."""

from __future__ import annotations

import numpy as np

# fmt: off
LIVE = np.array([
    -3.9783, 0.2614, -0.5287, 0.4404, 0.5857, 0.0534, 1.1927, 0.3039,
    -1.4236, 3.0285, 0.0514, -0.4685, 0.7663,
])
"""Where nothing later is known: of 1, then of the features."""
LATE = np.array([
    -11.6586, 0.0037, -0.2097, 0.2945, 0.0677, -0.1878, 0.5268, 0.4960,
    -0.3225, 1.1540, -0.0785, 0.2108, -0.0095, -0.5261, 0.4638, 0.2092,
    1.6086, -4.8423, 5.7800, -0.8689, 2.0492,
])
"""Where what comes later is known, too."""
# fmt: on
