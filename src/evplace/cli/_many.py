"""One command for many drives: each is done as if it were named alone, several at a time.

A call that was stopped goes on where it was: a file beside the outputs says how each was made, and one that
is there and was made so is kept.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from evplace.cli._output import note, print_facts, print_json, progress
from evplace.cli._settings import NAME
from evplace.core.errors import EvplaceError, OutputError, SettingsError
from evplace.core.storage import new_file, read_json, remove_left, write_json
from evplace.core.workers import run_all
from evplace.drives import datasets

LIST = "drives.json"
"""The file beside the outputs that says how each was made."""
ALL = "all"
"""In place of a drive's name: every drive of the data set."""
IDLE = (
    "sources", "drive", "out", "overwrite", "yes", "json", "sheet", "workers", "on", "given", "settings",
    "show_settings",
)  # fmt: skip
"""Flags that change no output, or are told by its name."""


class Made(NamedTuple):
    """What a command says of one drive."""

    facts: dict[str, Any]
    """Name -> value, ready for JSON."""
    notes: list[str]
    """Remarks, for people."""
    code: int
    """The exit code."""


class ManyArgs(Protocol):
    """The flags of a command that takes many drives."""

    @property
    def sources(self) -> tuple[Path, ...]: ...
    @property
    def drive(self) -> str | None: ...
    @property
    def dataset(self) -> str | None: ...


@dataclasses.dataclass(frozen=True)
class _Output:
    """One drive's output."""

    path: Path
    args: Any
    """The flags as they would be for this drive alone."""
    how: dict[str, Any]
    """What the output depends on."""


def are_many(args: ManyArgs) -> bool:
    """Whether the flags name more than one drive, or might."""
    if not args.sources:
        raise SettingsError("nothing is named that could be read: give a recording, or several")
    return len(args.sources) > 1 or args.drive == ALL or "," in (args.drive or "")


def run_many(command: str, args: Any) -> int:
    """Run `evplace COMMAND` on every drive that `args` name, into folders of `args.out`; the exit code."""
    outputs = [_output(args, name, *drive) for name, drive in _named(_drives(args)).items()]
    kept = _kept(args.out / LIST)
    todo = [output for output in outputs if not _is_there(output, kept, args.overwrite)]
    results: dict[Path, dict[str, Any]] = {
        output.path: {"out": str(output.path), "kept": True} for output in outputs if output not in todo
    }
    codes = _run(command, args, todo, kept, results)
    if args.json:
        print_json([results[output.path] for output in outputs])
    elif len(todo) < len(outputs):
        note(f"{len(outputs) - len(todo)} of {len(outputs)} were there already and are kept")
    return 2 if 2 in codes else max(codes, default=0)


def _run(
    command: str, args: Any, todo: list[_Output], kept: dict[str, Any], results: dict[Path, Any]
) -> list[int]:
    """Do what is to be done, and fill `results`; the exit codes."""
    file, codes = args.out / LIST, list[int]()
    # What is there already is of another making until it is replaced.
    _keep(file, kept, {one.path.name: {} if one.path.exists() else one.how for one in todo})

    def ended(index: int, result: dict[str, Any], notes: Iterable[str], code: int) -> None:
        path = todo[index].path
        results[path] = {"out": str(path)} | result
        codes.append(code)
        if not args.json and code != 2:
            print_facts(str(path), result)
        for line in notes:
            note(f"{path.name}: {line}")
        show(len(codes), len(todo), path.name)

    def said(index: int, line: str) -> None:
        made = Made(*json.loads(line))
        _keep(file, kept, {todo[index].path.name: todo[index].how})
        ended(index, made.facts, made.notes, made.code)

    def failed(index: int, error: EvplaceError) -> None:
        ended(index, {"error": str(error)}, [str(error)], 2)

    jobs = [{"command": command, "args": _plain(output.args)} for output in todo]
    with args.opened_workers() as workers, progress(command) as show:
        try:
            run_all("evplace.cli._worker", jobs, workers, args.out, said, failed)
        finally:
            for output in todo:
                remove_left(output.path)
    return codes


def _drives(args: ManyArgs) -> list[tuple[Path, str | None]]:
    """Every source, and of a data set every drive that is asked for."""
    found: list[tuple[Path, str | None]] = []
    for source in args.sources:
        if args.drive is None:
            found.append((source, None))
        elif args.drive == ALL:
            found += [(source, name) for name in datasets.drives(source, args.dataset)]
        else:
            found += [(source, name.strip()) for name in args.drive.split(",")]
    return found


def _named(drives: list[tuple[Path, str | None]]) -> dict[str, tuple[Path, str | None]]:
    """Each by a name of its own: its file's or drive's, after its folder's where some are alike."""
    names = [_name(source, drive) for source, drive in drives]
    if len(set(names)) < len(names):
        places = [
            source.resolve() if drive is not None else source.resolve().parent for source, drive in drives
        ]
        names = [f"{place.name}-{name}" for place, name in zip(places, names, strict=True)]
    for name in names:
        if names.count(name) > 1:
            raise SettingsError(
                f"two drives would both be called '{name}': name each once, or give them apart"
            )
    return dict(zip(names, drives, strict=True))


def _name(source: Path, drive: str | None) -> str:
    place = source.resolve()
    name = drive if drive is not None else place.name if place.is_dir() else place.stem
    return name.replace("/", "-").replace("\\", "-")


def _output(args: Any, name: str, source: Path, drive: str | None) -> _Output:
    """The flags for one drive, and what its output depends on."""
    values = {key: getattr(args, key) for key in (field.name for field in dataclasses.fields(args))}
    own = {
        key: Path(str(value).replace(NAME, name))
        for key, value in values.items()
        if isinstance(value, Path) and NAME in str(value)
    }
    if values.get("sheet") is not None and "sheet" not in own:
        raise SettingsError(f"many drives need many names: write {NAME} in `sheet`, as in sheets/{NAME}.png")
    path = args.out / name
    one = dataclasses.replace(args, sources=(source,), drive=drive, out=path, **own)
    how = {key: value for key, value in _plain(one).items() if key not in IDLE}
    files = [source, *(value for key, value in vars(one).items() if isinstance(value, Path) and key in how)]
    return _Output(path, one, how | {"of": [str(source), drive], "files": [_state(file) for file in files]})


def _state(file: Path) -> list[int]:
    """What tells that a file has changed: its size and time of change; nothing for a folder."""
    if not file.is_file():
        return []
    found = file.stat()
    return [found.st_size, found.st_mtime_ns]


def _is_there(output: _Output, kept: Mapping[str, Any], overwrite: bool) -> bool:
    """Whether an output was made just so; OutputError where it was made otherwise, or by somebody else."""
    if not output.path.exists() or overwrite:
        return False
    if kept.get(output.path.name) == output.how:
        return True
    raise OutputError(
        f"{output.path} exists, and was made otherwise or of another file: choose another folder, or add "
        "`overwrite=True`"
    )


def _kept(file: Path) -> dict[str, Any]:
    return read_json(file, "the list of drives") if file.exists() else {}


def _keep(file: Path, kept: dict[str, Any], new: Mapping[str, Any]) -> None:
    """Add to the list."""
    kept |= new
    with new_file(file, overwrite=True) as partial:
        write_json(partial, kept)


def _plain(args: Any) -> dict[str, Any]:
    """Flags as JSON has them."""
    plain: dict[str, Any] = json.loads(json.dumps(dataclasses.asdict(args), default=str))
    return plain
