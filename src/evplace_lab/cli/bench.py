"""Judge another method beside ours: its scores, descriptors or ranked lists, by the benchmark's rules.

Examples:
  evplace bench --city city --method mine=mine/                one file or folder for each query drive
  evplace bench --city city --method mine=mine.npy --queries night-1
  evplace bench --city city --method a=a/ --method b=b/ --matchers best hmm -o out
  evplace bench check --city city --method mine=mine/          only whether all fits, and what it is taken for
  evplace bench export --city city -o layout                   the tasks and our lists in MegaEvent's layout
  evplace bench robustness -o out                              what is lost when a drive is worse, in minutes
  evplace bench robustness -o out --kinds noise lateral

The map is day-1; a query drive's rows are all its images, its columns all images of day-1, in their order.
docs/protocol.md says which files are read, what is frozen and what counts. OUT gets bench.json and results;
`evplace report OUT` makes a page of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro
from tyro.constructors import PrimitiveConstructorSpec

from evplace.cli._output import note, print_json, print_table, progress, say
from evplace.core.errors import SettingsError
from evplace_lab.benchmark import OURS, Given, Rule, Submission, bench, check, robustness, tables, tasks_of
from evplace_lab.benchmark._expected import METHOD, expected, held
from evplace_lab.benchmark._exports import export
from evplace_lab.benchmark._robust_page import page

Layout = Literal["query-reference", "reference-query"]


def named_path(text: str) -> tuple[str, str]:
    """`mine=mine.npy` as ("mine", "mine.npy"); a path alone is named by its last part."""
    name, equals, path = text.partition("=")
    return (name, path) if equals and name and path else (Path(text).stem, text)


_NAMED = PrimitiveConstructorSpec(
    nargs=1,
    metavar="NAME=PATH",
    instance_from_str=lambda words: named_path(words[0]),
    is_instance=lambda value: isinstance(value, tuple),
    str_from_instance=lambda value: ["=".join(value)],
)


@dataclass(frozen=True)
class Args:
    """Flags of `evplace bench`."""

    what: tyro.conf.Positional[Literal["judge", "check", "export", "robustness"]] = "judge"
    """judge; check: read the methods' files and say what they are taken for; export: write the tasks;
    robustness: make a street's drive worse in many ways, and see what is still found."""
    city: Path | None = None
    """Drives that `evplace city` made."""
    method: Annotated[
        tuple[Annotated[tuple[str, str], _NAMED], ...],
        tyro.conf.UseAppendAction,
        tyro.conf.arg(help_behavior_hint="(repeatable)"),
    ] = ()
    """A method's name and its file or folder."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("evplace-bench")
    """The folder for bench.json and the results."""
    queries: tuple[str, ...] = ()
    """Only these drives, for example night-1; all but day-1 if not given."""
    input: str = "ideal"
    """Which images of each drive: ideal, weak, from-8bit or colour."""
    rule: Rule = "view"
    """view: a reference within 20 m that looks within 34 degrees the same way. places: the paper's eight
    neighbours. radius: within 25 m."""
    ours: tuple[str, ...] = ("best", "best, single images", "ncc")
    """Which of ours stand beside: best, 'best, single images', ncc, paper (needs torch)."""
    matchers: tuple[str, ...] = ("best",)
    """What the methods' scores are matched with; `evplace list matchers` says what each does."""
    layout: Layout | None = None
    """What the rows and columns of a method's matrices are; by default what fits their shape."""
    distances: bool = False
    """Smaller is better in the methods' matrices."""
    kinds: tuple[str, ...] = ()
    """For robustness: only these, for example noise lateral."""
    workers: int | None = None
    """For robustness: processes; one a core if not given."""
    json: bool = False
    """Print one JSON object."""


def run(args: Args) -> int:
    """Judge, check, export, or make worse."""
    if args.what == "robustness":
        return _robustness(args)
    if args.city is None:
        raise SettingsError("say which drives: `city`, a folder that evplace city has made")
    return _on_a_city(args, args.city)


def _on_a_city(args: Args, city: Path) -> int:
    """Judge, check or export on a city's drives."""
    tasks = tasks_of(city, args.input, args.queries, args.rule)
    if args.what == "export":
        files = export(tasks, args.out)
        print_json({"files": [str(file) for file in files]}) if args.json else say(*map(str, files))
        return 0
    methods = [Submission(name, Path(path), args.layout, args.distances) for name, path in args.method]
    for method in methods:
        if method.path.is_file() and len(tasks) > 1:
            raise SettingsError(
                f"{method.path} is of one drive: name it with `queries`, or give a folder of one file a drive"
            )
    if args.what == "check":
        return _checked(args, check(tasks, methods))
    for name in args.ours:
        if name not in OURS:
            raise SettingsError(f"'{name}' is none of ours: known are {', '.join(OURS)}")
    with progress("judging") as show:
        document = bench(tasks, methods, args.ours, args.matchers, args.out, show)
    if args.json:
        print_json(document)
        return 0
    for table in tables(document):
        print_table(*table)
    _say_held(document, city)
    say(f"Kept in {args.out}/bench.json; evplace report {args.out} makes a page of it")
    return 0


def _say_held(document: dict[str, Any], city: Path) -> None:
    """Whether our own figures are those that were found before, where there are such."""
    known, (alike, others) = expected(), held(document, city)
    for other in others:
        note(other)
    if alike:
        figures = f"{alike} of {alike + len(others)}" if others else f"All {alike}"
        say(
            f"{figures} figures of '{METHOD}' are those of evplace {known['evplace']} on {known['city']}, "
            f"within {known['tolerance']:g} point"
        )


def _checked(args: Args, found: list[tuple[str, str, Given]]) -> int:
    rows = [
        [name, query, given.kind, "all" if given.listed is None else str(given.listed)]
        for name, query, given in found
    ]
    if args.json:
        keys = ("method", "query", "kind", "listed")
        print_json({"files": [dict(zip(keys, row, strict=True)) for row in rows]})
        return 0
    if not rows:
        note("there is no method to check: give one by --method NAME=PATH")
        return 2
    print_table("All files fit", ("method", "query", "taken for", "references a query"), rows)
    return 0


def _robustness(args: Args) -> int:
    """A street's drive, made worse."""
    with progress("making it worse") as show:
        document = robustness.robustness(
            args.out, args.kinds, args.workers, lambda at: show(round(at.share * 1000), 1000, at.drive), show
        )
    written = page(document, args.out / "robustness.html")
    if args.json:
        print_json(document)
        return 0
    for table in robustness.tables(document):
        print_table(*table)
    say(f"Kept in {args.out}/robustness.json; with curves: {written}")
    return 0
