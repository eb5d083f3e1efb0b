"""Many damaged inputs of one kind, read one after another in this process.

    python cases.py KIND NAME SEED FIRST COUNT BOARD

KIND is flip, cut, log, folder or settings; NAME a format, a kind of log or a kind of folder. Each case is
known by its number. Before each, its number and the counts so far are written to the file BOARD, so that
whoever started this knows which one brought it down. What comes out must be an answer or an error that
evplace raises on purpose.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import random
import resource
import signal
import struct
import sys
import tempfile
import traceback
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from altered import altered, array_alterations, file_alterations, json_alterations
from evplace.core import families
from evplace.core.errors import EvplaceError
from evplace.sources.readers import _decoder
from evplace.sources.readers._recording import Recording
from evplace.sources.readers._source import Hints, checked_source
from evplace.testing._readers import SIZE, check_packets, flipped, some_events

BOARD = struct.Struct("<qqqq")
"""The number of the case that is at work, and how many were answered, refused and foreign so far."""
WORK_S = 10.0
"""Seconds of its own work after which a case is one that hangs."""
ISOLATED = {"hdf5": "_hdf5", "parquet": "_parquet"}
"""Formats that are decoded in a process of their own, which may die; here many readings share one."""
Case = Callable[[int], bool]
"""Does the case of that number: True for an answer, False for a refusal in one line."""


def main(kind: str, name: str, seed: int, first: int, count: int, board: Path) -> int:
    """Do the cases from `first` to `count`; returns how many ended in an exception that nobody meant."""
    answered = refused = foreign = 0
    with tempfile.TemporaryDirectory(dir=_memory()) as folder, board.open("r+b", buffering=0) as written:
        case = cases(Path(folder), kind, name, seed)
        for number in range(first, count):
            written.seek(0)
            written.write(BOARD.pack(number, answered, refused, foreign))
            signal.setitimer(signal.ITIMER_PROF, WORK_S)
            try:
                good = case(number)
                answered, refused = answered + good, refused + (not good)
            except Exception:
                foreign += 1
                if foreign <= 3:
                    print(f"{kind} {name} {seed} {number}\n{traceback.format_exc()[-1500:]}", file=sys.stderr)
        signal.setitimer(signal.ITIMER_PROF, 0)
        written.seek(0)
        written.write(BOARD.pack(count, answered, refused, foreign))
    print(_megabytes())
    return foreign


def cases(folder: Path, kind: str, name: str, seed: int) -> Case:
    """What does the cases of a kind, with files in `folder`."""
    makers = {"flip": _recording, "cut": _recording, "log": _log, "folder": _folder, "settings": _settings}
    return makers[kind](folder, kind, name, seed)


def _megabytes() -> int:
    """The most that this process has held; `ru_maxrss` would count what its parent held at its start."""
    status = Path("/proc/self/status")
    if not status.exists():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10
    held = next(line for line in status.read_text().splitlines() if "VmHWM" in line)
    return int(held.split()[1]) >> 10


def _memory() -> str | None:
    """Where files lie in memory, where the system has that."""
    return "/dev/shm" if Path("/dev/shm").is_dir() else None


def _refused(error: EvplaceError) -> bool:
    """False, for a refusal, which must be a line of a sensible length without codes for a terminal."""
    told = str(error)
    assert "\n" not in told, told[:300]
    assert "\x1b" not in told, told[:300]
    assert len(told) < 3000, told[:300]
    return False


def damaged(data: bytes, kind: str, seed: int, number: int) -> bytes:
    """A recording with one bit flipped, with two to four in every second case, or cut off."""
    if kind == "flip":
        for more in range(1 if number // 2 % 2 == 0 else 2 + number // 4 % 3):
            data = flipped(data, seed + more, number)
        return data
    return data[: random.Random(f"{seed} {number}").randrange(len(data))]


@cache
def whole(form: str) -> tuple[str, bytes]:
    """The name and the bytes of a small recording of a format."""
    from made import MAKERS

    with tempfile.TemporaryDirectory() as folder:
        path = MAKERS[form](Path(folder), some_events(300))
        return path.name, path.read_bytes()


def _recording(folder: Path, kind: str, form: str, seed: int) -> Case:
    name, data = whole(form)
    path = folder / name
    path.write_bytes(data)
    module = importlib.import_module(f"evplace.sources.readers.{ISOLATED.get(form, form)}")
    if form in ISOLATED:
        _decoder.limit_memory()
    read = module.open_here if form in ISOLATED else module.read
    good = np.concatenate(
        [packet.t_us for packet in Recording(path, form, read(path, Hints(SIZE)), SIZE).packets()]
    )

    def case(number: int) -> bool:
        path.write_bytes(damaged(data, kind, seed, number))
        packets, answer = [], True
        try:
            source = read(path, Hints(SIZE))
            if form not in ISOLATED:
                source = checked_source(source, "readers", families.load("readers", form))
            for packet in Recording(path, form, source, SIZE).packets():
                packets.append(packet)
        except EvplaceError as error:
            answer = _refused(error)
        check_packets(packets, SIZE, form)
        if kind == "cut" and packets:
            times = np.concatenate([packet.t_us for packet in packets])
            assert np.array_equal(times, good[: len(times)]), "a cut file gives other events"
        return answer

    return case


def _log(folder: Path, kind: str, name: str, seed: int) -> Case:
    """A track whose positions are finite and whose times increase."""
    from test_fuzz import LOG, ODD, WHOLE

    from evplace.sources.tracks import open_track
    from made_bags import nav_sat_fix_bag

    data = nav_sat_fix_bag(folder, LOG).read_bytes() if name == "bag" else WHOLE[name]
    path = folder / "log"

    def case(number: int) -> bool:
        rng, content = random.Random(f"{seed} {number}"), bytearray(data)
        for _ in range(rng.randint(1, 4)):
            at = rng.randrange(len(content) + 1)
            end = min(at + rng.randrange(40), len(content))
            how = rng.choice(["cell", "cell", "flip", "flip", "cut", "swap"])
            if how == "cell":
                content[at:end] = rng.choice(ODD)
            elif how == "flip" and at < len(content):
                content[at] ^= 1 << rng.randrange(8)
            elif how == "cut":
                del content[at:]
            else:
                content[at:at] = content[end : end + 60]
        path.write_bytes(content)
        try:
            track = open_track(path)
        except EvplaceError as error:
            return _refused(error)
        assert all("\n" not in note and "\x1b" not in note for note in track.notes)
        assert track.known.all()
        assert (track.t_us[1:] > track.t_us[:-1]).all()
        return True

    return case


def _folder(folder: Path, kind: str, name: str, seed: int) -> Case:
    """A map, a traverse or a result that was altered: first each way in turn, then bytes at random.

    Altered maps have their sums made anew, every second one: else none may be answered otherwise.
    """
    import test_altered_maps as parts
    from conftest import sum_again

    saved, query = folder / "saved", parts.drive(1)
    use, file = parts.saved_as(name, saved, query)
    good = use(saved)
    changes = list(json_alterations(saved, file))
    for array in sorted(saved.glob("*.npy")):
        changes += array_alterations(saved, array.name)
    changes += file_alterations(saved)
    changes = [change for change in changes if "cannot be read" not in change[0]]
    random.Random(seed).shuffle(changes)
    files = sorted(one.name for one in saved.iterdir())

    def case(number: int) -> bool:
        rng = random.Random(f"{seed} {number}")
        what, change = changes[number] if number < len(changes) else ("bytes", _scrambling(rng, files))
        place = altered(saved, folder / "place", change)
        summed = file == "map.json" and number % 2 == 0 and "device" not in what
        if summed and (place / "SHA256SUMS").is_file():
            sum_again(place)
        try:
            found = use(place)
        except EvplaceError as error:
            return _refused(error)
        assert summed or file != "map.json" or found == good, f"{what} is answered without being noticed"
        return True

    return case


def _scrambling(rng: random.Random, files: list[str]) -> Callable[[Path], None]:
    """A few bytes of one file become others."""

    def change(place: Path) -> None:
        file = place / rng.choice(files)
        data = bytearray(file.read_bytes())
        for _ in range(rng.randint(1, 4)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        file.write_bytes(data)

    return change


VALUES = [
    "0", "-1", "1e999", "-1e999", "nan", "inf", "1e-999", "9" * 400, '""', '"x"', '"1e999999999"', "true",
    "[]", "[1, 2, 3]", "{}", "{ x = 1 }", "1979-05-27", "99999999999999999999", "0.5", "1", "3", '"1/0"',
    '"\\u001b[2J"',
]  # fmt: skip


def _settings(folder: Path, kind: str, name: str, seed: int) -> Case:
    """A settings file with odd values for one or two settings of a command, and what is made of it."""
    from evplace.cli import main as command

    file = folder / "settings.toml"
    told = io.StringIO()
    with contextlib.redirect_stdout(told):
        command([name, "--show-settings", "--json"])

    keys = sorted(json.loads(told.getvalue()))

    def case(number: int) -> bool:
        rng = random.Random(f"{seed} {number}")
        tables: dict[str, list[str]] = {}
        for key in rng.sample(keys, rng.randint(1, 2)):
            table, _, inner = key.rpartition(".")
            tables.setdefault(table, []).append(f"{inner} = {rng.choice(VALUES)}")
        text = "\n".join(
            f"[{table}]\n" * bool(table) + "\n".join(lines) for table, lines in sorted(tables.items())
        )
        file.write_text(text)
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = command([name, "--show-settings", "--json", "--settings", str(file)])
        assert code in (0, 2), (code, text)
        assert err.getvalue().count("\n") == (code == 2), (text, err.getvalue()[:500])
        assert "\x1b" not in err.getvalue() + out.getvalue(), text
        return code == 0

    return case


if __name__ == "__main__":
    kind_, name_, *numbers = sys.argv[1:]
    sys.exit(main(kind_, name_, *map(int, numbers[:3]), Path(numbers[3])) > 0)
