"""What evplace itself was found to do on the frozen city, and how a run stands against it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from evplace.core import settings
from evplace.core.folders import CITY
from evplace.core.storage import read_json
from evplace_lab.city import CitySettings

FILE = Path(__file__).with_name("expected.toml")
METHOD = "best"


def expected() -> dict[str, Any]:
    """Input -> query -> figure, in %, with the versions that it is of."""
    return settings.from_toml(FILE)


class Held(NamedTuple):
    """How the figures of a run stand against those that were found before."""

    alike: int
    """How many are as before."""
    others: list[str]
    """A sentence for each that is not."""


def held(document: dict[str, Any], city: Path) -> Held:
    """The figures of ours against those that were found before; none of another city, or by another rule."""
    known, compared = expected(), []
    if document["rule"] == known["rule"] and _is_frozen(city, known["city"]):
        for row in (row for row in document["rows"] if row["method"] == METHOD):
            wanted = known.get(document["input"], {}).get(row["query"], {})
            compared += [(row["query"], name, 100 * row[name], wanted[name]) for name in wanted]
    others = [
        f"{query}: {name} of '{METHOD}' is {found:.1f} %, where evplace {known['evplace']} was found to have "
        f"{before:.1f} %"
        for query, name, found, before in compared
        if abs(found - before) > known["tolerance"]
    ]
    return Held(len(compared) - len(others), others)


def _is_frozen(city: Path, version: str) -> bool:
    """Whether a city was made as the benchmark is; which sensors there are does not matter."""
    about = read_json(city / CITY, f"the settings of {city}")
    wanted = {"version": version, **CitySettings().of_drive()}
    beside = ("sensors", "keep_events")
    return all(about.get(name) == value for name, value in wanted.items() if name not in beside)
