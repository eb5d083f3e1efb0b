"""What several commands print."""

from __future__ import annotations

import contextlib
import json
import math
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

Show = Callable[[int, int, str], None]
"""Moves a progress bar: (done, total, remark)."""
ARGUMENT = re.compile(r"`([a-z]\w*)(?:=([^`]*))?`")
"""An argument as the library's texts name it: see `evplace.core.errors`."""
FLAGS = {
    "listing": "list", "offset_us": "track_offset", "date": "track_date", "keep": "track_keep",
    "max_speed_mps": "track_max_speed",
}  # fmt: skip
"""Argument of the library -> field of Args, where their names differ."""
OF_TRACK = re.compile(r"`open_track\((\w+)=([^)`]*)\)`")
"""A setting of a track's format as the library's texts name it."""
USED_GOOD_PART = 3
"""Exit code where a recording is damaged and its good part was used."""


def shown(text: str) -> str:
    """A text on one line; what no terminal shows, such as codes in a file's name, is escaped."""
    return "".join(sign if sign.isprintable() else ascii(sign)[1:-1] for sign in text)


def in_flags(text: str) -> str:
    """A text of the library as `shown`, its arguments as flags: `time_unit` is --time-unit."""
    return ARGUMENT.sub(_flag, OF_TRACK.sub(r"--track-set \1=\2", shown(text)))


def _flag(argument: re.Match[str]) -> str:
    name, value = FLAGS.get(argument[1], argument[1]).replace("_", "-"), argument[2]
    if argument[1] == "offset_us" and value is not None:
        value = f"{int(value) / 1e6:.6f}".rstrip("0").rstrip(".")  # the flag takes seconds
    if value in (None, "True"):
        return f"--{name}"
    return f"--no-{name}" if value == "False" else f"--{name} {value}"


def say(*lines: str) -> None:
    """Lines for people on standard output, each as `shown`."""
    print("\n".join(map(shown, lines)))


def print_json(value: object) -> None:
    """One JSON object on standard output; NaN becomes null, because JSON has none, and a path its text."""
    print(json.dumps(_plain(value), default=str))


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """A table for people."""
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(shown(title)), title_justify="left", box=box.SIMPLE_HEAD)
    for column in columns:
        table.add_column(Text(shown(column)))  # as it is: [x] is none of rich's marks
    for row in rows:
        table.add_row(*[Text(shown(cell) if isinstance(cell, str) else _text(cell)) for cell in row])
    Console(width=None if sys.stdout.isatty() else 160).print(table)


def print_settings(settings: Mapping[str, tuple[object, str]], as_json: bool) -> None:
    """Settings with their values and where these came from, for people or as one JSON object."""
    if as_json:
        print_json({name: {"value": value, "from": source} for name, (value, source) in settings.items()})
        return
    rows = [(name, str(value), source) for name, (value, source) in settings.items()]
    print_table("", ("setting", "value", "from"), rows)


def print_facts(title: str, facts: Mapping[str, object]) -> None:
    """Names and values for people; a mapping is written as its counts above zero."""
    width = max(len(name) for name in facts)
    say(title, *(f"  {name:<{width}}  {_text(value)}" for name, value in facts.items()))


def note(text: str) -> None:
    """A remark beside the answer: one line on standard error, where there is any."""
    with contextlib.suppress(OSError):
        print(f"evplace: {in_flags(' '.join(text.splitlines()))}", file=sys.stderr, flush=True)


def note_guesses(notes: object) -> None:
    """What was guessed of a recording, a remark each; `notes` are its own or those that a traverse kept."""
    for guess in notes if isinstance(notes, list) else []:
        note(str(guess))


def show_page(address: str) -> None:
    """Open a page or picture in a browser, where that is a window: in a terminal it would take that over."""
    if sys.platform in ("win32", "darwin") or {"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ):
        import webbrowser

        webbrowser.open(address)


@contextlib.contextmanager
def remarks() -> Iterator[None]:
    """Warnings within the block as remarks, once it ends well."""
    with warned() as texts:
        yield
    for text in texts:
        note(text)


@contextlib.contextmanager
def warned() -> Iterator[list[str]]:
    """The texts of warnings within the block, once it ends well."""
    texts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield texts
    texts += [str(warning.message) for warning in caught]


@contextlib.contextmanager
def progress(what: str) -> Iterator[Show]:
    """A bar with rate and time left, on standard error; call what it gives with (done, total, remark)."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn(what),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[remark]}"),
    )
    with Progress(*columns, console=Console(stderr=True), disable=not sys.stderr.isatty()) as bar:
        task = bar.add_task(what, rate="", remark="")

        def show(done: int, total: int, remark: str) -> None:
            speed = bar.tasks[0].speed
            rate = f"{speed:.1f}/s" if speed else ""
            bar.update(task, completed=done, total=total, rate=rate, remark=remark)

        yield show


def _text(value: object) -> str:
    if isinstance(value, float):
        return "-" if math.isnan(value) else f"{value:.4g}"
    if isinstance(value, dict):
        return ", ".join(f"{inner:,} {name}" for name, inner in value.items() if inner) or "none"
    if isinstance(value, int) and not isinstance(value, bool):
        return f"{value:,}"
    return "-" if value is None else in_flags(str(value))


def _plain(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return value
