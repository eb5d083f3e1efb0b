from __future__ import annotations

import numpy as np
import pytest

from evplace.core.errors import InputError
from evplace.scorers._distances import blocks, ncc, sad, ssd

RNG = np.random.default_rng(0)
QUERIES = RNG.integers(0, 256, (21, 32, 48), np.uint8)
REFERENCES = RNG.integers(0, 256, (19, 32, 48), np.uint8)


def pairs() -> np.ndarray:
    return QUERIES[:, None].astype(np.float64) - REFERENCES[None]


def test_sad_is_the_mean_absolute_difference() -> None:
    np.testing.assert_array_equal(sad(QUERIES, REFERENCES), np.abs(pairs()).mean((2, 3)).astype(np.float32))


def test_ssd_of_bytes_is_exact() -> None:
    np.testing.assert_array_equal(ssd(QUERIES, REFERENCES), np.square(pairs()).sum((2, 3)).astype(np.float32))
    assert (np.diag(ssd(QUERIES, QUERIES)) == 0).all()


def test_ssd_of_floats() -> None:
    q, r = QUERIES / np.float32(255), REFERENCES / np.float32(255)
    np.testing.assert_allclose(ssd(q, r), np.square(q[:, None] - r[None]).sum((2, 3)), rtol=1e-4)


def test_ncc_is_the_correlation_and_0_for_flat_images() -> None:
    q, r = QUERIES.reshape(21, -1), REFERENCES.reshape(19, -1)
    np.testing.assert_allclose(ncc(QUERIES, REFERENCES), np.corrcoef(q, r)[:21, 21:], atol=1e-5)
    assert (ncc(np.full((2, 8, 8), 7, np.uint8), REFERENCES[:, :8, :8]) == 0).all()


@pytest.mark.parametrize("measure", [sad, ssd, ncc])
@pytest.mark.parametrize("limit_bytes", [1, 500, 1 << 20])
def test_blocks_are_the_table_in_pieces(measure, limit_bytes) -> None:
    pieces = list(blocks(QUERIES, REFERENCES, measure, limit_bytes))
    assert all(piece.nbytes <= max(limit_bytes, 4 * len(REFERENCES)) for piece in pieces)
    np.testing.assert_allclose(np.concatenate(pieces), measure(QUERIES, REFERENCES), atol=1e-6)


def test_images_that_cannot_be_compared_are_refused() -> None:
    with pytest.raises(InputError, match="resize them to one size"):
        sad(QUERIES, REFERENCES[:, :5])
    with pytest.raises(InputError, match="uint8"):
        sad(QUERIES.astype(np.float32), REFERENCES)
    with pytest.raises(InputError, match="arrays of numbers"):
        ncc(np.zeros((3, 0), np.uint8), np.zeros((3, 0), np.uint8))


def test_the_sum_of_a_huge_image_fits() -> None:
    """More than 32 bits hold."""
    assert sad(np.zeros((1, 3, 1 << 22), np.uint8), np.full((1, 3, 1 << 22), 255, np.uint8)) == 255
