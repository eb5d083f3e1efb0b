"""The weights of `_known`, as `evplace reproduce known` fits them."""

from __future__ import annotations

import numpy as np

# fmt: off
LIVE = np.array([
    -3.5131, 0.2666, -0.6049, 0.3884, 0.6106, 0.0356, 1.3727, 0.3023,
    -1.4483, 3.2700, 0.0390, -0.4556, 0.7585,
])
"""Where nothing later is known: of 1, then of the features."""
LATE = np.array([
    -4.8344, -0.0122, -0.5856, 0.4840, -0.0365, -0.1494, 1.8420, 0.3789,
    -1.9672, 2.1761, 0.0445, -0.2456, 0.5033, -0.4013, 0.3699, 0.0638,
    1.5022, -0.9026, 0.7968, -0.0992, 0.4070,
])
"""Where what comes later is known, too."""
ELSEWHERE = np.array([
    0.9537, 0.9304, 0.8844, 0.8267, 0.7311, 0.5627, 0.3943, 0.2220, 0.0490,
])
"""Above these, LATE accepts SHARES of the images of places that the maps of those towns lack."""
# fmt: on
