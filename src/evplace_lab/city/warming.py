"""Compiling the city's loops ahead of time."""

from __future__ import annotations

from evplace.imaging.images import Imager
from evplace.sources.simulators.esim import PRESETS, Simulator
from evplace_lab.city.camera import ColourCamera, grey, luminance
from evplace_lab.city.film import Film
from evplace_lab.city.plan import CitySettings
from evplace_lab.city.town import build_town

SMALL = (32, 24)


def warm(settings: CitySettings) -> None:
    """Run every loop once, on a small sensor, so that what is compiled lies in the cache on disk."""
    town = build_town(settings.seed)
    for name in settings.conditions:
        film = Film(town, settings.paths[0], name, SMALL, settings.seed, 60.0)
        camera, imager = ColourCamera([0]), Imager(SMALL)
        sensors = [Simulator(SMALL, PRESETS[sensor]) for sensor in ("ideal", "from-8bit")]
        for t_us in (0, 100_000):
            radiance = film.radiance(t_us)
            camera.expose(radiance, t_us)
            imager.add(sensors[0].push(luminance(radiance), t_us))
            imager.add(sensors[1].push(grey(camera.picture(radiance)), t_us))
            imager.image(t_us)
