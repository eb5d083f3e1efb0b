"""Live figures: latency, what is sustained, too much, many clients, a camera that goes, a drive that jumps.

    python bench/bench_live.py                     all but the last two
    python bench/bench_live.py --city city         these as well: a city with its events kept
    python bench/bench_live.py --seconds 600       ten minutes of 20 Mev/s

Events are generated: 1280x720 pixels, 20 million a second, at random pixels; the map has 2000 images. CPU
time where that is said, else by the clock, with the machine's load beside it. What runs for long runs in a
process of its own that loads the map, as `evplace serve` does: its memory is a service's, not that of training.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from evplace.core.events import Events
from evplace.imaging.recipe import Recipe
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid
from evplace.serving._drive import Drive
from evplace.serving._feed import Feed
from evplace.serving._report import Report
from evplace.serving.service import Service, warm
from evplace.sources.live import Item
from evplace.sources.readers import Block
from evplace.sources.tracks import Track

SIZE = (1280, 720)
RATE = 20_000_000
SLICE_US = 10_000
MAP = 2000


def made_map(scorer: str | None = None) -> PlaceMap:
    """A street of 2 km, an image a metre, of which nothing is to be found."""
    rng = np.random.default_rng(0)
    images = (rng.random((MAP, 90, 160)) < 0.2).astype(np.uint8) * 255
    t_us = np.arange(1, MAP + 1, dtype=np.int64) * 100_000
    xy = np.stack([500_000 + np.arange(MAP, dtype=float), np.full(MAP, 4e6)], axis=1)
    track = Track.local(t_us, xy)
    day = Traverse(images, t_us, np.ones(MAP, np.int64), track, Recipe("events", SIZE))
    places = PlaceGrid.from_track(track)
    return train(day, places) if scorer is None else train(day, places, scorer)


def made_slices() -> list[Block]:
    """A tenth of a second in slices, to be sent again and again."""
    rng = np.random.default_rng(1)
    count = RATE * SLICE_US // 1_000_000
    found = []
    for n in range(10):
        t_us = np.sort(rng.integers(n * SLICE_US, (n + 1) * SLICE_US, count))
        x, y = rng.integers(0, SIZE[0], count, np.uint16), rng.integers(0, SIZE[1], count, np.uint16)
        found.append(Block(t_us, x, y, rng.random(count) < 0.5))
    return found


class Generated:
    """A camera that sends `speed` times RATE, or as fast as it is taken where it waits."""

    size = SIZE
    pace = 1.0

    def __init__(self, seconds: float, speed: float = 1.0, waits: bool = False) -> None:
        self.waits = waits
        self.behind_s = 0.0
        self._seconds, self._speed, self._slices = seconds, speed, made_slices()
        self._closed = False

    def close(self) -> None:
        self._closed = True

    def blocks(self) -> Iterator[Item]:
        start_s, n = time.monotonic(), 0
        while not self._closed and n * SLICE_US < self._seconds * 1e6:
            part = self._slices[n % 10]
            due_s = start_s + (n + 1) * SLICE_US / 1e6 / self._speed
            left_s = due_s - time.monotonic()
            if not self.waits and left_s > 0:
                time.sleep(left_s)
            self.behind_s = max(self.behind_s, -left_s if not self.waits else 0.0)
            yield part._replace(t_us=part.t_us + n // 10 * 10 * SLICE_US)
            n += 1


def rss_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def load() -> str:
    return f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"


def latency(place_map: PlaceMap, windows: int) -> None:
    """CPU from a window's end, once all its events have been taken, to its match."""
    where = Localizer(place_map)
    slices = made_slices()
    taken = []
    for n in range(windows * 10 // 3):
        part = slices[n % 10]
        t_us = part.t_us + n // 10 * 10 * SLICE_US
        events = Events(t_us, part.x, part.y, part.p, SIZE)
        edge = int(
            np.searchsorted(t_us, (len(taken) + 1) * 1_000_000 // 30 + int(slices[0].t_us[0]), "right")
        )
        for _ in where.push(events[:edge]):
            raise AssertionError("a window ended before its time")
        if edge < len(events):
            start = time.thread_time()
            found = list(where.push(events[edge : edge + 1]))
            taken.append(time.thread_time() - start)
            assert len(found) == 1
            list(where.push(events[edge + 1 :]))
    ms = 1000 * np.array(taken[10:])
    name = place_map.settings["scorer"]["name"]
    print(
        f"window's end to match by {name}, {len(ms)} windows of {RATE // 30:,} events, map of {MAP} images: "
        f"p50 {np.quantile(ms, 0.5):.2f} ms, p99 {np.quantile(ms, 0.99):.2f} ms of CPU ({load()})"
    )


def driven(place_map: PlaceMap, source: Generated) -> tuple[Feed, list[Report], list[float]]:
    """A source that is localised to its end; the memory that was used, each second."""
    reports: list[Report] = []
    where = Localizer(place_map)
    warm(where, SIZE)
    feed = Feed(source, SIZE)
    drive = Drive(where, feed, reports.append)
    used: list[float] = []
    drive.start()
    while not drive.ended.wait(1.0):
        used.append(rss_mb())
    assert drive.fault is None, drive.fault
    return feed, reports, used


def sustained(place_map: PlaceMap, seconds: float) -> None:
    source = Generated(seconds)
    start_s, start_cpu = time.monotonic(), time.process_time()
    feed, reports, used = driven(place_map, source)
    took_s, cpu_s = time.monotonic() - start_s, time.process_time() - start_cpu
    counters = feed.counters()
    ms = 1000 * np.array([report.latency_s for report in reports[30:]])
    quarter = max(len(used) // 4, 1)
    print(
        f"20 Mev/s for {seconds:g} s ({took_s:.1f} s by the clock, {cpu_s / took_s:.2f} cores): "
        f"{counters.events / 1e6:.0f} M events, {counters.skipped:,} skipped, {len(reports)} matches, "
        f"arrival to match p50 {np.nanquantile(ms, 0.5):.1f} ms, p99 {np.nanquantile(ms, 0.99):.1f} ms, "
        f"memory {np.mean(used[:quarter]):.0f} MB at first, {np.mean(used[-quarter:]):.0f} MB at last, "
        f"{max(used):.0f} MB at most ({load()})"
    )


def overload(place_map: PlaceMap, seconds: float) -> None:
    feed, reports, _ = driven(place_map, Generated(seconds, waits=True))
    most = feed.counters().events / (reports[-1].host_s - reports[0].host_s)
    source = Generated(2 * seconds, speed=2 * most / RATE)
    feed, reports, used = driven(place_map, source)
    counters = feed.counters()
    print(
        f"it takes {most / 1e6:.0f} Mev/s; sent {2 * most / 1e6:.0f}: {counters.events / 1e6:.0f} M events, "
        f"{counters.skipped / 1e6:.0f} M skipped in {counters.overflows} overflows, {len(reports)} matches, "
        f"memory at most {max(used):.0f} MB ({load()})"
    )


LONG = {"sustained": sustained, "overload": overload}


def apart(what: str, path: Path, seconds: float) -> None:
    """One of LONG in a process of its own, with the map at a path."""
    subprocess.run([sys.executable, __file__, "--only", what, str(path), str(seconds)], check=True)


# Clients


async def served(
    service: Service, listening: socket.socket, ready: threading.Event, stops: list[Any]
) -> None:
    from evplace.serving.server import serve

    def begun(stop: Any) -> None:
        stops.append(stop)
        ready.set()

    await serve(service, listening, None, (), begun)


PROBE = """
import json, sys, time
from websockets.sync.client import connect
late = []
with connect(sys.argv[1]) as socket:
    until = time.monotonic() + float(sys.argv[2])
    while time.monotonic() < until:
        said = json.loads(socket.recv())
        late.append(time.time() - said["host_s"])
late.sort()
print(json.dumps([late[len(late) // 2], late[len(late) * 99 // 100], len(late)]))
"""
CROWD = """
import asyncio, sys
from websockets.asyncio.client import connect
async def one(deaf):
    async with connect(sys.argv[1], max_queue=1) as socket:
        if deaf:
            socket.transport.pause_reading()
            await asyncio.sleep(3600)
        async for _ in socket:
            pass
async def main():
    await asyncio.gather(*(one(n == 0) for n in range(49)))
asyncio.run(main())
"""


def clients(city: Path, place_map: PlaceMap, folder: Path, seconds: float) -> None:
    """From a match to its arrival at a client in another process: alone, and beside 49, one of them deaf."""
    from evplace.serving.server import bound
    from evplace.sources.live import open_live

    source = open_live(str(city / "night-1" / "ideal.aedat4"), loops=0)
    place_map.save(folder / "city.evp", overwrite=True)
    service = Service(Localizer(place_map), source, folder / "city.evp", "bench")
    listening = bound("127.0.0.1", 0, None)
    address = f"ws://127.0.0.1:{listening.getsockname()[1]}/live"
    ready, stops = threading.Event(), []
    thread = threading.Thread(target=lambda: asyncio.run(served(service, listening, ready, stops)))
    thread.start()
    ready.wait()
    for crowd in (False, True, False, True):
        others = subprocess.Popen([sys.executable, "-c", CROWD, address]) if crowd else None
        time.sleep(2)
        command = [sys.executable, "-c", PROBE, address, str(seconds)]
        p50, p99, messages = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
        print(
            f"a client {'beside 49, one deaf' if crowd else 'alone':<19}: match to client "
            f"p50 {1000 * p50:.2f} ms, p99 {1000 * p99:.2f} ms, {messages} messages ({load()})"
        )
        if others is not None:
            others.kill()
            others.wait()
    stops[0]()
    thread.join()
    service.close()


# The city


def jumped(city: Path, place_map: PlaceMap) -> None:
    """Seconds of data after a jump along the night drive until the place is right to 25 m, and stays so."""
    night = Traverse.load(city / "night-1" / "ideal")
    assert night.track is not None
    n = len(night)
    for first, second in ((n // 5, 3 * n // 5), (3 * n // 5, n // 5), (n // 3, 4 * n // 5)):
        where = Localizer(place_map)
        step_us = int(np.median(np.diff(night.t_us)))
        order = [*range(first), *range(second, n)]
        t_us = step_us * np.arange(1, len(order) + 1)
        right = []
        for at, time_us in zip(order, t_us, strict=True):
            for match in where.push_image(night.images[at], int(time_us)):
                near = (
                    match.position is not None and np.hypot(*(np.array(match.position) - night.xy[at])) <= 25
                )
                right.append(bool(near))
        after = np.array(right[first:])
        wrong = np.flatnonzero(~after[: 20 * 1_000_000 // step_us])
        back_s = (int(wrong[-1]) + 1 if len(wrong) else 0) * step_us / 1e6
        first_s = int(np.argmax(after)) * step_us / 1e6
        print(
            f"jump from {first * step_us / 1e6:.0f} s to {second * step_us / 1e6:.0f} s: right to 25 m again "
            f"after {first_s:.2f} s of data, for good after {back_s:.2f} s; "
            f"{np.mean(right[:first]):.0%} right before"
        )


def killed(city: Path, place_map: PlaceMap, folder: Path) -> None:
    """A sender over UDP that is killed: seconds until no place is said any more, and until it is again."""
    place_map.save(folder / "city.evp", overwrite=True)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_one:
        any_one.bind(("127.0.0.1", 0))
        port = any_one.getsockname()[1]
    code = (
        "import socket, sys, time; sys.path.insert(0, 'tests')\n"
        "from made_streams import faery_datagrams\nfrom evplace.core.events import Events\n"
        "from evplace.sources.live import open_live\n"
        "out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)\nlive = open_live(sys.argv[1])\n"
        "live.change(by_s=float(sys.argv[3])) if float(sys.argv[3]) else None\n"
        "for block in live.blocks():\n"
        "    for data in faery_datagrams(Events(*block[:4], live.size)) if hasattr(block, 't_us') else ():\n"
        "        out.sendto(data, ('127.0.0.1', int(sys.argv[2])))\n"
    )
    said: list[tuple[float, Report]] = []
    from evplace.sources.live import open_live

    where = Localizer(place_map)
    size = place_map.recipe.size  # type: ignore[union-attr]
    warm(where, size)
    feed = Feed(open_live(f"udp:{port}", size), size)
    drive = Drive(where, feed, lambda report: said.append((time.monotonic(), report)))
    drive.start()
    recording = str(city / "night-1" / "ideal.aedat4")
    night = Traverse.load(city / "night-1" / "ideal")
    for start_s in ("0", "6"):
        sender = subprocess.Popen([sys.executable, "-c", code, recording, str(port), start_s])
        while not said or said[-1][1].match.state == "no-events":
            time.sleep(0.01)
        begun_us = said[-1][1].match.t_us
        count = len(said)
        time.sleep(5)
        right = [report.match.t_us for _, report in said[count - 1 :] if _is_right(report, night)]
        back = f"{(right[0] - begun_us) / 1e6:.2f} s of data" if right else "never"
        sender.kill()
        sender.wait()
        killed_s = time.monotonic()
        while said[-1][1].match.state != "no-events":
            time.sleep(0.005)
        gone = [t_s for t_s, report in said if t_s > killed_s and report.match.state == "no-events"]
        print(
            f"sender from {start_s} s: the place is right after {back}; killed: no place "
            f"{gone[0] - killed_s:.2f} s later ({load()})"
        )
    drive.close(1.0)


def _is_right(report: Report, night: Traverse) -> bool:
    at = int(np.argmin(np.abs(night.t_us - report.match.t_us)))
    return _is_near(report.match.position, night.xy[at])


def _is_near(position: tuple[float, float] | None, xy: Any) -> bool:
    return position is not None and bool(np.hypot(*(np.array(position) - xy)) <= 25)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--windows", type=int, default=600)
    parser.add_argument("--city", type=Path)
    parser.add_argument("--only", nargs=3, metavar=("WHAT", "MAP", "SECONDS"))
    args = parser.parse_args()
    if args.only is not None:
        what, path, seconds = args.only
        LONG[what](PlaceMap.load(Path(path)), float(seconds))
        return
    place_map = made_map()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "street.evp"
        place_map.save(path)
        apart("sustained", path, args.seconds)
        apart("overload", path, min(args.seconds / 4, 10.0))
    for one in (place_map, made_map("edges"), made_map("ncc")):
        latency(one, args.windows)
    if args.city is not None:
        day = Traverse.load(args.city / "day-1" / "ideal")
        assert day.track is not None
        city_map = train(day, PlaceGrid.from_track(day.track))
        jumped(args.city, city_map)
        with tempfile.TemporaryDirectory() as folder:
            killed(args.city, city_map, Path(folder))
            clients(args.city, city_map, Path(folder), 8.0)


if __name__ == "__main__":
    main()
