"""Simulate an event camera on a video or on a folder of images: an event recording.

Examples:
  evplace simulate drive.mp4 -o drive.aedat4                     videos need the extra 'video'
  evplace simulate frames/ -o drive.npz --fps 120                images; timestamps.txt gives their times
  evplace simulate frames/ -o night.aedat4 --preset weak --seed 1

Frames must come so often that the image moves by less than a pixel between two of them; a remark says when
they do not.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import tyro

from evplace.cli._output import USED_GOOD_PART, note, note_guesses, print_facts, print_json, remarks
from evplace.cli._settings import Pairs, Part, SettingsFlags, a_preset_of
from evplace.core import settings
from evplace.core.errors import DamagedRecordingError
from evplace.core.events import Events
from evplace.sources.film import open_film
from evplace.sources.simulators.esim import PRESETS, SensorSettings, simulate
from evplace.sources.writers import write_recording


@dataclass(frozen=True)
class Args(SettingsFlags):
    """Flags of `evplace simulate`."""

    PARTS: ClassVar[tuple[Part, ...]] = (
        Part("set", "preset", "", lambda _: ("the sensor", SensorSettings, PRESETS)),
    )

    film: tyro.conf.Positional[Path]
    """A video file, or a folder of images."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """The recording to write: .aedat4, .npz, .h5 or .raw (EVT3)."""
    preset: Annotated[str, a_preset_of(PRESETS)] = "from-8bit"
    """The sensor; from-8bit is for gamma-coded frames, as videos are."""
    set: Pairs = ()
    """A setting of the sensor over the preset's, as name=value: threshold_on=0.15."""
    fps: float = 30.0
    """Images a second of a folder without times."""
    time_unit: Literal["s", "ms", "us", "ns"] | None = None
    """Unit of the images' times, in timestamps.txt or in their names."""
    seed: int = 0
    """Draws the pixels' thresholds and the noise."""
    overwrite: bool = False
    """Replace what exists."""
    json: bool = False
    """Print one JSON object."""


def run(args: Args) -> int:
    """Simulate and write."""
    preset = settings.preset_of("the sensor", PRESETS, args.preset)
    sensor = settings.make(SensorSettings, dict(args.set), preset)
    film = open_film(args.film, args.fps, args.time_unit)
    packets = _Counted(simulate(film, film.size, sensor, args.seed))
    fault = None
    with remarks():
        try:
            write_recording(args.out, packets, film.size, overwrite=args.overwrite)
        except DamagedRecordingError as error:
            fault = str(error)
    note_guesses(film.notes)
    events = packets.events
    facts = {
        "events": events,
        "width": film.size[0],
        "height": film.size[1],
        "sensor": settings.to_dict(sensor),
        "fault": fault,
    }
    if args.json:
        print_json(facts)
    else:
        print_facts(str(args.out), {"events": events, "sensor": f"{film.size[0]} x {film.size[1]}"})
    if fault is not None:
        note(f"{fault}; the good part was simulated")
    return USED_GOOD_PART if fault is not None else 0


class _Counted:
    """Packets, counted on their way."""

    def __init__(self, packets: Iterable[Events]) -> None:
        self._packets = packets
        self.events = 0

    def __iter__(self) -> Iterator[Events]:
        for packet in self._packets:
            self.events += len(packet)
            yield packet
