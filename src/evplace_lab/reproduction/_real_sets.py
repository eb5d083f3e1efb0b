"""Real sets on disk: two drives each, and what is right by the set's own truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from evplace.core.errors import InputError
from evplace.core.settings import to_dict
from evplace.core.workers import Workers
from evplace.drives.to_traverse import open_traverse
from evplace.evaluation.truth import Truth, by_frames, by_matrix
from evplace.imaging.traverse import Traverse
from evplace.placemap import PlaceMap
from evplace.places import PlaceRuns
from evplace_lab.reproduction._cases import Case
from evplace_lab.reproduction._recipes import recipes


@dataclass(frozen=True)
class RealSet:
    """A recipe: two drives of a set."""

    order: int
    """Its place in the table."""
    title: str
    """Its name for people."""
    reference: str
    """The drive that is learned."""
    query: str
    """The drive that is looked for."""
    methods: tuple[str, ...]
    """How places are found."""
    dataset: str = ""
    """The data set's name, where it is a folder of drives."""
    folder: str = ""
    """Where it lies, below the folder of data; it holds a list of images NAME.csv for each drive."""
    arrays: str = ""
    """Or an .npz file below it with an array of images for each drive."""
    tolerances: tuple[int, ...] = ()
    """How many images off an answer may be, where both drives are in step."""
    truth: str = ""
    """Or a matrix below it, (queries, references)."""

    @property
    def rules(self) -> dict[str, str]:
        """Name of each rule -> what it says."""
        if self.truth:
            return {"given": "as the set's own matrix has it"}
        return {f"within {n}": f"at most {n} images off" for n in self.tolerances}


@dataclass(frozen=True)
class RealSets:
    """The sets below one folder."""

    data: Path

    def to_dict(self) -> dict[str, str]:
        """As plain values, for a process of its own."""
        return {"data": str(self.data)}

    @classmethod
    def from_dict(cls, values: dict[str, str]) -> Self:
        """What `to_dict` gave."""
        return cls(Path(values["data"]))

    @property
    def settings(self) -> dict[str, Any]:
        """The recipes of the sets that are there."""
        return {one.title: to_dict(one) for one in self.present}

    @property
    def present(self) -> list[RealSet]:
        """The sets whose drives and truth are all there; InputError where there is no folder of data."""
        if not self.data.is_dir():
            raise InputError(f"there is no folder of data {self.data}: give one with `data`")
        return [one for one in recipes("real", RealSet) if all(file.exists() for file in self._files(one))]

    def source(self, case: Case) -> dict[str, Any]:
        """The recipe of a case's set, and the size and time of its files: other files, other runs."""
        real = self._set(case.query.partition(": ")[0])
        files = [file.stat() for file in self._files(real)]
        return to_dict(real) | {"files": [[file.st_size, file.st_mtime_ns] for file in files]}

    def check(self, cases: list[Case]) -> None:
        """Nothing: only sets that are there have cases."""

    def opened(self, drive: str, case: Case) -> Traverse:
        """A drive of the set that a case is about, which it names `TITLE: DRIVE`."""
        title, _, name = drive.partition(": ")
        real = self._set(title)
        if real.dataset:
            found = open_traverse(self.data / real.folder, drive=name, dataset=real.dataset)
        else:
            with np.load(self.data / real.arrays, allow_pickle=False) as arrays:
                images = arrays[name]
            t_us = np.arange(len(images), dtype=np.int64) * 1_000_000
            found = Traverse(images, t_us, np.full(len(images), -1, np.int64))
        return found[:: case.every]

    def places(self, day: Traverse, _: Case) -> PlaceRuns:
        """Each image is a place."""
        return PlaceRuns(len(day))

    def truths(self, place_map: PlaceMap, query: Traverse, case: Case) -> dict[str, Truth]:
        """Rule -> what is right."""
        real = self._set(case.query.partition(": ")[0])
        n_queries, n_items = len(query), len(place_map.items)
        if real.truth:
            matrix = self.data / real.truth
            return {rule: by_matrix(matrix, n_queries, n_items) for rule in real.rules}
        return {
            rule: by_frames(n_queries, n_items, tolerance)
            for rule, tolerance in zip(real.rules, real.tolerances, strict=True)
        }

    def prepare(self, cases: list[Case], workers: Workers) -> None:
        """Nothing: what is not there is not made."""

    def _files(self, real: RealSet) -> list[Path]:
        """What must be there."""
        drives = [f"{real.folder}/{drive}.csv" for drive in (real.reference, real.query)]
        return [
            self.data / name for name in ([real.arrays] if real.arrays else drives) + [real.truth] if name
        ]

    def _set(self, title: str) -> RealSet:
        return next(one for one in recipes("real", RealSet) if one.title == title)
