"""The main job in minutes: learn a street by day, find it at night, in rain and from another path.

Examples:
  evplace demo
  evplace demo --quick                  a day and a night: a minute or two
  evplace demo --out demo
  evplace demo --drive-m 600 --train    a longer street; trains the paper's networks on it, with torch
  evplace demo --live                   the drive at night on a page, as it goes (the extra 'web')

Nothing is downloaded and no torch is needed: the virtual city makes the drives, and the paper's networks for
its usual street come with evplace (`--train` makes them anew). The folder keeps street.png, report.html,
report.png, result.json, the maps, and the result of each row.
"""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import os
from dataclasses import dataclass
from pathlib import Path

from evplace.cli._output import Show, print_json, print_table, progress, say, show_page
from evplace.core.errors import MissingExtraError, SettingsError
from evplace.core.storage import new_file, write_json
from evplace.evaluation.charts import accuracy_chart
from evplace.imaging.traverse import Traverse
from evplace.placemap import MARK, train
from evplace.places import PlaceGrid
from evplace.scorers.network import Network
from evplace_lab.city import CitySettings, Progress, generate, preview
from evplace_lab.demonstration import (
    INPUTS,
    METHODS,
    QUICK,
    USUAL,
    Row,
    Street,
    built_in_drives,
    python_of,
    results,
)
from evplace_lab.report import report


@dataclass(frozen=True)
class Args:
    """Flags of `evplace demo`."""

    out: Path = Path("evplace-demo")
    """The folder for the drives, the maps and the results; what is there is gone on with."""
    quick: bool = False
    """By day and at night alone, without rain and the second path."""
    drive_m: float = USUAL.length_m
    """Length of the street in metres."""
    train: bool = False
    """Train the paper's networks here, in place of those that come with evplace; needs torch."""
    json: bool = False
    """Print one JSON object."""
    live: bool = False
    """Only learn the street by day, then replay the drive at night and open the page that shows it."""
    port: int = 8000
    """The port of that page."""


def run(args: Args) -> int:
    """Make the drives, learn the maps, localise the queries, print and keep the answers."""
    if args.live:
        return _live(args)
    street, out = _street(args), args.out / "quick" if args.quick else args.out
    if not args.json:
        _say_what_comes(street, out)
    drives = _driven(out, street, shows=not args.json)
    with progress("looking") as show:
        rows = list(results(out, drives, street, args.train, show))
    rows.sort(key=lambda row: street.queries.index(str(row["query"])))
    with new_file(out / "result.json", overwrite=True) as partial:
        write_json(partial, {"rows": rows, "drive_m": street.length_m})
    with contextlib.suppress(MissingExtraError):
        accuracy_chart(rows, out / "report.png")
    page = report(out / "results", out / "report.html", overwrite=True).page
    if args.json:
        print_json({"rows": rows})
        return 0
    _print(rows, street)
    _say_what_now(rows, page, drives)
    show_page(page.resolve().as_uri())
    return 0


def _street(args: Args) -> Street:
    """What the flags ask for; SettingsError and MissingExtraError where that cannot be, before any work."""
    if args.train:
        Network().require()
    if args.drive_m != USUAL.length_m and not args.train:
        raise SettingsError(
            f"the paper's networks that come with evplace are of the street of {USUAL.length_m:.0f} m: add "
            "`train` to train others, which needs torch"
        )
    return dataclasses.replace(QUICK if args.quick else USUAL, length_m=args.drive_m)


def _say_what_comes(street: Street, out: Path) -> None:
    drives = len(street.queries) + 1
    say(
        f"evplace demo: {drives} drives of {street.length_m:.0f} m through a virtual city, by "
        f"{', '.join(street.conditions)}.",
        "The first is learned; the others are looked for, by events and by a colour camera, by",
        "evplace's own method and by the paper's network.",
        f"About {max(1, round(street.minutes))} min on {os.cpu_count()} cores; all of it is kept in {out}, "
        "and a call that was stopped goes on there.",
        "",
    )


