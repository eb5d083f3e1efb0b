"""From the events of one window to its image: ours against numpy + OpenCV, tonic, dv-processing and evutils.

python bench/bench_images.py [RECORDING ...]      real recordings besides the generated events

Each peer gets its own kind of events, made before the clock starts, and the same work: a binary image at the
sensor's size, blurred 3x3, without its bottom quarter, resized to 160x90 by area. evutils has no resize, so
its accumulation stands against our `add` alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from fractions import Fraction
from functools import partial
from pathlib import Path

import cv2
import dv_processing as dv
import evutils.types
import numpy as np
import tonic.transforms
from evutils.dense import frame_gray
from numpy.typing import NDArray

from evplace.core.events import Events, Size
from evplace.imaging.images import Imager
from evplace.imaging.windows import TimeWindows
from evplace.sources.readers import open_recording
from harness import alternate, report

SET = 0.17
"""Share of the pixels that one generated window sets."""
WINDOWS = 10
REPEATS = 20
"""Passes over the windows in one timing."""


def generated(size: Size) -> list[Events]:
    """Windows of events at random pixels."""
    rng = np.random.default_rng(0)
    n = round(-np.log(1 - SET) * size[0] * size[1])
    return [
        Events.of(
            np.sort(rng.integers(0, 33_333, n)), rng.integers(0, size[0], n), rng.integers(0, size[1], n),
            rng.random(n) < 0.5, size,
        )
        for _ in range(WINDOWS)
    ]  # fmt: skip


def recorded(path: Path) -> list[Events]:
    """A recording's first whole windows of 1/30 s."""
    recording = open_recording(path)
    cutter, pieces, windows = TimeWindows(Fraction(1, 30)), [], []
    for packet in recording.packets():
        for piece, window in cutter.push(packet):
            pieces.append(piece)
            if window is not None:
                windows.append(Events.concatenate(pieces))
                pieces = []
        if len(windows) >= WINDOWS:
            break
    return windows[:WINDOWS]


def share_set(windows: list[Events]) -> float:
    """Mean share of the pixels at which a window has events."""
    pixels = windows[0].size[0] * windows[0].size[1]
    distinct = [len(np.unique(w.y.astype(np.int64) * w.size[0] + w.x)) for w in windows]
    return float(np.mean(distinct)) / pixels


def small(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Blur, crop and resize as OpenCV does it."""
    blurred = cv2.GaussianBlur(image, (3, 3), 0)
    return cv2.resize(blurred[: len(image) * 3 // 4], (160, 90), interpolation=cv2.INTER_AREA)


def with_ours(imager: Imager, events: Events) -> NDArray[np.uint8]:
    imager.add(events)
    return imager.image(0)


def with_numpy(events: Events) -> NDArray[np.uint8]:
    image = np.zeros(events.size[::-1], np.uint8)
    image[events.y, events.x] = 255
    return small(image)


def with_tonic(to_image: Callable[..., NDArray[np.int16]], events: NDArray[np.void]) -> NDArray[np.uint8]:
    return small((to_image(events).sum(axis=0) > 0).astype(np.uint8) * np.uint8(255))


def with_dv(accumulator: dv.EdgeMapAccumulator, events: dv.EventStore) -> NDArray[np.uint8]:
    accumulator.accept(events)
    return small(accumulator.generateFrame().image)


def add_ours(imager: Imager, events: Events) -> None:
    imager.add(events)
    imager._grid.clear()


def add_evutils(events: evutils.types.EventArray, size: Size) -> None:
    frame_gray(events, size[0], size[1])


def structured(events: Events) -> NDArray[np.void]:
    fields = [("t", np.int64), ("x", np.int16), ("y", np.int16), ("p", np.bool_)]
    array = np.empty(len(events), fields)
    array["t"], array["x"], array["y"], array["p"] = events.t_us, events.x, events.y, events.p
    return array


def stored(events: Events) -> dv.EventStore:
    store = dv.EventStore()
    fields = (events.t_us, events.x, events.y, events.p)
    for event in zip(*(field.tolist() for field in fields), strict=True):
        store.push_back(*event)
    return store


def calls(windows: list[Events]) -> dict[str, list[Callable[[], object]]]:
    """Each peer's name and what it does for each window."""
    size = windows[0].size
    imager = Imager(size)
    to_image = tonic.transforms.ToImage(sensor_size=(*size, 2))
    accumulator = dv.EdgeMapAccumulator(size, 1.0)
    arrays = [evutils.types.EventArray(t=w.t_us, x=w.x, y=w.y, p=w.p.astype(np.int8)) for w in windows]
    return {
        "ours": [partial(with_ours, imager, w) for w in windows],
        "numpy + OpenCV": [partial(with_numpy, w) for w in windows],
        "tonic + OpenCV": [partial(with_tonic, to_image, structured(w)) for w in windows],
        "dv-processing + OpenCV": [partial(with_dv, accumulator, stored(w)) for w in windows],
        "ours, add alone": [partial(add_ours, imager, w) for w in windows],
        "evutils, frame_gray": [partial(add_evutils, a, size) for a in arrays],
    }


def check(work: dict[str, list[Callable[[], object]]]) -> None:
    """All images must be alike: within OpenCV's roundings to whole grey values (blur, then resize)."""
    ours = np.asarray(work["ours"][0](), np.int64)
    for name, (first, *_) in work.items():
        if "OpenCV" in name and np.abs(np.asarray(first(), np.int64) - ours).max() > 2:
            raise SystemExit(f"{name} makes another image than ours")


def run_all(functions: list[Callable[[], object]], repeats: int) -> None:
    for _ in range(repeats):
        for function in functions:
            function()


def bench(title: str, windows: list[Events]) -> None:
    work = calls(windows)
    check(work)
    slow = {"tonic + OpenCV": 1}
    images = {n: len(windows) * slow.get(n, REPEATS) for n in work}
    timings = alternate({n: partial(run_all, f, slow.get(n, REPEATS)) for n, f in work.items()}, rounds=7)
    each = {name: type(t)(tuple(s / images[name] for s in t.seconds)) for name, t in timings.items()}
    mean, (width, height) = sum(map(len, windows)) / len(windows), windows[0].size
    share = share_set(windows)
    title = (
        f"{title}: {width}x{height}, {len(windows)} windows of {mean:,.0f} events, {share:.1%} of pixels set"
    )
    names = list(each)
    report(title, {name: each[name] for name in names[:4]}, 1e-6, "us")
    report("  accumulation alone", {name: each[name] for name in names[4:]}, 1e-6, "us")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recordings", nargs="*", type=Path)
    cv2.setNumThreads(1)
    for size in ((640, 480), (1280, 720)):
        bench("generated", generated(size))
    for path in parser.parse_args().recordings:
        bench(path.name, recorded(path))


if __name__ == "__main__":
    main()
