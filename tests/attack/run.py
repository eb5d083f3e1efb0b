"""The attack: what other programs, broken and full disks, kills and hostile people do, in great number.

    python tests/attack/run.py --share 1 --keep FILE      all of it; begun again, it goes on
    python tests/attack/run.py --share 0.01               a hundredth

It prints a line for each kind, and ends with 1 where anything was found: a crash, a hang of over 10 s of
work, an exception that nobody meant, an output that is not whole, or more than 512 MB of memory. See
docs/promises.md.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

from cases import BOARD, ISOLATED, damaged, whole
from outputs import Outcome, full_disks, hostile_files, kills, prepared

from evplace.core.errors import EvplaceError
from evplace.sources.readers import open_recording
from evplace.testing._readers import SIZE, check_packets

MOST_MB = 512
FOLDERS_OF = ("map-grid", "map-runs", "map-seqslam", "map-network", "traverse", "result")
FLIPS, CUTS, LOGS, FOLDERS, SETTINGS, KILLS = 100_000, 10_000, 100_000, 2_000, 2_000, 200


@dataclass
class Counts:
    """What became of the cases of one kind."""

    cases: int = 0
    answered: int = 0
    refused: int = 0
    crashes: int = 0
    """Of a process that nobody guards."""
    guarded: int = 0
    """Ends of a decoder's process, which its caller turns into one line."""
    hangs: int = 0
    foreign: int = 0
    corrupt: int = 0
    megabytes: int = 0
    found: list[str] = field(default_factory=list)

    @property
    def is_good(self) -> bool:
        return not (self.crashes or self.hangs or self.foreign or self.corrupt) and self.megabytes <= MOST_MB

    def __str__(self) -> str:
        counts = {
            "cases": self.cases, "answered": self.answered, "refused": self.refused, "crashes": self.crashes,
            "hangs": self.hangs, "foreign": self.foreign, "corrupt": self.corrupt,
        }  # fmt: skip
        told = ", ".join(f"{number:,} {name}" for name, number in counts.items())
        guarded = f", {self.guarded:,} guarded ends" if self.guarded else ""
        return f"{told}{guarded}, {self.megabytes} MB at most"


def many(kind: str, name: str, count: int, seed: int) -> Counts:
    """`count` cases of a kind, in as many processes as it takes."""
    counts, first = Counts(count), 0
    with tempfile.NamedTemporaryFile() as board:
        while first < count:
            board.seek(0)
            board.write(BOARD.pack(first, 0, 0, 0))
            board.flush()
            arguments = [kind, name, *map(str, (seed, first, count)), board.name]
            worker = [sys.executable, str(Path(__file__).with_name("cases.py")), *arguments]
            found = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
            done = subprocess.run(worker, capture_output=True, text=True, env=found)
            number, answered, refused, foreign = BOARD.unpack(Path(board.name).read_bytes())
            counts.answered, counts.refused = counts.answered + answered, counts.refused + refused
            counts.foreign += foreign
            counts.found += [done.stderr] * (foreign > 0)
            if done.returncode in (0, 1) and number == count:
                counts.megabytes = max(counts.megabytes, int(done.stdout.split()[-1]))
                break
            _ended(counts, done, kind, name, seed, number)
            first = number + 1
    return counts


def _ended(
    counts: Counts, done: subprocess.CompletedProcess[str], kind: str, name: str, seed: int, number: int
) -> None:
    """A process that ended at a case: where it is a decoder's, the case is read as users read it."""
    if name in ISOLATED and kind in ("flip", "cut"):
        counts.guarded += 1
        try:
            _read_as_users_do(name, kind, seed, number)
        except EvplaceError:
            counts.refused += 1
        except Exception as error:
            counts.foreign += 1
            counts.found.append(f"{kind} {name} {seed} {number}: {error!r}")
        else:
            counts.answered += 1
        return
    hangs = -done.returncode == 27  # SIGPROF
    counts.hangs, counts.crashes = counts.hangs + hangs, counts.crashes + (not hangs)
    counts.found.append(f"{kind} {name} {seed} {number}: ended by {done.returncode}: {done.stderr[-1000:]}")


def _read_as_users_do(form: str, kind: str, seed: int, number: int) -> None:
    name, data = whole(form)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(damaged(data, kind, seed, number))
        check_packets(open_recording(path, SIZE).packets(), SIZE, form)


