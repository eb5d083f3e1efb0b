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
    -10.3450, 0.0274, -0.2128, 0.2825, 0.0754, -0.2255, 0.4252, 0.4585,
    -0.2353, 1.3402, -0.0553, 0.1769, 0.0262, -0.5804, 0.4045, 0.1933,
    1.8575, -4.6992, 5.5932, -0.8174, 1.8358,
])
"""Where what comes later is known, too."""
# fmt: on
