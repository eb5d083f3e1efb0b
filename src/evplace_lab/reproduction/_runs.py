"""What came out of each case, cached by its settings: a file a case, a map a training."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evplace.core.storage import new_file, read_json, write_json
from evplace.localizer import Answers
from evplace_lab.reproduction._cases import Case

TIMINGS: tuple[Answers, ...] = ("live", "hindsight")
"""When answers are given: every case is answered in both ways."""


@dataclass(frozen=True)
class Runs:
    """The cache in the folder of a reproduction."""

    out: Path
    """The folder."""
    source: Callable[[Case], dict[str, Any]]
    """How the drives of a case were made: other drives, other runs."""

    def key(self, case: Case) -> str:
        """What two runs of the same case have in common."""
        return case.key(self.source(case))

    def map_key(self, case: Case) -> str:
        """What two cases of the same map have in common."""
        return case.map_key(self.source(case))

    def distinct(self, cases: list[Case]) -> list[Case]:
        """Each case once; of equal ones that whose result is kept."""
        found: dict[str, Case] = {}
        for case in cases:
            key = self.key(case)
            if key not in found or case.keep:
                found[key] = case
        return list(found.values())

    def done(self, case: Case) -> bool:
        """Whether a case has been answered, and its result is there where it is to be kept."""
        if not self._file(case).exists() or not set(TIMINGS) <= set(self.found(case)):
            return False
        kept = self.result_folder(case) / "result.json"
        return not case.keep or (
            kept.exists() and read_json(kept, "a result")["settings"].get("key") == self.key(case)
        )

    def found(self, case: Case) -> dict[str, Any]:
        """What came out of a case that is done."""
        return read_json(self._file(case), "the outcome of a case")

    def keep(self, case: Case, outcome: dict[str, Any]) -> None:
        """Keep what came out."""
        with new_file(self._file(case), overwrite=True) as partial:
            write_json(partial, {"case": case.to_dict(), **outcome})

    def cpu_s(self, cases: list[Case]) -> float:
        """Processor seconds of the trainings and answers of `cases`, when they were run."""
        outcomes = {self.key(case): (self.map_key(case), self.found(case)) for case in cases}
        trained = {map_key: outcome["train_cpu_s"] for map_key, outcome in outcomes.values()}
        return float(sum(trained.values()) + sum(outcome["cpu_s"] for _, outcome in outcomes.values()))

    def map_file(self, case: Case) -> Path:
        """Where the map of a case is kept."""
        return self.out / "maps" / f"{self.map_key(case)}.evp"

    def checkpoint(self, case: Case) -> Path:
        """Where a case that takes long keeps what it has so far."""
        return self._file(case).with_suffix(".checkpoint")

    def result_folder(self, case: Case) -> Path:
        """Where the whole result of a case is kept."""
        return self.out / "results" / case.keep

    def _file(self, case: Case) -> Path:
        return self.out / "runs" / f"{self.key(case)}.json"
