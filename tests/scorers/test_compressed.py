"""Vectors in fewer numbers."""

from __future__ import annotations

import numpy as np

from evplace.scorers._compressed import compress


def test_with_as_many_components_as_references_nothing_is_lost() -> None:
    rng = np.random.default_rng(0)
    references = rng.standard_normal((40, 200)).astype(np.float32)
    queries = rng.standard_normal((7, 200)).astype(np.float32)
    found = compress(references, 384)
    np.testing.assert_allclose(found.rows(queries), queries @ references.T, atol=1e-3)
    np.testing.assert_allclose(found.basis.T @ found.basis, np.eye(found.basis.shape[1]), atol=1e-4)


def test_with_fewer_the_most_is_kept() -> None:
    rng = np.random.default_rng(0)
    scale = 0.8 ** np.arange(100)
    references = (rng.standard_normal((300, 100)) * scale).astype(np.float32)
    found = compress(references, 24)
    assert found.vectors.shape == (300, 24)
    error = np.abs(found.rows(references) - references @ references.T).max()
    assert error < 0.01 * np.abs(references @ references.T).max()


def test_references_that_are_all_alike_or_nothing() -> None:
    for references in (np.zeros((5, 8), np.float32), np.ones((5, 8), np.float32)):
        np.testing.assert_allclose(
            compress(references, 4).rows(references), references @ references.T, atol=1e-5
        )
