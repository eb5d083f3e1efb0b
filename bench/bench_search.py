"""How references are searched: memory, time and recall of each way, at 100,000 to 10,000,000 references.

    python bench/bench_search.py --describe streets.npz city/day-1 city/night-1 ...    once, from traverses
    python bench/bench_search.py streets.npz [--references 1000000] [--searchers bits faiss]

Vectors are those of `bench/streets.py`. A query is right where what is found is on the right street and
within 20 m. Each way is built in one process and asked in another, which opens it from the disk; one thread.
Memory is what the asking process has gained, with all pages of files that it has touched.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.storage import read_array, write_array
from evplace.imaging.averaging import Averaging, averaged
from evplace.imaging.traverse import Traverse
from evplace.scorers._compressed import compress
from evplace.scorers._indexed import _spread
from evplace.scorers.edges import Edges
from evplace.scorers.fused import WEIGHTS
from evplace.scorers.trained import Trained
from evplace.searchers import ABOUT, kept, opened
from harness import processor
from streets import RIGHT, STREET, Drives, Streets

BLOCK = 100_000
TOP = 10
NEAR_M, LIKE_DEG = 3.0, 20.0
"""A later image so near to a reference, and looking so, sees the same."""


def described(drives: list[Path]) -> Drives:
    """Of traverses TOWN/DRIVE or TOWN/DRIVE/SENSOR; of each town the drive day-1 is the reference."""
    towns: dict[Path, dict[str, tuple[NDArray, NDArray, Traverse]]] = {}
    for path in drives:
        drive = Traverse.load(path)
        filled = np.flatnonzero(drive.counts != 0)
        images = averaged(drive.images[filled], drive.t_us[filled], Averaging())
        edges = np.concatenate([Edges().describe(images[at : at + 64]) for at in range(0, len(images), 64)])
        name = path.parent if path.name in ("ideal", "weak", "from-8bit") else path
        towns.setdefault(name.parent, {})[name.name] = (edges, Trained().describe(images), drive[filled])
    references = [town["day-1"] for town in towns.values()]
    parts = [
        compress(np.concatenate([one[part] for one in references]), many)
        for part, many in ((0, 256), (1, 128))
    ]
    share = [
        weight / _spread(part.vectors, part.vectors[::11])
        for weight, part in zip((WEIGHTS["edges"], WEIGHTS["trained"]), parts, strict=True)
    ]

    def beside(one: tuple[NDArray, NDArray, Traverse]) -> NDArray:
        return np.concatenate([s * (v @ p.basis) for s, v, p in zip(share, one, parts, strict=False)], axis=1)

    both = compress(np.concatenate([beside(one) for one in references]), 256)
    seen, again, first = [], [], 0
    for town in towns.values():
        for name, one in town.items():
            at, same = nearest(town["day-1"][2], one[2])
            if name != "day-1":
                seen.append(first + at[same])
                again.append((beside(one) @ both.basis)[same])
        first += len(town["day-1"][2])
    town = np.repeat(np.arange(len(references)), [len(one[2]) for one in references])
    return Drives(both.vectors, town, np.concatenate(seen), np.concatenate(again).astype(np.float32))


def nearest(reference: Traverse, drive: Traverse) -> tuple[NDArray, NDArray]:
    """(images,) the reference nearest to each image of a drive that looks the same way; and where one is."""
    away = np.hypot(*(drive.xy[:, None] - reference.xy[None]).transpose(2, 0, 1))
    turn = drive.track.heading_deg[:, None] - reference.track.heading_deg[None]
    away[np.abs((turn + 180) % 360 - 180) > LIKE_DEG] = np.inf
    at = away.argmin(axis=1)
    return at, away[np.arange(len(at)), at] <= NEAR_M


def exact(streets: Streets, items: int, queries: NDArray) -> NDArray:
    """(queries,) the best of all references."""
    best, found = np.full(len(queries), -np.inf), np.zeros(len(queries), np.int64)
    for first in range(0, items, BLOCK):
        rows = queries @ streets.references(first, min(BLOCK, items - first)).T
        at = rows.argmax(axis=1)
        better = rows[np.arange(len(at)), at] > best
        found[better], best[better] = first + at[better], rows[np.arange(len(at)), at][better]
    return found


def build(streets: Streets, items: int, name: str, folder: Path) -> None:
    """Build, save and say what it took."""
    part = families.make("searchers", name)
    many = min(items, 1_000_000)
    vectors = np.concatenate([streets.references(at, BLOCK) for at in range(0, many, BLOCK)])
    began = time.process_time()
    searching = part.build(vectors)
    took = time.process_time() - began
    del vectors
    for first in range(many, items, BLOCK * 10):
        more = np.concatenate([streets.references(first + at, BLOCK) for at in range(0, BLOCK * 10, BLOCK)])
        began = time.process_time()
        searching.add(more)
        took += time.process_time() - began
    for key, value in kept(part, searching).items():
        file = folder / (key if key == ABOUT else f"{key}.npy")
        file.write_bytes(value) if key == ABOUT else write_array(file, value)
    size = sum(file.stat().st_size for file in folder.iterdir())
    print(f"{name}: built in {took:.0f} s of CPU, {size / 1e6:.0f} MB on disk", flush=True)


def content_of(folder: Path) -> dict[str, object]:
    """What was saved, mapped into memory."""
    arrays = {file.stem: read_array(file, "the index", memory_mapped=True) for file in folder.glob("*.npy")}
    return arrays | {ABOUT: (folder / ABOUT).read_bytes()}


def ask(folder: Path, asked: Path) -> None:
    """Open what was saved, ask it, and say what it took."""
    with np.load(asked) as arrays:
        queries, true, best = arrays["queries"], arrays["true"], arrays["best"]
    about = json.loads((folder / ABOUT).read_bytes())
    warm = families.make("searchers", about["searcher"])
    warm.build(queries[:50]).top(queries[:2], TOP)  # compiles and imports
    before, began = memory_mb(), time.perf_counter()
    searching = opened(content_of(folder), about["items"], about["dimensions"])
    took_open = 1e3 * (time.perf_counter() - began)
    took, found = [], np.zeros(len(queries), np.int64)
    for at in range(len(queries)):
        began = time.thread_time()
        found[at] = searching.top(queries[at : at + 1], TOP).items[0, 0]
        took.append(1e3 * (time.thread_time() - began))
    after = memory_mb()
    low, middle, high = np.quantile(took[3:], (0.1, 0.5, 0.9))
    share, whole = (right(one, true) for one in (found, best))
    print(
        f"{about['searcher']}, {about['items']} x {about['dimensions']}: {middle:.2f} ms ({low:.2f} to "
        f"{high:.2f}), recall@1 {share:.3f} of {whole:.3f} = {share / whole:.3f}, the same reference "
        f"{(found == best).mean():.3f}; opened in {took_open:.0f} ms; {after[0] - before[0]:.0f} MB, of "
        f"which no file's {after[1] - before[1]:.0f}",
        flush=True,
    )


def right(found: NDArray, true: NDArray) -> float:
    """The share that is on the right street and near."""
    return float(((np.abs(found - true) <= RIGHT) & (found // STREET == true // STREET)).mean())


def memory_mb() -> tuple[float, float]:
    """All of this process, and what no file stands behind."""
    lines = Path("/proc/self/status").read_text().splitlines()
    held = {
        line.split(":")[0]: int(line.split()[1]) / 1e3
        for line in lines
        if line.startswith(("VmRSS", "RssAnon"))
    }
    return held["VmRSS"], held["RssAnon"]


def main() -> None:
    """Print two lines for each number of references and each searcher."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("streets", type=Path)
    flags.add_argument("--describe", type=Path, nargs="+", help="traverses to make the vectors of")
    flags.add_argument("--references", type=int, nargs="+", default=[100_000, 1_000_000])
    flags.add_argument("--searchers", nargs="+", default=["exact", "int8", "bits", "faiss"])
    flags.add_argument("--queries", type=int, default=500)
    flags.add_argument("--build", type=Path, help="build in this process")
    flags.add_argument("--ask", type=Path, nargs=2, help="ask in this process")
    args = flags.parse_args()
    if args.describe:
        np.savez(args.streets, **vars(described(args.describe)))
        return
    if args.ask:
        ask(*args.ask)
        return
    streets = Streets(Drives.load(args.streets))
    if args.build:
        build(streets, args.references[0], args.searchers[0], args.build)
        return
    print(f"{processor()}, load {os.getloadavg()[0]:.1f}", flush=True)
    alone = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    for items in args.references:
        with tempfile.TemporaryDirectory() as folder:
            queries, true = streets.queries(args.queries, items)
            asked = Path(folder) / "asked.npz"
            np.savez(asked, queries=queries, true=true, best=exact(streets, items, queries))
            for name in args.searchers:
                to = Path(folder) / name
                to.mkdir()
                again = [
                    sys.executable,
                    __file__,
                    str(args.streets),
                    "--references",
                    str(items),
                    "--searchers",
                    name,
                ]
                subprocess.run([*again, "--build", str(to)], check=True, env=alone)
                subprocess.run([*again, "--ask", str(to), str(asked)], check=True, env=alone)


if __name__ == "__main__":
    main()
