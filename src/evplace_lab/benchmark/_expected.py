"""What evplace itself was found to do on the frozen city, and where a run finds something else."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from evplace.core import settings
from evplace.core.folders import CITY
from evplace.core.storage import read_json
from evplace_lab.city import CitySettings

FILE = Path(__file__).with_name("expected.toml")
METHOD = "best"


def expected() -> dict[str, Any]:
    """Input -> query -> figure, in %, with the versions that it is of."""
    return settings.from_toml(FILE)


def deviations(document: dict[str, Any], city: Path) -> Iterator[str]:
    """A sentence for each figure of ours that is another than was found before; none of another city."""
    known = expected()
    if document["rule"] != known["rule"] or not _is_frozen(city, known["city"]):
        return
    for row in document["rows"]:
        wanted = known.get(document["input"], {}).get(row["query"], {})
        for name in wanted if row["method"] == METHOD else ():
            found = 100 * row[name]
            if abs(found - wanted[name]) > known["tolerance"]:
                before = f"evplace {known['evplace']} was found to have {wanted[name]:.1f} %"
                yield f"{row['query']}: {name} of '{METHOD}' is {found:.1f} %, where {before}"


def _is_frozen(city: Path, version: str) -> bool:
    """Whether a city was made as the benchmark is; which sensors there are does not matter."""
    about = read_json(city / CITY, f"the settings of {city}")
    wanted = {"version": version, **CitySettings().of_drive()}
    beside = ("sensors", "keep_events")
    return all(about.get(name) == value for name, value in wanted.items() if name not in beside)
