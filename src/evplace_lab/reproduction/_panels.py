"""The city's drives, and beside them those of real sets that lie in a folder of data, by their adapters."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any, Self

from evplace.core.errors import EvaluationError
from evplace.core.workers import Workers
from evplace.drives import datasets
from evplace.drives.to_traverse import open_traverse
from evplace.evaluation._evaluate import truth_of
from evplace.evaluation.truth import Truth
from evplace.imaging.traverse import Traverse
from evplace.placemap import PlaceMap
from evplace_lab.reproduction._cases import Case, checksum
from evplace_lab.reproduction._cities import Cities

KINDS = {"ideal": "events", "colour": "frames"}
"""Part that a case names -> what the adapter makes of the set."""
SEPARATOR = ": "


@dataclasses.dataclass(frozen=True)
class Panels(Cities):
    """A drive of a real set is named `FOLDER: DATASET: DRIVE`, one of the city as there."""

    data: Path | None = None
    """The folder that real sets lie in."""

    def to_dict(self) -> dict[str, str]:
        """As plain values, for a process of its own."""
        return super().to_dict() | ({} if self.data is None else {"data": str(self.data)})

    @classmethod
    def from_dict(cls, values: dict[str, str]) -> Self:
        """What `to_dict` gave."""
        data = Path(values["data"]) if "data" in values else None
        return cls(Path(values["city"]), Path(values["beside"]), data)

    def has(self, folder: str, dataset: str, drives: tuple[str, ...]) -> bool:
        """Whether all these drives of a set are there."""
        if self.data is None or not (self.data / folder).is_dir():
            return False
        return set(drives) <= set(datasets.drives(self.data / folder, dataset))

    def opened(self, drive: str, case: Case) -> Traverse:
        """A drive as a case sees it."""
        if not _is_real(drive):
            return super().opened(drive, case)
        return Traverse.load(self._made(drive, case))[:: case.every]

    def truths(self, place_map: PlaceMap, query: Traverse, case: Case) -> dict[str, Truth]:
        """Rule -> what is right; by places alone where nobody says where the camera looked."""
        if not _is_real(case.query):
            return super().truths(place_map, query, case)
        found = {"places": truth_of(place_map, query, "places")}
        try:
            return found | {"view": truth_of(place_map, query, "view")}
        except EvaluationError:
            return found

    def source(self, case: Case) -> dict[str, Any]:
        """How the drives of a case were made; of a real set, the sizes of its files and when they changed."""
        if not _is_real(case.query):
            return super().source(case)
        assert self.data is not None  # or it would have no case
        folder = self.data / case.query.partition(SEPARATOR)[0]
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        return {"files": [[path.name, path.stat().st_size, path.stat().st_mtime_ns] for path in files]}

    def check(self, cases: list[Case]) -> None:
        """InputError where the city lacks what some case needs; only real sets that are there have cases."""
        super().check([case for case in cases if not _is_real(case.query)])

    def prepare(self, cases: list[Case], workers: Workers) -> None:
        """Make what is not there: the city's drives, and traverses of real sets."""
        super().prepare([case for case in cases if not _is_real(case.query)], workers)
        for case in cases:
            for drive in (case.database, case.query):
                if _is_real(drive) and not self._made(drive, case).exists():
                    assert self.data is not None  # or it would have no case
                    folder, dataset, name = drive.split(SEPARATOR)
                    kind = KINDS[case.part]
                    made = open_traverse(self.data / folder, drive=name, dataset=dataset, kind=kind)
                    made.save(self._made(drive, case))

    def _made(self, drive: str, case: Case) -> Path:
        """Where the traverse of a real drive is kept."""
        made_from = checksum({"source": self.source(case), "drive": drive, "part": case.part})
        return self.beside / "real" / made_from


def _is_real(drive: str) -> bool:
    return SEPARATOR in drive
