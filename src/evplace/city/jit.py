"""How the city's loops are compiled: cached on disk, no fast-math, so that a seed gives the same bits."""

from __future__ import annotations

from numba import njit

compiled = njit(cache=True, error_model="numpy")
"""Decorator of every hot loop of the city (dividing by zero gives infinity, as in numpy)."""
