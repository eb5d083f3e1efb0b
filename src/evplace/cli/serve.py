"""Say where a camera is, now: a page, an HTTP service, JSON lines, NMEA and ROS 2 topics.

Examples:
  evplace serve --map campus.evp --source night.aedat4      a recording at its own pace; open the page
  evplace serve --map campus.evp --source usb:              the camera that is plugged in
  evplace serve --map campus.evp --source udp:0.0.0.0:3333 --record drive.raw
  evplace serve --map campus.evp --source zenoh:/event_camera/events --zenoh evplace
  evplace serve --map campus.evp --source night.aedat4 --source-set speed=2 --source-set loops=0
  faery input file night.aedat4 output udp 127.0.0.1:3333   another program sends, `udp:3333` receives
  evplace serve --map campus.evp --source usb: --lines - --nmea udp:127.0.0.1:10110
  evplace list live                                         the kinds of sources
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar
from urllib.parse import quote

from evplace.cli._matcher import MatcherFlags
from evplace.cli._output import note, note_guesses, show_page
from evplace.cli._settings import Pairs, Part
from evplace.core import families
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap
from evplace.serving._recorder import Recorder
from evplace.serving.nmea import sentences
from evplace.serving.outputs import Output
from evplace.serving.server import Stop, bound, check_web, serve
from evplace.serving.service import Service
from evplace.sources.live import Facts, address, open_live

TOKEN = "EVPLACE_TOKEN"
"""The variable that holds the token where no flag does, so that no list of processes shows it."""


def _source_part(args: Any) -> tuple[str, type[Any], dict[str, Any]]:
    kind = address(args.source)[0]
    return f"the live source '{kind}'", families.load("live", kind), {}


@dataclass(frozen=True)
class Args(MatcherFlags):
    """Flags of `evplace serve`."""

    PARTS: ClassVar[tuple[Part, ...]] = (
        *MatcherFlags.PARTS,
        Part("source_set", "", "source", _source_part),
    )

    map: Path
    """A map that `evplace train` wrote."""
    source: str
    """Where events come from: a recording's path, - for standard input, or KIND:WHERE with a kind of
    `evplace list live`."""
    source_set: Pairs = ()
    """A setting of the source, as name=value: speed=2, loops=0, layout=spif, format=evt3 ..."""
    mask: Path | None = None
    """Pixels of this camera to leave out: a text file of x,y lines, or a .npy file."""
    size: tuple[int, int] | None = None
    """Width and height of the sensor in pixels, where neither map nor source says it."""
    host: str = "127.0.0.1"
    """Where to listen. Any but this machine alone needs a token."""
    port: int = 8000
    """The port of the page; 0 takes any that is free."""
    token: str | None = None
    """What clients must send; the variable EVPLACE_TOKEN is taken where it is not given."""
    allow: tuple[str, ...] = ()
    """Names by which this machine is asked for, beside its addresses."""
    record: Path | None = None
    """Write what comes to this file: .raw, .aedat4 or .h5."""
    overwrite: bool = False
    """Replace that file where it exists."""
    lines: str | None = None
    """Also write a JSON object a match: to - (standard output), a file, a device, or udp:HOST:PORT."""
    nmea: str | None = None
    """Also write NMEA sentences (GGA and RMC): to -, a file, a device, or udp:HOST:PORT."""
    zenoh: str | None = None
    """Also publish ROS 2 topics under this name, over zenoh: NAME/fix, NAME/pose and /diagnostics."""
    zenoh_router: str = ""
    """The zenoh router for that: tcp/192.168.1.5:7447; the one on this machine where it is empty."""
    open: bool = False
    """Open the page in a browser, where there is a screen."""
    stop_at_end: bool = False
    """End with the source, instead of showing its last answer."""


def run(args: Args) -> int:
    """Serve until a signal comes."""
    check_web()
    token = args.token or os.environ.get(TOKEN)
    listening = bound(args.host, args.port, token)
    with contextlib.ExitStack() as stack:
        stack.callback(listening.close)
        service = stack.enter_context(opened(args))
        address = f"http://{_shown(args.host)}:{listening.getsockname()[1]}/"
        asyncio.run(_serve(args, service, listening, token, address))
    _say_end(service)
    return 0


@contextlib.contextmanager
def opened(args: Args) -> Iterator[Service]:
    """The service that the flags ask for, and its outputs; they end with the block."""
    place_map = PlaceMap.load(args.map)
    where = Localizer(place_map, args.matcher, args.preset, args.mask, **args.matcher_settings())
    if place_map.recipe is not None and place_map.recipe.cleaning.mask_hot and args.mask is None:
        note("the map was learned without hot pixels: give those of this camera by --mask")
    size = args.size or (None if place_map.recipe is None else place_map.recipe.size)
    source = open_live(args.source, size, **dict(args.source_set))
    note_guesses(list(Facts.of(source).notes))
    service = Service(where, source, args.map, args.source, args.record, args.overwrite)
    with contextlib.ExitStack() as stack:
        stack.callback(service.close)
        for text, place in (
            (lambda report: service.describer.text(service.describer.values(report)) + "\n", args.lines),
            (lambda report: sentences(report, place_map), args.nmea),
        ):
            if place is not None:
                output = Output(text, place)
                stack.callback(output.close, 0.5)
                service.outputs.append(output.publish)
        if args.zenoh is not None:
            from evplace.serving.ros import Topics

            topics = Topics(args.zenoh, place_map, args.zenoh_router)
            stack.callback(topics.close)
            service.outputs.append(topics.publish)
        yield service


async def _serve(args: Args, service: Service, listening: Any, token: str | None, address: str) -> None:
    def ready(stop: Stop) -> None:
        query = f"?token={quote(token, safe='')}" if token and args.token else ""
        note(f"{args.source} is localised in {args.map}: open {address}{query}; Ctrl-C ends it")
        if args.open:
            show_page(address + query)
        if args.stop_at_end:
            threading.Thread(target=_end_with, args=(service, stop), daemon=True).start()

    await serve(service, listening, token, args.allow, ready)


def _end_with(service: Service, stop: Stop) -> None:
    service.drive.ended.wait()
    stop()


def _say_end(service: Service) -> None:
    """What a user must know of how it ended."""
    for fault in (service.drive.fault, None if service.recorder is None else service.recorder.fault):
        if fault is not None:
            note(fault)
    counters = service.feed.counters()
    skipped = f", {counters.skipped:,} skipped" if counters.skipped else ""
    note(f"ended after {counters.events:,} events{skipped}{_recorded(service.recorder)}")


def _recorded(recorder: Recorder | None) -> str:
    """How much was recorded, and where; a camera that was started again has begun a second file."""
    if recorder is None:
        return ""
    files = ", ".join(map(str, recorder.files)) or "no file"
    return f", {recorder.events:,} recorded in {files}"


def _shown(host: str) -> str:
    return f"[{host}]" if ":" in host else host
