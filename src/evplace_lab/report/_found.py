"""What a folder holds that a page can show: tables and curves as JSON, and results."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from evplace.core.errors import InputError
from evplace.core.folders import RESULT, instead
from evplace.core.storage import read_json
from evplace.evaluation import Result

T = TypeVar("T")


@dataclass(frozen=True)
class TableRow:
    """One query by one method; figures in %, None where there is none."""

    query: str
    input: str
    matcher: str
    mean: float
    database: str = ""
    sensor: str = ""
    rule: str = "places"
    answers: str = "hindsight"
    """"live" or "hindsight", which is what tables held before they said so."""
    spread: float | None = None
    seeds: int | None = None
    seen: float | None = None
    rejected: float | None = None
    chance: float | None = None
    paper: float | None = None


@dataclass(frozen=True)
class Ablation:
    """One change and what it did; figures in %, effects in points."""

    name: str
    change: str
    mean: float
    effect: float
    query: str = ""
    method: str = ""
    spread: float | None = None
    effect_spread: float | None = None
    verdict: str = ""
    seeds: int | None = None


@dataclass(frozen=True)
class Curve:
    """One method's precision and recall in one panel."""

    panel: str
    points: Sequence[Sequence[float | None]]
    """[value of the parameter, recall, precision] each."""
    query: str = ""
    input: str = ""
    sensor: str = ""
    matcher: str = ""
    answers: str = "hindsight"
    """As in TableRow."""
    parameter: str = "threshold"
    average_precision: float | None = None
    spread: float | None = None
    seeds: int | None = None

    def __post_init__(self) -> None:
        _check_points(self.points, 3)


@dataclass(frozen=True)
class PaperCurve:
    """The paper's, read off its figure."""

    panel: str
    method: str
    points: Sequence[Sequence[float | None]]
    """[recall, precision] each."""

    def __post_init__(self) -> None:
        _check_points(self.points, 2)


@dataclass(frozen=True)
class Sheet:
    """One JSON file: its rows, and all else that stands in it."""

    rows: tuple[Any, ...]
    others: tuple[Any, ...] = ()
    rest: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Found:
    """All that is there."""

    name: str
    """The folder's."""
    table: Sheet | None
    """TableRow each."""
    curves: Sheet | None
    """Curve each; the others are PaperCurve."""
    ablations: Sheet | None
    """Ablation each."""
    results: dict[str, Result]
    """Name -> result, by name; below the folder as results/a where there is also an a."""
    real: Sheet | None = None
    """TableRow each, of real sets."""


def look(folder: Path) -> Found:
    """What is in a folder; InputError where it is none, holds nothing to show, or something is damaged."""
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder: give one that holds results")
    found = Found(
        folder.resolve().name,
        _sheet(folder / "table2.json", "evplace-table-1", rows=TableRow),
        _sheet(folder / "figure5.json", "evplace-curves-1", curves=Curve, paper=PaperCurve),
        _sheet(folder / "ablations.json", "evplace-ablations-1", rows=Ablation),
        {name: Result.load(path) for name, path in _result_folders(folder).items()},
        _sheet(folder / "real.json", "evplace-table-1", rows=TableRow),
    )
    if not (found.table or found.real or found.curves or found.ablations or found.results):
        raise InputError(
            instead(folder, RESULT)
            or f"{folder} holds nothing to report on: give a result that `evplace evaluate` wrote, or a "
            "folder of such results"
        )
    return found


def _result_folders(folder: Path) -> dict[str, Path]:
    """The folder itself where it is a result, else those in it and in its results/; in natural order."""
    if _is_result(folder):
        return {folder.resolve().name: folder}
    outer = {path.name for path in folder.iterdir() if _is_result(path)}
    inner = [*folder.iterdir(), *(folder / "results").glob("*")]
    found = {}
    for path in sorted(filter(_is_result, inner), key=_natural):
        taken = path.parent != folder and path.name in outer
        found[f"results/{path.name}" if taken else path.name] = path
    return found


def _is_result(folder: Path) -> bool:
    return not folder.name.startswith(".") and (folder / "matches.csv").is_file()


def _natural(path: Path) -> list[tuple[int, str]]:
    """Numbers in a name count as numbers: K 5 comes before K 10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", path.name)]


def _sheet(path: Path, wanted: str, **lists: type[Any]) -> Sheet | None:
    """A JSON file's lists of records; None where there is no file."""
    if not path.exists():
        return None
    content = read_json(path, path.name)
    _check_format(path, content.get("format"), wanted)
    taken = [_records(path, content.get(name, []), name, kind) for name, kind in lists.items()]
    rest = {key: value for key, value in content.items() if key not in lists and key != "format"}
    return Sheet(taken[0], taken[1] if len(taken) > 1 else (), rest)


def _check_format(path: Path, given: object, wanted: str) -> None:
    if given == wanted:
        return
    stem, _, number = wanted.rpartition("-")
    version = re.fullmatch(rf"{stem}-(\d+)", str(given))
    if version and int(version[1]) > int(number):
        raise InputError(
            f"{path} has the format {given}, this evplace reads {wanted}: it was made by a newer version"
        )
    raise InputError(f"{path} has the format {given}, not {wanted}: make it again")


def _records(path: Path, values: object, name: str, kind: type[T]) -> tuple[T, ...]:
    if not isinstance(values, list):
        raise InputError(f"{path} is damaged: its {name} are no list; make it again")
    try:
        return tuple(_record(kind, value) for value in values)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{path} is damaged: its {name} hold {error}; make it again") from error


def _record(kind: type[T], values: Mapping[str, Any]) -> T:
    """A record of known fields; what else there is is passed over. ValueError says what does not fit."""
    hints = get_type_hints(kind)
    taken = {}
    for one in dataclasses.fields(kind):  # type: ignore[arg-type]  # a dataclass, which no TypeVar says
        if one.name in values:
            taken[one.name] = _CHECKS[hints[one.name]](values[one.name], one.name)
        elif one.default is dataclasses.MISSING:
            raise ValueError(f"an entry without '{one.name}'")
    return kind(**taken)


def _text(value: object, name: str) -> str:
    if not isinstance(value, str):
        raise ValueError(f"the {name} {value!r}, which is no text")
    return value


def _number(value: object, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"the {name} {value!r}, which is no number")
    return value


def _number_or_none(value: object, name: str) -> float | None:
    return None if value is None else _number(value, name)


def _check_points(points: Sequence[Sequence[float | None]], wanted: int) -> None:
    for point in points:
        if len(point) != wanted:
            raise ValueError(f"the point {point}, where {wanted} numbers are wanted")


def _points(value: object, name: str) -> Sequence[Sequence[float | None]]:
    if not isinstance(value, list):
        raise ValueError(f"the {name} {value!r}, which are no list")
    return [[_number_or_none(number, "coordinate") for number in point] for point in value]


_CHECKS: dict[Any, Callable[[object, str], Any]] = {
    str: _text,
    float: _number,
    float | None: _number_or_none,
    int | None: _number_or_none,
    Sequence[Sequence[float | None]]: _points,
}
"""Type of a field -> what checks it."""