class Kept:
    """What became of the kinds that are done, in a file, so that a run that was stopped goes on."""

    def __init__(self, file: Path | None, seed: int, share: float) -> None:
        """Go on from `file`; ValueError where it was begun with other code, another seed or share."""
        self._file, self.done = file, dict[str, Counts]()
        head = json.dumps({"seed": seed, "share": share, "code": _code()})
        lines = file.read_text().splitlines() if file and file.exists() else []
        if lines and lines[0] != head:
            raise ValueError(f"{file} was begun as {lines[0]}, this is {head}: give another --keep")
        for line in lines[1:]:
            name, counts = json.loads(line)
            self.done[name] = Counts(**counts)
        if not lines:
            self._add(head)

    def keep(self, name: str, counts: Counts) -> None:
        """A kind is done."""
        self.done[name] = counts
        self._add(json.dumps([name, asdict(counts)]))

    def _add(self, line: str) -> None:
        if self._file is not None:
            with self._file.open("a") as file:
                file.write(f"{line}\n")


def _code() -> str:
    """A checksum of the code that is attacked, and of the attack."""
    here = Path(__file__).resolve().parents[2]
    files = [*here.glob("src/**/*.py"), *here.glob("tests/**/*.py")]
    told = [f"{file.relative_to(here)} {hashlib.sha256(file.read_bytes()).hexdigest()}" for file in files]
    return hashlib.sha256("\n".join(sorted(told)).encode()).hexdigest()[:16]


def parts(share: float, seed: int, only: str) -> dict[str, Callable[[], Counts]]:
    """Each kind of attack whose name begins with one of `only`, and what does it."""
    from made import MAKERS
    from test_fuzz import WHOLE

    def some(count: int, kinds: int = 1) -> int:
        return math.ceil(count * share / kinds)

    logs, commands = [*WHOLE, "bag"], ("images", "train", "localize", "evaluate")
    kinds: dict[str, Callable[[], Counts]] = {}
    for name in FOLDERS_OF:
        kinds[f"altered {name}"] = partial(many, "folder", name, some(FOLDERS, len(FOLDERS_OF)), seed)
    for name in logs:
        kinds[f"logs as {name}"] = partial(many, "log", name, some(LOGS, len(logs)), seed)
    for name in commands:
        kinds[f"settings of {name}"] = partial(many, "settings", name, some(SETTINGS, len(commands)), seed)
    disks_kb = (16,) if share < 0.1 else (4, 16, 64, 256)
    kinds["kills"] = lambda: counted(_prepared(kills, some(KILLS), seed))
    kinds["full disks"] = lambda: counted(_prepared(full_disks, disks_kb))
    kinds["hostile files"] = lambda: counted(hostile_files())
    for form in sorted(MAKERS):
        kinds[f"cuts of {form}"] = partial(many, "cut", form, some(CUTS), seed)
        kinds[f"flips of {form}"] = partial(many, "flip", form, some(FLIPS), seed)
    return {kind: attack for kind, attack in kinds.items() if kind.startswith(tuple(only.split(",")))}


def _prepared(attack: Callable[..., Iterator[Outcome]], *arguments: object) -> Iterator[Outcome]:
    """An attack in a folder of its own."""
    with tempfile.TemporaryDirectory() as name:
        yield from attack(prepared(Path(name)), *arguments)


def counted(outcomes: Iterator[Outcome]) -> Counts:
    """The sum of outcomes: what was done, what was found wrong (empty for nothing), and megabytes used."""
    counts = Counts()
    for what, wrong, megabytes in outcomes:
        counts.cases += 1
        counts.megabytes = max(counts.megabytes, megabytes)
        counts.corrupt += bool(wrong)
        counts.answered += not wrong
        counts.found += [f"{what}: {wrong}"] * bool(wrong)
    return counts


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--share", type=float, default=1.0, help="of the full counts")
    parser.add_argument("--seed", type=int, default=random.randrange(1 << 30))
    parser.add_argument("--only", default="", help="kinds whose names begin so, with commas between")
    parser.add_argument("--keep", type=Path, help="a file of what is done: begun again, the run goes on")
    args = parser.parse_args()
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    try:
        kept = Kept(args.keep, args.seed, args.share)
    except ValueError as error:
        parser.error(str(error))
    print(f"seed {args.seed}, share {args.share:g}", flush=True)
    good = True
    for name, attack in parts(args.share, args.seed, args.only).items():
        before, began, worked_s = name in kept.done, time.monotonic(), _worked_s()
        if not before:
            kept.keep(name, attack())
        counts = kept.done[name]
        took = f"{_worked_s() - worked_s:,.0f} s of work in {time.monotonic() - began:,.0f} s"
        verdict = "ok  " if counts.is_good else "BAD "
        print(f"{verdict} {name}: {counts} [{'kept' if before else took}]", flush=True)
        good = good and counts.is_good
        for found in counts.found[:5]:
            print(f"     {found.strip()[-3000:]}", flush=True)
    print("nothing was found" if good else "something was found: see BAD above", flush=True)
    return 0 if good else 1


def _worked_s() -> float:
    """Seconds of the processor that this process and those it started and awaited have had."""
    return sum(os.times()[:4])


if __name__ == "__main__":
    sys.exit(main())
