"""Pictures of the city to look at: a contact sheet of all conditions, and a short moving picture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from evplace.core.events import Events, Size
from evplace.core.storage import new_file
from evplace.imaging.images import Imager, ImageSettings
from evplace.imaging.sheets import Picture, stacked, write_film
from evplace.sources.simulators.esim import PRESETS, Simulator
from evplace_lab.city.camera import ColourCamera, luminance
from evplace_lab.city.conditions import CONDITIONS
from evplace_lab.city.film import Film
from evplace_lab.city.town import Town, build_town

WAYS_M = (45.0, 150.0, 262.0, 420.0)
"""Where along path 1 the sheet's columns are taken."""
FPS = 120
WINDOW_US = 33_333
WARM_UP_US = 100_000
"""Driven before a picture is taken, so that its window of events is full."""
INKS = 128
"""Colours of a .png, which keeps it small."""
MOVING_FPS = 15


def preview(
    path: str | Path,
    seed: int = 0,
    conditions: Sequence[str] = tuple(CONDITIONS),
    size: Size = (320, 240),
) -> None:
    """Write a contact sheet: one pair of rows a condition, colour above the event image of the same moment.

    `path` ends in .png, .webp or .jpg. Raises OutputError where it cannot be written.
    """
    town = build_town(seed)
    rows = [row for name in conditions for row in _rows(town, name, seed, size)]
    sheet = Image.fromarray(stacked(rows))
    with new_file(path, overwrite=True) as file:
        if file.suffix == ".png":
            sheet = sheet.quantize(INKS, dither=Image.Dither.NONE)
        sheet.save(file, optimize=True)


def moving_preview(
    path: str | Path,
    seed: int = 0,
    conditions: Sequence[str] = ("day", "night", "rain"),
    seconds: float = 4.0,
    start_m: float = 225.0,
    size: Size = (160, 120),
) -> None:
    """Write a short drive as an animated .webp or .gif: a column a condition, colour above events.

    Raises OutputError where it cannot be written.
    """
    town = build_town(seed)
    films = [_shots(town, name, seed, size, start_m, round(seconds * MOVING_FPS)) for name in conditions]
    pictures = [
        stacked([[colour for colour, _ in column], [image for _, image in column]])
        for column in zip(*films, strict=True)
    ]
    write_film(pictures, path, MOVING_FPS, overwrite=True)


def _rows(town: Town, name: str, seed: int, size: Size) -> tuple[list[Picture], list[Picture]]:
    """One condition's colour pictures and event images."""
    pairs = [next(_shots(town, name, seed, size, way, 1)) for way in WAYS_M]
    return [colour for colour, _ in pairs], [image for _, image in pairs]


def _shots(
    town: Town, name: str, seed: int, size: Size, way_m: float, count: int
) -> Iterator[tuple[Picture, Picture]]:
    """Colour and events of `count` moments, MOVING_FPS a second, from the time the car passes `way_m`."""
    film = Film(town, 1, name, size, seed)
    first = round(float(np.interp(way_m, film.drive.ways, film.drive.times)) * FPS)
    camera, sensor = ColourCamera([seed]), Simulator(size, PRESETS["ideal"], seed)
    imager = Imager(size, ImageSettings(width=size[0], height=size[1], blur=False, crop_bottom=0.0))
    parts: list[Events] = []
    for k in range(first - WARM_UP_US * FPS // 1_000_000, first + (count - 1) * FPS // MOVING_FPS + 1):
        t_us = round(k * 1_000_000 / FPS)
        radiance = film.radiance(t_us)
        camera.expose(radiance, t_us)
        parts = [*parts[-round(WINDOW_US * FPS / 1e6) + 1 :], sensor.push(luminance(radiance), t_us)]
        if k >= first and (k - first) % (FPS // MOVING_FPS) == 0:
            for events in parts:
                imager.add(events)
            ink = 255 - imager.image(t_us)
            yield camera.noisy_picture(radiance), np.repeat(ink[..., None], 3, 2)
