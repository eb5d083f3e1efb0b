"""sad, ncc, cosine and seqslam against plain twins."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from numpy.typing import NDArray

from evplace.core.errors import SettingsError
from evplace.scorers import Rows, scorer_of
from evplace.scorers._reduction import reduction, small
from evplace.scorers._seqslam_images import prepare
from evplace.scorers.cosine import Cosine
from evplace.scorers.ncc import NCC
from evplace.scorers.sad import SAD
from evplace.scorers.seqslam import SeqSLAM

Images = NDArray[np.uint8]


def images(n: int, shape: tuple[int, ...], seed: int = 0) -> Images:
    return np.random.default_rng(seed).integers(0, 256, (n, *shape), np.uint8)


def rows_of(scorer: object, references: Images, queries: Images) -> Rows:
    return scorer_of(scorer).open({"references": references}).rows(queries)


@pytest.mark.parametrize("shape", [(9, 16), (9, 16, 3)])
def test_sad_is_the_negated_mean_difference(shape: tuple[int, ...]) -> None:
    references, queries = images(6, shape), images(4, shape, seed=1)
    wanted = [[-np.abs(q.astype(int) - r).mean() for r in references] for q in queries]
    np.testing.assert_allclose(rows_of(SAD(), references, queries), wanted, rtol=1e-6)


@pytest.mark.parametrize("log", [False, True])
def test_ncc_without_blur_or_reduction_is_pearsons_correlation(log: bool) -> None:
    references, queries = images(6, (7, 7)), images(4, (7, 7), seed=1)
    rows = rows_of(NCC(sigma=0, log=log), references, queries)
    flat = [block.reshape(len(block), -1).astype(float) for block in (queries, references)]
    a, b = (np.log1p(block) if log else block for block in flat)
    np.testing.assert_allclose(rows, np.corrcoef(a, b)[:4, 4:], atol=1e-5)


def test_ncc_ignores_brightness_and_contrast_and_finds_itself() -> None:
    references = images(6, (90, 160)) // 2
    rows = rows_of(NCC(), references, (references * 1.5 + 20).astype(np.uint8))
    assert rows.argmax(axis=1).tolist() == list(range(6))
    np.testing.assert_allclose(np.diag(rows), 1, atol=1e-3)


def test_ncc_of_an_image_without_contrast_is_nothing() -> None:
    rows = rows_of(NCC(), images(3, (20, 30)), np.full((1, 20, 30), 7, np.uint8))
    assert (rows == 0).all()


@pytest.mark.parametrize("shape", [(6, 10), (5, 9), (3, 5), (2, 20), (6, 10, 3)])
def test_small_images_are_products_to_the_bit(shape: tuple[int, ...]) -> None:
    """Half the sides, which take another way, and any others."""
    images = np.random.default_rng(0).integers(0, 256, (4, *shape), np.uint8)
    grey = images.astype(np.float32)
    grey = grey if grey.ndim == 3 else grey @ np.array([0.299, 0.587, 0.114], np.float32)
    rows, columns = reduction(shape[0], 3, 0.0), reduction(shape[1], 5, 0.0)
    np.testing.assert_array_equal(small(images, 3, 5), rows @ grey @ columns.T)


def test_the_reduction_keeps_means() -> None:
    for n_in, n_out, sigma in [(90, 22, 2.0), (7, 7, 2.0), (5, 5, 0.0), (160, 40, 50.0)]:
        matrix = reduction(n_in, n_out, sigma)
        assert matrix.shape == (n_out, n_in)
        np.testing.assert_allclose(matrix.sum(axis=1), 1, atol=1e-6)


def test_settings_that_cannot_be_are_refused() -> None:
    with pytest.raises(SettingsError):
        NCC(sigma=-1)


@pytest.mark.parametrize("shape", [(9, 16), (9, 16, 3)])
def test_cosine_is_the_angle_between_pixels(shape: tuple[int, ...]) -> None:
    references, queries = images(6, shape), images(4, shape, seed=1)
    a, b = (block.reshape(len(block), -1).astype(float) for block in (queries, references))
    wanted = a @ b.T / np.outer(np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1))
    np.testing.assert_allclose(rows_of(Cosine(), references, queries), wanted, atol=1e-5)
    assert (rows_of(Cosine(), references, np.zeros((1, *shape), np.uint8)) == 0).all()


@pytest.mark.parametrize("patch", [0, 4])
def test_seqslam_compares_prepared_images(patch: int) -> None:
    references, queries = images(5, (30, 40, 3)), images(3, (30, 40, 3), seed=1)
    settings = SeqSLAM(width=16, height=8, patch=patch)
    made = [[prepare(i, (16, 8), patch=patch or None).astype(int) for i in b] for b in (queries, references)]
    wanted = [[-np.abs(q - r).mean() for r in made[1]] for q in made[0]]
    np.testing.assert_allclose(rows_of(settings, references, queries), wanted, rtol=1e-5)
    with pytest.raises(SettingsError, match="patch of 0"):
        SeqSLAM(patch=1)


@pytest.mark.parametrize("shape", [(30, 50), (30, 50, 3)])
def test_ncc_is_blurred_and_reduced_by_two_matrices(shape: tuple[int, ...]) -> None:
    rows, columns = reduction(30, 22, 2.0), reduction(50, 40, 2.0)
    taken = images(3, shape)
    small = np.einsum("ih,nhw...,jw->nij...", rows, taken.astype(np.float64), columns).reshape(3, -1)
    small -= small.mean(axis=1, keepdims=True)
    wanted = small / np.linalg.norm(small, axis=1, keepdims=True)
    np.testing.assert_allclose(NCC().describe(taken), wanted, atol=2e-6)


@pytest.mark.parametrize("scorer", [NCC(sigma=0), Cosine()])
def test_a_map_opens_in_little_more_than_it_holds(scorer: object) -> None:
    references = images(4000, (22, 40))
    scorer_of(scorer).open({"references": references[:70]})
    tracemalloc.start()
    try:
        opened = scorer_of(scorer).open({"references": references})
        held, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(opened.rows(references[:1])[0]) == 4000
    assert held >= 4 * 880 * 4000
    assert peak < 1.5 * 4 * 880 * 4000
