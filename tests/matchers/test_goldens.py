"""What the original programs answered, on four scenes of ours and on the one that comes with one of them."""

from __future__ import annotations

import functools
import re
from pathlib import Path

import numpy as np
import pytest

from evplace.matchers import open_matcher
from evplace.matchers.seqslam import SeqSLAM, offsets_of, sequence_scores
from evplace.scorers._seqslam_images import normalise_patches

GOLDEN = Path(__file__).parents[1] / "golden"
SCENES = ["tiny", "randwalk", "loop", "unmatched"]
LARGE = SCENES[1:]


@functools.cache
def answers_on(scene: str) -> dict[str, np.ndarray]:
    """What the originals were given and what they answered; tests/golden/README.md names the arrays."""
    arrays = dict(np.load(GOLDEN / f"{scene}.npz"))
    if "D" not in arrays:  # too large to keep beside the images that it is made of
        reference, query = (arrays[name].astype(np.int32) for name in ("ref_img", "qry_img"))
        arrays["D"] = np.abs(reference[:, None] - query[None]).mean(axis=2).astype(np.float32)
    return arrays


def under(scene: str, prefix: str) -> dict[str, np.ndarray]:
    found = answers_on(scene)
    return {key.split("|")[1]: value for key, value in found.items() if key.startswith(f"{prefix}|")}


def graph_as(run: str):
    tool, way, K, alpha, m = re.fullmatch(r"(\w+)-(\w+)__K(\d+)_a([\d.]+)_m([\d.]+)", run).groups()
    preset = "opr" if tool == "opr" else "isl"  # vpr_relocalization answers as image_sequence_localizer
    way = {"all": "all", "default": "window", "na": "none"}[way]
    return open_matcher("graph", preset, K=int(K), alpha=float(alpha), m=float(m), relocalise=way)


def assert_graph(similarities, run, item, real, cost_calls) -> None:
    graph = graph_as(run)
    graph.extend(similarities)
    np.testing.assert_array_equal(graph.path().item, item, run)
    np.testing.assert_array_equal(graph.path().accepted, real, run)
    if run.startswith("opr"):
        assert graph.evaluated == cost_calls


@pytest.mark.parametrize("scene", SCENES)
def test_graph(scene) -> None:
    answers = answers_on(scene)
    assert len(answers["graph_runs"]) == 195
    for run, item, real, calls in zip(
        *(answers[f"graph_{key}"] for key in ("runs", "item", "real", "cost_calls")), strict=True
    ):
        assert_graph(answers["S"], run, item, real, calls)


