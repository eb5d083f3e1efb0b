"""The whole job, from a file to images, on one core: ours against faery or eventcv with numpy and OpenCV.

    python bench/bench_whole.py [--seconds 3] [--rounds 5] [--formats evt3 ...]

A recording of 1280x720 pixels and 20 million events a second becomes binary images of 1/30 s, blurred 3x3,
without the bottom quarter, resized to 160x90 by area, in a process that has done it before; and by `evplace
images` in a process of its own, whose start and end are part of it. Real time is the recording's length over
the CPU time.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bench_images import small
from bench_readers import MAKERS, RATE, generated
from evplace.core.events import Events, Size
from evplace.imaging.stream import EventImages, images_of
from evplace.sources.readers import open_recording
from harness import alternate, processor, report

SIZE: Size = (1280, 720)
DT_US = 1e6 / 30
Images = list[NDArray[np.uint8]]


def ours(path: Path) -> Images:
    recording = open_recording(path)
    stream = EventImages(recording.size)
    return [made.image for made in images_of(recording.packets(stream.canvas), stream)]


def stored(path: Path) -> Images:
    """By way of arrays, as for images that show more than where events fell."""
    recording = open_recording(path)
    return [made.image for made in images_of(recording.packets(), EventImages(recording.size))]


def by_command_line(path: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "evplace", "images", str(path), "-o", f"{folder}/out"]
        subprocess.run(command, check=True, capture_output=True)


def with_faery(path: Path) -> Images:
    import faery

    return cut((part["t"], part["x"], part["y"]) for part in faery.events_stream_from_file(path))


def with_eventcv(path: Path) -> Images:
    import eventcv

    events = eventcv.load(str(path))
    return cut(iter([(np.asarray(events.ts), np.asarray(events.xs), np.asarray(events.ys))]))


def cut(parts: Iterator[tuple[Any, Any, Any]]) -> Images:
    """Windows of 1/30 s of packets (t, x, y), each as an image."""
    canvas, images, first, number = np.zeros(SIZE[::-1], np.uint8), [], None, 1
    for t, x, y in parts:
        first = int(t[0]) if first is None else first
        start = 0
        while start < len(t):
            stop = start + int(np.searchsorted(t[start:], first + int(number * DT_US), "right"))
            canvas[y[start:stop], x[start:stop]] = 255
            if stop < len(t):
                images.append(small(canvas))
                canvas[:] = 0
                number += 1
            start = stop
    return [*images, small(canvas)]


def check(work: dict[str, Callable[[Path], Images]], path: Path) -> dict[str, Callable[[Path], Images]]:
    """Who makes the same images, within OpenCV's roundings; others are named."""
    mine, fitting = ours(path), {}
    for name, make in work.items():
        try:
            made = make(path)
        except Exception as error:
            print(f"  ({name} does not read it: {' '.join(str(error).split())[:80]})")
            continue
        apart = [np.abs(a.astype(int) - b).max() for a, b in zip(mine, made, strict=False)]
        if len(made) == len(mine) and max(apart) <= 2:
            fitting[name] = make
        else:
            print(
                f"  ({name} makes other images: {len(made)} in place of {len(mine)}, apart by {max(apart)})"
            )
    return fitting


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--formats", nargs="+", default=["evt3"], choices=sorted(MAKERS))
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    print(processor())
    events = Events.concatenate(list(generated(round(arguments.seconds * RATE), SIZE)))
    for name in arguments.formats:
        with tempfile.TemporaryDirectory(prefix="evplace-bench-") as folder:
            path = MAKERS[name](Path(folder), events)
            peers = {"faery + numpy + OpenCV": with_faery, "eventcv + numpy + OpenCV": with_eventcv}
            work = check({"ours": ours, "ours, by way of arrays": stored} | peers, path)
            jobs: dict[str, Callable[[], object]] = {one: partial(make, path) for one, make in work.items()}
            jobs["ours, command line"] = partial(by_command_line, path)
            timings = alternate(jobs, arguments.rounds)
            report(f"{name}: {len(events):,} events, {arguments.seconds} s of recording", timings)
            for one in ("ours", "ours, command line"):
                print(f"  {one}: {arguments.seconds / timings[one].median:.1f} x real time")


if __name__ == "__main__":
    main()
