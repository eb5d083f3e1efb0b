"""What came out of each case, cached by its settings: a file a case, a map a training."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evplace.reproduction._cases import Case
from evplace.storage import new_file, read_json, write_json


@dataclass(frozen=True)
class Runs:
    """The cache in the folder of a reproduction."""

    out: Path
    """The folder."""
    source: dict[str, Any]
    """How the drives were made: other drives, other runs."""

    def done(self, case: Case) -> bool:
        """Whether a case has been answered, and its result is there where it is to be kept."""
        return self._file(case).exists() and (not case.keep or self.result_folder(case).is_dir())

    def found(self, case: Case) -> dict[str, Any]:
        """What came out of a case that is done."""
        return read_json(self._file(case), "the outcome of a case")

    def keep(self, case: Case, outcome: dict[str, Any]) -> None:
        """Keep what came out."""
        with new_file(self._file(case), overwrite=True) as partial:
            write_json(partial, {"case": case.to_dict(), **outcome})

    def map_file(self, case: Case) -> Path:
        """Where the map of a case is kept."""
        return self.out / "maps" / f"{case.map_key(self.source)}.evp"

    def result_folder(self, case: Case) -> Path:
        """Where the whole result of a case is kept."""
        return self.out / "results" / case.keep

    def _file(self, case: Case) -> Path:
        return self.out / "runs" / f"{case.key(self.source)}.json"