def _driven(out: Path, street: Street, shows: bool) -> dict[str, Path]:
    """The drives, and while they are made a picture of the street."""
    picture = out / "street.png"
    out.mkdir(parents=True, exist_ok=True)
    if shows and not picture.exists():
        preview(picture, conditions=street.conditions)
    if shows:
        say(f"The street, colour above events: {picture}", "")
        show_page(picture.resolve().as_uri())
    with progress("driving through the city") as show:
        return built_in_drives(out / "city", street, lambda at: _show(show, at))


def _show(show: Show, at: Progress) -> None:
    """The city's own progress, in thousandths."""
    show(round(at.share * 1000), 1000, at.drive)


def _live(args: Args) -> int:
    """Learn the street by day, and serve the drive at night, over and over, until a signal comes."""
    from evplace.cli import serve
    from evplace.serving.server import check_web

    check_web()  # before the minutes that follow
    settings = CitySettings(
        fps=60, sensors=("ideal",), route_length_m=args.drive_m, conditions=("day", "night"), paths=(1,),
        keep_events=True,
    )  # fmt: skip
    say(
        f"evplace demo: a drive of {args.drive_m:.0f} m through a virtual city by day, which is learned, and "
        "one at night, which is looked for as it goes; a minute or two, then a page."
    )
    with progress("driving through the city") as show:
        paths = generate(args.out / "live", settings, progress=lambda at: _show(show, at))
    drives = {path.name: path for path in paths}
    place_map = args.out / "live.evp"
    if not (place_map / MARK).exists():
        reference = Traverse.load(drives["day-1"] / INPUTS["events"])
        assert reference.track is not None  # the city knows where it is
        train(reference, PlaceGrid.from_track(reference.track), preset="best").save(place_map)
    night = drives["night-1"] / f"{INPUTS['events']}.aedat4"
    return serve.run(
        serve.Args(map=place_map, source=str(night), source_set=(("loops", 0),), port=args.port, open=True)
    )


def _print(rows: list[Row], street: Street) -> None:
    """A line a query: each method on each input, of all images and of those whose place the map has."""
    by_key = {(row["query"], row["input"], row["matcher"]): row for row in rows}
    kinds = list(itertools.product(METHODS, INPUTS))
    table = []
    for query in street.queries:
        cells = [by_key[query, name, method] for method, name in kinds]
        shown = [cell[figure] for figure in ("accuracy", "accuracy_seen") for cell in cells]
        table.append([query, *map(_percent, shown), _percent(cells[0]["chance_seen"])])
    heads = [f"{method}, {name}" for method, name in kinds]
    columns = ("query", *heads, *(f"{head}, seen" for head in heads), "chance, seen")
    print_table(
        "Accuracy in % of live answers; seen: the map has that view; the map is day-1, the query as named",
        columns,
        table,
    )


def _say_what_now(rows: list[Row], page: Path, drives: dict[str, Path]) -> None:
    """The verdict, where to look, and what to do with recordings of one's own."""
    say(
        "",
        verdict(rows),
        "",
        f"To look at: {page}",
        "",
        "With your own recordings, an event camera's file and a GPS log of each drive:",
        "",
        "  evplace train day.aedat4 --track day.nmea -o street.evp",
        "  evplace evaluate street.evp night.aedat4 --track night.nmea -o night.result",
        "  evplace report night.result",
        "",
        "The same in Python, on the demo's own drives:",
        "",
        *(f"  {line}" for line in python_of(drives)),
    )


def verdict(rows: list[Row]) -> str:
    """What was seen, in words."""
    share = {(row["query"], row["input"], row["matcher"]): row["accuracy_seen"] for row in rows}
    night = {kind: _percent(share["night-1", *kind]) for kind in itertools.product(INPUTS, METHODS)}
    found = (
        f"At night, events find {night['events', 'best']} % of the street's images and colour "
        f"{night['colour', 'best']} %; the paper's method finds {night['events', 'paper']} and "
        f"{night['colour', 'paper']} %"
    )
    best = [row for row in rows if row["matcher"] == "best" and row["input"] == "events"]
    called = [float(str(row["unseen_rejected"])) for row in best if row["unseen_rejected"] is not None]
    if not called:
        return f"{found}."
    return (
        f"{found}. On the other path, {_percent(sum(called) / len(called))} % of the images of streets that "
        "the map has never seen were called just that."
    )


def _percent(share: object) -> str:
    return f"{100 * share:.1f}" if isinstance(share, float) else "-"
