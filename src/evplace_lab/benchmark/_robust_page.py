"""Curves of what is lost when drives are worse: one HTML page that opens without a network or a script."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from evplace import __version__
from evplace.core.storage import new_file
from evplace_lab.benchmark.robustness import METHODS, tables
from evplace_lab.report._html import Html, join, tag

WIDTH, HEIGHT = 340, 230
LEFT, RIGHT, TOP, BOTTOM = 40, 10, 10, 42
NAMES = {"best": "evplace", "ncc": "correlation", "paper": "the paper's network"}
STYLE = Path(__file__).with_name("robustness.css")


def page(document: Mapping[str, Any], path: Path) -> Path:
    """Write the page of a document of `robustness`; one that is there is replaced."""
    panels = [_panel(recipe, document["rows"]) for recipe in document["recipes"]]
    title = "What is lost when a drive is worse"
    chance = next(row["chance"] for row in document["rows"])
    about = (
        "The map is a street of the virtual city by day, the query the same street at night by the ideal "
        "sensor. Shown is the share of images that are answered rightly, live: in the right cell of 20 m or "
        "beside it, where the map has a view within 20 m and 34 degrees. Dashed is the clean case. What is "
        f"rejected counts as not right; an answer drawn at random would be right in {100 * chance:.0f} %."
    )
    (table,) = tables(dict(document))
    figures = tag("div", _table(table.columns, table.rows), class_="scroll")
    body = join(
        tag("h1", title), tag("p", about), _key(), tag("div", *panels, class_="grid"),
        tag("section", tag("h2", table.title), figures),
        tag("p", f"Made by evplace {__version__}. This page is one file and loads nothing."),
    )  # fmt: skip
    head = join(
        tag("title", title),
        Html('<meta charset="utf-8">'),
        Html('<meta name="viewport" content="width=device-width, initial-scale=1">'),
        tag("style", Html(STYLE.read_text("utf-8"))),
    )
    with new_file(path, overwrite=True) as partial:
        partial.write_text(
            f'<!doctype html>\n<html lang="en">{tag("head", head)}{tag("body", body)}</html>\n', "utf-8"
        )
    return path


def _key() -> Html:
    swatches = []
    for number, method in enumerate(METHODS):
        line = tag("line", x1=1, x2=25, y1=6, y2=6, class_=f"m{number}", stroke_width="2.4")
        swatches.append(tag("span", tag("svg", line, width=26, height=12, aria_hidden="true"), NAMES[method]))
    return tag("div", *swatches, class_="key")


def _panel(recipe: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> Html:
    mine = [row for row in rows if row["kind"] == recipe["kind"]]
    levels = sorted({row["level"] for row in mine})
    low, high = levels[0], max(levels[-1], levels[0] + 1e-9)

    def at(level: float, share: float) -> tuple[float, float]:
        x = LEFT + (level - low) / (high - low) * (WIDTH - LEFT - RIGHT)
        return round(x, 1), round(TOP + (1 - share) * (HEIGHT - TOP - BOTTOM), 1)

    drawn = [_axes(levels, at, recipe)]
    for number, method in enumerate(METHODS):
        points = [at(row["level"], row["accuracy"]) for row in mine if row["method"] == method]
        drawn.append(tag("polyline", points=" ".join(f"{x},{y}" for x, y in points), class_=f"m{number}"))
        drawn += [tag("circle", cx=str(x), cy=str(y), r=3, class_=f"m{number}") for x, y in points]
    label = f"{recipe['title']}: accuracy over {recipe['unit']}"
    picture = tag("svg", *drawn, viewBox=f"0 0 {WIDTH} {HEIGHT}", width=WIDTH, role="img", aria_label=label)
    return tag("section", tag("h2", recipe["title"]), tag("p", recipe["about"]), picture)


def _axes(levels: Sequence[float], at: Any, recipe: Mapping[str, Any]) -> Html:
    parts = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        (x, y), (end, _) = at(levels[0], share), at(levels[-1], share)
        parts.append(tag("line", x1=str(x), x2=str(end), y1=str(y), y2=str(y)))
        parts.append(tag("text", f"{100 * share:.0f}", x=str(x - 6), y=str(y + 4), text_anchor="end"))
    shown = [
        level for number, level in enumerate(levels) if number == 0 or _apart(at, levels[number - 1], level)
    ]
    for level in shown:
        x, y = at(level, 0)
        parts.append(tag("text", f"{level:.4g}", x=str(x), y=str(y + 16), text_anchor="middle"))
    (x, top), (_, bottom) = at(recipe["clean"], 1), at(recipe["clean"], 0)
    parts.append(tag("line", x1=str(x), x2=str(x), y1=str(top), y2=str(bottom), class_="clean"))
    parts.append(
        tag("text", recipe["unit"], x=(LEFT + WIDTH - RIGHT) // 2, y=HEIGHT - 6, text_anchor="middle")
    )
    return tag("g", *parts)


def _apart(at: Any, one: float, other: float) -> bool:
    return bool(at(other, 0)[0] - at(one, 0)[0] >= 18)


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Html:
    head = tag("tr", *(tag("th", _named(name)) for name in columns))
    return tag("table", head, *(tag("tr", *(tag("td", cell) for cell in row)) for row in rows))


def _named(column: str) -> str:
    """Methods by their names for people."""
    first, *others = column.split(" ")
    return " ".join([NAMES.get(first, first), *others])
