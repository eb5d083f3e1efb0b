"""Robust z-scores."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from evplace.core.zscores import robust_z


@given(st.integers(2, 400), st.floats(0.01, 1e4), st.floats(-1e3, 1e3), st.integers(0, 99))
def test_scale_and_offset_change_nothing(items: int, scale: float, offset: float, seed: int) -> None:
    row = np.random.default_rng(seed).standard_normal(items)
    np.testing.assert_allclose(robust_z(scale * row + offset), robust_z(row), atol=0.02)


def test_it_is_the_usual_z_of_a_normal_row_and_a_peak_changes_no_other() -> None:
    row = np.random.default_rng(0).standard_normal(20_000)
    np.testing.assert_allclose(robust_z(row), row, atol=0.1)
    peaked = row.copy()
    peaked[7] = 1e6
    np.testing.assert_allclose(np.delete(robust_z(peaked), 7), np.delete(robust_z(row), 7), atol=0.01)


def test_a_row_without_any_difference_is_zero() -> None:
    for row in (np.zeros(5), np.full(9, 0.3), np.array([4.0]), np.array([-1e-30, 0.0])):
        assert (robust_z(row) == 0).all()
        assert robust_z(row).dtype == np.float32
