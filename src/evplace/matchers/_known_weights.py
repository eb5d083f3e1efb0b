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
    -9.2097, 0.0025, -0.1441, 0.2024, 0.0465, -0.1291, 0.3620, 0.3409,
    -0.2217, 0.7931, -0.0540, 0.1449, -0.0065, -0.3616, 0.3188, 0.1438,
    1.1055, -3.3278, 3.9723, -0.5971, 1.4083, 0.0898, -0.1817, 0.1513,
    0.2013, 0.0183, 0.4098, 0.1044, -0.4892, 1.0407, 0.0177, -0.1610,
    0.2633,
])
"""Where what comes later is known, too."""
# fmt: on
