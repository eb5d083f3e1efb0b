"""The drives of the benchmark city as each input sees them."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any, Self

import numpy as np

from evplace.core.errors import InputError
from evplace.core.events import Events
from evplace.core.folders import instead
from evplace.core.settings import make
from evplace.core.storage import new_folder, read_json
from evplace.core.workers import Workers
from evplace.evaluation._evaluate import Rule, truth_of
from evplace.evaluation.truth import Truth
from evplace.imaging.images import Imager, ImageSettings
from evplace.imaging.recipe import Recipe
from evplace.imaging.tones import toned
from evplace.imaging.traverse import Traverse, TraverseWriter
from evplace.imaging.windows import WindowSettings, windows_before
from evplace.placemap import PlaceMap
from evplace.places import PlaceGrid
from evplace.sources.readers import open_recording
from evplace_lab.city import CitySettings, generate
from evplace_lab.city.generation import SETTINGS_FILE
from evplace_lab.reproduction._cases import Case, checksum

RULES: tuple[Rule, ...] = ("places", "view")
EXPOSED_GAIN = 64.0
"""Largest gain of the camera that exposes itself: enough for the city's nights."""


@dataclasses.dataclass(frozen=True)
class Cities:
    """Where drives are: the benchmark's, and those that a comparison makes beside it."""

    city: Path
    """Drives of every sensor, as `evplace city` makes them."""
    beside: Path
    """Folder for the drives of the self-exposing camera, for kept events, and for images made from them."""

    def to_dict(self) -> dict[str, str]:
        """As plain values, for a process of its own."""
        return {"city": str(self.city), "beside": str(self.beside)}

    @classmethod
    def from_dict(cls, values: dict[str, str]) -> Self:
        """What `to_dict` gave."""
        return cls(Path(values["city"]), Path(values["beside"]))

    @property
    def settings(self) -> dict[str, Any]:
        """How the benchmark's drives were made; InputError where there are none."""
        if not (self.city / SETTINGS_FILE).exists():
            raise InputError(
                instead(self.city, SETTINGS_FILE)
                or f"{self.city} holds no drives: make them with evplace city -o {self.city}"
            )
        return read_json(self.city / SETTINGS_FILE, "the settings of a city")

    def opened(self, drive: str, case: Case) -> Traverse:
        """A drive as a case sees it."""
        found = Traverse.load(self._folder(drive, case))[:: case.every]
        if case.tone == "plain":
            return found
        return dataclasses.replace(found, images=toned(np.asarray(found.images), case.tone))

    def places(self, day: Traverse, case: Case) -> PlaceGrid:
        """The grid of the map's drive."""
        assert day.track is not None  # the city knows where it is
        return PlaceGrid.from_track(day.track, origin=case.origin)

    def truths(self, place_map: PlaceMap, query: Traverse, _: Case) -> dict[str, Truth]:
        """Rule -> what is right: by places, the paper's, and by view."""
        return {rule: truth_of(place_map, query, rule) for rule in RULES}

    def source(self, _: Case) -> dict[str, Any]:
        """How the drives of a case were made."""
        return self.settings

    def check(self, cases: list[Case]) -> None:
        """InputError where the city lacks a drive or a sensor that some case needs and that is not made."""
        assert self.settings  # or there is no city at all
        for case in cases:
            for drive in (case.database, case.query):
                if case.exposure == "fixed" and not (self.city / drive / case.part).is_dir():
                    raise InputError(
                        f"{self.city} lacks {drive}/{case.part}: make a city with all drives and sensors in "
                        "a new folder: evplace city -o FOLDER"
                    )

    def prepare(self, cases: list[Case], workers: Workers) -> None:
        """Make the drives and images that the benchmark does not have and some case needs."""
        if any(case.exposure == "auto" for case in cases):
            exposed = self._like(sensors=(), most_gain=EXPOSED_GAIN, keep_events=False)
            # Colour images need no frames between them: the camera's gain follows within a second anyhow.
            exposed = dataclasses.replace(exposed, fps=exposed.image_hz)
            wanted = _drives([case for case in cases if case.exposure == "auto"])
            generate(self._exposed, exposed, workers, drives=wanted)
        again = [case for case in cases if case.windows is not None or case.images is not None]
        if again and not self.settings["keep_events"]:
            kept = self._like(sensors=tuple(sorted({case.part for case in again})), keep_events=True)
            generate(self._kept, kept, workers, drives=_drives(again))
        for case in again:
            for drive in (case.database, case.query):
                self._remake(drive, case)

    @property
    def _exposed(self) -> Path:
        return self.beside / "city-exposed"

    @property
    def _kept(self) -> Path:
        return self.beside / "city-events"

    def _like(self, **changed: Any) -> CitySettings:
        """The settings of drives like the benchmark's."""
        own = {key: value for key, value in self.settings.items() if key != "version"}
        return make(CitySettings, {**own, **changed})

    def _folder(self, drive: str, case: Case) -> Path:
        if case.windows is not None or case.images is not None:
            made_from = checksum({"city": self.settings, "windows": case.windows, "images": case.images})
            return self.beside / "remade" / f"{drive} {case.part} {made_from}"
        return (self._exposed if case.exposure == "auto" else self.city) / drive / case.part

    def _recording(self, drive: str, part: str) -> Path:
        city = self.city if self.settings["keep_events"] else self._kept
        return city / drive / f"{part}.aedat4"

    def _remake(self, drive: str, case: Case) -> None:
        """The images of a drive made anew from its events, at the same times."""
        folder = self._folder(drive, case)
        if folder.exists():
            return
        windows = make(WindowSettings, case.windows or {})
        images = make(ImageSettings, case.images or {})
        given = Traverse.load(self.city / drive / case.part)
        with new_folder(folder) as partial:
            writer = TraverseWriter(partial, given.info)
            recording = open_recording(self._recording(drive, case.part))
            events = Events.concatenate(list(recording.packets()))
            writer.recipe = Recipe("events", recording.size, windows, images)
            imager = Imager(recording.size, images)
            cut = windows_before(given.t_us, events, windows)
            for t_us, window in zip(given.t_us.tolist(), cut, strict=True):
                imager.add(window)
                writer.add(imager.image(t_us), t_us, len(window))
            writer.track = given.track
            writer.close()


def _drives(cases: list[Case]) -> list[tuple[str, int]]:
    """(condition, path) of every drive of `cases`."""
    names = sorted({drive for case in cases for drive in (case.database, case.query)})
    return [(condition, int(path)) for condition, _, path in (name.rpartition("-") for name in names)]
