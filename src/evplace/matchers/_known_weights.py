"""The weights of `_known`, as `evplace reproduce known` fits them."""

from __future__ import annotations

import numpy as np

# fmt: off
LIVE = np.array([
    -3.9222, 0.2558, -0.4904, 0.3682, 0.5461, 0.0467, 1.0957, 0.2283,
    -1.1676, 2.9868, 0.0132, -0.4357, 0.8371,
])
"""Where nothing later is known: of 1, then of the features."""
LATE = np.array([
    -5.3124, -0.0711, -0.5782, 0.5449, 0.0194, -0.0619, 1.4043, 0.3300,
    -1.7404, 2.2136, 0.0386, -0.3160, 0.6192, -0.3714, 0.5208, 0.1243,
    1.2105, -0.8435, 0.3647, -0.0897, 0.4042,
])
"""Where what comes later is known, too."""
ELSEWHERE = np.array([
    0.9314, 0.9004, 0.8526, 0.7803, 0.6781, 0.4783, 0.3109, 0.1770, 0.0442,
])
"""Above these, LATE accepts SHARES of the images of places that the maps of those towns lack."""
# fmt: on
