"""The weights of `_known`, as `evplace reproduce known` fits them."""

from __future__ import annotations

import numpy as np

# fmt: off
LIVE = np.array([
    -3.7648, 0.2492, -0.5106, 0.3069, 0.5451, 0.0775, 1.1635, 0.2415,
    -1.4991, 3.1034, 0.0697, -0.4300, 0.8503,
])
"""Where nothing later is known: of 1, then of the features."""
LATE = np.array([
    -5.2455, -0.0975, -0.5453, 0.4855, 0.0131, 0.0060, 1.3694, 0.3254,
    -1.6989, 2.0304, -0.0004, -0.3073, 0.6649, -0.3552, 0.4924, 0.1613,
    1.2208, -0.8425, 0.1830, -0.0748, 0.4268,
])
"""Where what comes later is known, too."""
# fmt: on
