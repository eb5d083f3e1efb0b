"""CPU time of the matchers against plain numpy forms, in alternation; the originals' own times beside them.

    OMP_NUM_THREADS=1 python bench/bench_matchers.py [--quick]

The originals' figures were measured elsewhere, on a like machine, each on a matrix of its own.
"""

from __future__ import annotations

import sys

import numpy as np

import plain_matchers as plain
from evplace.matchers import open_matcher
from evplace.matchers.seqslam import SeqSLAM, offsets_of
from evplace.scorers._distances import sad
from harness import alternate, report


def drive(items: int, noise: float = 0.35, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Cosine similarities in 0..1 of a drive with stops and leaps along `items` references; where it is."""
    rng = np.random.default_rng(seed)
    at = np.cumsum(rng.choice([0, 1, 1, 1, 2], items)) % items
    references = rng.normal(size=(items, 64)).astype(np.float32)
    queries = references[at] + noise * rng.normal(size=(items, 64)).astype(np.float32)
    for features in (references, queries):
        features /= np.linalg.norm(features, axis=1, keepdims=True)
    return (1 + queries @ references.T) / 2, at


def whole(name: str, scores: np.ndarray, **values: object) -> np.ndarray:
    matcher = open_matcher(name, **values)
    matcher.extend(scores)
    return matcher.path().item


def bench_graph(items: int, rounds: int) -> None:
    similarities, at = drive(items)
    for alpha, original in ((0.7, "24-36 s"), (0.1, "not measured")):
        ours = whole("graph", similarities, preset="opr", alpha=alpha, memory=1000)
        assert (ours == plain.graph(similarities, 5, alpha)).all()
        times = alternate(
            {
                "evplace graph": lambda a=alpha: whole(
                    "graph", similarities, preset="opr", alpha=a, memory=1000
                ),
                "evplace dp (exact)": lambda: whole("dp", similarities),
                "plain Python and numpy": lambda a=alpha: plain.graph(similarities, 5, a),
            },
            rounds,
        )
        right = (np.abs(ours - at) <= 3).mean()
        report(
            f"graph {items} x {items}, alpha {alpha} (original C++: {original}; {right:.1%} within 3)", times
        )


def bench_seqslam(items: int, rounds: int) -> None:
    scores = drive(items)[0] - 1
    distances = -scores
    offsets = offsets_of(SeqSLAM())
    assert (whole("seqslam", scores)[7:-7] == plain.seqslam(distances, offsets)).mean() > 0.999
    times = alternate(
        {
            "evplace, openseqslam2": lambda: whole("seqslam", scores),
            "evplace, openseqslam2013": lambda: whole("seqslam", scores, preset="openseqslam2013"),
            "plain numpy, openseqslam2": lambda: plain.seqslam(distances, offsets),
        },
        rounds,
    )
    report(
        f"SeqSLAM enhance and search {items} x {items} "
        "(originals: OpenSeqSLAM 2013 in Octave 51 s at 2000 x 2000, pySeqSLAM 28 s at 1000 x 1000)",
        times,
    )


def bench_sad(items: int, rounds: int) -> None:
    images = np.random.default_rng(0).integers(0, 256, (2, items, 32 * 64), np.uint8)
    part = images[0][: max(1, items // 25)]
    times = alternate(
        {"evplace": lambda: sad(part, images[1]), "numpy": lambda: plain.sad(part, images[1])}, rounds
    )
    report(f"SAD {len(part)} x {items} images of 64 x 32", times)
    report(f"SAD {items} x {items}", alternate({"evplace": lambda: sad(*images)}, max(1, rounds // 2)))


def bench_local(frames: int, rounds: int) -> None:
    p = 0.2 * np.random.default_rng(0).dirichlet(np.full(104, 0.05), frames).astype(np.float32)
    at = np.arange(frames) // 14 % 104
    p[np.arange(frames), at] += 0.8
    p[::50] = 0.001  # now and then lost, until a place scores above tau1
    p[3::50, at[3::50]] = 0.995
    assert (whole("local", p) == plain.algorithm_1(p)).all()
    times = alternate({"evplace": lambda: whole("local", p), "numpy": lambda: plain.algorithm_1(p)}, rounds)
    report(f"Algorithm 1, {frames} frames of 104 places, a frame", times, 1e-6 * frames, "us")


def bench_online(references: int, frames: int) -> None:
    rng = np.random.default_rng(0)
    rows = rng.uniform(0.1, 0.5, (frames, references)).astype(np.float32)
    rows[np.arange(frames), 1000 + np.arange(frames)] = 0.9

    def each(name: str, **values: object) -> None:
        matcher = open_matcher(name, **values)
        for row in rows:
            matcher.step(row)

    times = alternate(
        {
            "seqslam": lambda: each("seqslam"),
            "graph, alpha 0.3": lambda: each("graph"),
            "graph, alpha 0.1": lambda: each("graph", alpha=0.1),
            "hmm": lambda: each("hmm"),
            "local": lambda: each("local"),
        },
        3,
    )
    report(f"online, {references} references, one row at a time, a frame", times, 1e-3 * frames, "ms")


if __name__ == "__main__":
    quick = "--quick" in sys.argv
    items, rounds = (1000, 3) if quick else (5000, 5)
    bench_graph(items, rounds)
    bench_seqslam(items, rounds)
    bench_sad(items, rounds)
    bench_local(10 * items, rounds)
    bench_online(2 * items, 300)
