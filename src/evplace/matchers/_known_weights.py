"""The weights of `_known`, as `evplace reproduce known` fits them."""

from __future__ import annotations

import numpy as np

LIVE = np.zeros(13)
"""Where nothing later is known: of 1, then of the features."""
LATE = np.zeros(21)
"""Where what comes later is known, too."""