def assert_openseqslam2(differences: np.ndarray, answers: dict[str, np.ndarray]) -> None:
    """`differences` is (references, queries), as the original has it; its references count from 1.

    Of a large scene the scores of every eighth query are kept, and of all queries which are defined.
    """
    for key in (key for key in answers if key.endswith("__min_scores")):
        run = key.removesuffix("__min_scores")
        method, ds, low, high = re.fullmatch(r"(\w+)_ds(\d+)_v(\w+)_(\w+)", run).groups()
        settings = SeqSLAM(
            ds=int(ds),
            v_min=float(low.replace("p", ".")),
            v_max=float(high.replace("p", ".")),
            search="trajectory" if method == "traj" else method,
        )
        np.testing.assert_array_equal(offsets_of(settings), answers[f"{run}__offsets_r"], run)
        ours, theirs = sequence_scores(-differences.T, settings), answers[key].T
        np.testing.assert_array_equal(~np.isnan(ours), answers[f"{run}__defined"].T, run)
        every = -(-len(ours) // len(theirs))
        np.testing.assert_allclose(ours[::every], theirs, rtol=0, atol=1e-4, err_msg=run)
        assert_openseqslam2_matches(differences, settings, answers, run)


def assert_openseqslam2_matches(differences, settings, answers, run) -> None:
    seqslam = open_matcher("seqslam", "openseqslam2", **vars(settings))
    seqslam.extend(-differences.T)
    path = seqslam.path()
    nothing = ~answers[f"{run}__defined"].any(0)
    best = np.where(nothing, -1, answers[f"{run}__best_ref"] - 1)
    np.testing.assert_array_equal(path.item, best, run)
    np.testing.assert_allclose(path.score, answers[f"{run}__u"], rtol=1e-4, err_msg=run)
    selected = np.nan_to_num(answers[f"{run}__sel_window_u1p111"]) - 1
    np.testing.assert_array_equal(np.where(path.accepted, path.item, -1), selected, run)


@pytest.mark.parametrize("scene", SCENES)
def test_openseqslam2(scene) -> None:
    assert_openseqslam2(answers_on(scene)["D"], under(scene, "openseqslam2"))


@pytest.mark.parametrize("scene", LARGE)
def test_openseqslam2_threshold_selection(scene) -> None:
    answers = under(scene, "openseqslam2")
    threshold = float(answers["traj_ds15_v0p8_1p2__thr"][0])
    seqslam = open_matcher("seqslam", selection="threshold", threshold=threshold)
    seqslam.extend(-answers_on(scene)["D"].T)
    path = seqslam.path()
    clear = ~(np.abs(-path.score - threshold) < 1e-4)  # the threshold is one of the scores, rounded
    theirs = np.nan_to_num(answers["traj_ds15_v0p8_1p2__sel_thresh"]) - 1
    np.testing.assert_array_equal(np.where(path.accepted, path.item, -1)[clear], theirs[clear])


def assert_openseqslam2013(differences: np.ndarray, answers: dict[str, np.ndarray]) -> None:
    for key in (key for key in answers if key.startswith("matches")):
        ds, low, high = re.fullmatch(r"matches_ds(\d+)(?:to\d+)?_v(\w+)_(\w+)", key).groups()
        velocities = {"v_min": float(low.replace("p", ".")), "v_max": float(high.replace("p", "."))}
        seqslam = open_matcher("seqslam", "openseqslam2013", ds=int(ds), **velocities)
        seqslam.extend(-differences.T)
        path = seqslam.path()
        np.testing.assert_array_equal(path.item, np.nan_to_num(answers[key][:, 0]) - 1, key)
        np.testing.assert_allclose(1 / path.score, answers[key][:, 1], atol=1e-5, err_msg=key)


@pytest.mark.parametrize("scene", SCENES)
def test_openseqslam2013(scene) -> None:
    assert_openseqslam2013(answers_on(scene)["D"], under(scene, "openseqslam2013"))


def test_patch_normalisation_to_the_bit() -> None:
    patches = under("tiny", "patches")
    images = patches["images"]
    np.testing.assert_array_equal(normalise_patches(images, mode="deviation"), patches["mode1"])
    np.testing.assert_array_equal(normalise_patches(images, mode="range"), patches["mode0"])


def assert_dp(scores, distances, K, m, path) -> None:
    """`path` is latest first, begins with a target beyond the last query and lacks the node (0, 0)."""
    search = open_matcher("dp", "ism", distances=distances, K=K, m=m)
    search.extend(scores)
    ours = np.stack([np.arange(len(scores)), search.path().item], 1)
    ours = ours[(ours != 0).any(1)]
    np.testing.assert_array_equal(ours, path[:0:-1])


@pytest.mark.parametrize("scene", SCENES)
def test_full_search(scene) -> None:
    similarities = answers_on(scene)["S"].astype(np.float64)
    for key, path in under(scene, "dp").items():
        K, m = re.fullmatch(rf"{scene}_K(\d+)_m([\d.]+)_path", key).groups()
        assert_dp(similarities, False, int(K), float(m), path)


def test_full_search_on_the_shipped_example(golden) -> None:
    answers = dict(np.load(golden / "image_sequence_matcher.npz"))
    assert_dp(-answers["example_cost"], True, 5, 6.0, answers["example_K5_m6.0_path"])
    search = open_matcher("dp", "ism", distances=True)
    search.extend(-answers["example_cost"])
    hidden = answers["example_K5_m6.0_hidden"]
    assert sorted(np.flatnonzero(~search.path().accepted)) == sorted(hidden[:, 0])
