"""What goes wrong for people: one clear line, exit code 2 (3 where a good part was used), no half outputs."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from conftest import HANG_S, make_drive, write_drive
from evplace.cli import main
from evplace.core import storage
from evplace.core.events import Events
from evplace.sources.writers import write_recording

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """day.aedat4 and day.csv, and nothing else."""
    write_drive(tmp_path, "day", make_drive(windows=20))
    return tmp_path


@pytest.fixture
def street(folder: Path) -> Path:
    arguments = [
        "train",
        f"{folder}/day.aedat4",
        "--track",
        f"{folder}/day.csv",
        "-o",
        f"{folder}/street.evp",
    ]
    assert main([*arguments, "--scorer", "ncc"]) == 0
    return folder / "street.evp"


def fault(capsys: Capture, *arguments: object, code: int = 2) -> str:
    """The one line on standard error of a command that fails."""
    capsys.readouterr()
    assert main([*map(str, arguments)]) == code
    message = capsys.readouterr().err
    assert "Traceback" not in message
    lines = message.splitlines()
    assert len(lines) == 1, message
    assert lines[0].startswith("evplace: ")
    return lines[0]


def left(folder: Path) -> list[str]:
    """Names in a folder; an empty lock file is no output."""
    return sorted(path.name for path in folder.iterdir())


def test_commands_and_flags(folder: Path, capsys: Capture) -> None:
    assert "did you mean 'train'" in fault(capsys, "trian")
    assert "--out" in fault(capsys, "images", folder / "day.aedat4")
    assert "--dtt" in fault(capsys, "images", folder / "day.aedat4", "-o", folder / "x", "--dtt", "1")
    assert "'dt'" in fault(capsys, "images", folder / "day.aedat4", "-o", folder / "x", "--dt", "soon")
    assert "crop_bottom" in fault(
        capsys, "images", folder / "day.aedat4", "-o", folder / "x", "--crop-bottom", "1.5"
    )
    assert "nothing to compare" in fault(capsys, "compare")
    assert left(folder) == ["day.aedat4", "day.csv"]


def test_settings_files(folder: Path, capsys: Capture) -> None:
    toml = folder / "s.toml"
    start = ("images", folder / "day.aedat4", "-o", folder / "x", "--settings", toml)
    assert "cannot read" in fault(capsys, *start)
    toml.write_text("[windows\n")
    assert "is not TOML" in fault(capsys, *start)
    toml.write_text("[windows]\nlength = 3\n")
    assert "s.toml: unknown setting 'windows.length'" in fault(capsys, *start)
    toml.write_text("[colours]\n")
    assert "known are" in fault(capsys, *start)


def test_settings_files_of_the_wrong_kind(folder: Path, capsys: Capture) -> None:
    toml = folder / "s.toml"
    start = ("images", folder / "day.aedat4", "-o", folder / "x", "--settings", toml)
    toml.write_text("images = 3\n")
    assert "it is a table, [images]" in fault(capsys, *start)
    toml.write_text("[images]\nblur = 3\n")
    assert "true or false" in fault(capsys, *start)
    toml.write_text("[images]\ntau_ms = nan\n")
    assert "s.toml: the setting 'images.tau_ms' cannot be nan" in fault(capsys, *start)
    assert "'tau_ms' cannot be nan" in fault(capsys, *start[:4], "--tau-ms", "nan")
    assert "cannot be nan" in fault(
        capsys, "train", folder / "day.aedat4", "--track", folder / "day.csv", "-o", folder / "m",
        "--cell-m", "nan",
    )  # fmt: skip


def test_files_that_are_no_recordings(folder: Path, capsys: Capture) -> None:
    (folder / "empty.aedat4").write_bytes(b"")
    (folder / "text.aedat4").write_text("good day\n")
    for name, words in [("none.aedat4", "none.aedat4"), ("empty.aedat4", "empty"), ("text.aedat4", "known")]:
        for command in (["info"], ["images", "-o", folder / "x"], ["train", "-o", folder / "x"]):
            message = fault(capsys, command[0], folder / name, *command[1:])
            assert words in message
    assert not (folder / "x").exists()


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_a_cut_recording_gives_its_good_part(
    folder: Path, street: Path, capsys: Capture, share: float
) -> None:
    events = make_drive(windows=20).events
    packets = [events[n : n + 500] for n in range(0, len(events), 500)]
    cut = folder / "cut.aedat4"
    write_recording(folder / "many.aedat4", packets, events.size)
    content = (folder / "many.aedat4").read_bytes()
    cut.write_bytes(content[: int(share * len(content))])
    assert "cut" in fault(capsys, "info", cut, code=3)
    assert main(["images", str(cut), "-o", f"{folder}/x", "--json"]) == 3
    facts = json.loads(capsys.readouterr().out)
    assert 0 < facts["images"] < 20
    assert facts["fault"]
    assert main(["localize", str(street), str(cut), "--matcher", "best"]) == 3
    assert len(capsys.readouterr().out.splitlines()) == facts["images"] + 1
    arguments = ["evaluate", str(street), str(cut), "--track", f"{folder}/day.csv", "-o", f"{folder}/r"]
    assert main([*arguments, "--matcher", "best"]) == 3
    assert main(["convert", str(cut), f"{folder}/cut.npz"]) == 3
    assert (
        main(["train", str(cut), "--track", f"{folder}/day.csv", "-o", f"{folder}/m", "--scorer", "sad"]) == 3
    )


def test_events_that_cannot_be(folder: Path, capsys: Capture) -> None:
    """Coordinates out of range and times running backwards are dropped and counted, never used."""
    events = make_drive(windows=4).events
    x = events.x.copy()
    x[100:103] = 500
    t_us = events.t_us.copy()
    t_us[200:205] -= 20_000
    np.savez(folder / "odd.npz", t_us=t_us, x=x, y=events.y, p=events.p, width=80, height=60)
    capsys.readouterr()
    assert main(["info", f"{folder}/odd.npz", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["dropped"]["out_of_range"] == 3
    assert facts["dropped"]["backwards"] == 5
    assert facts["events"] == len(events) - 8


def test_times_wrap(folder: Path, capsys: Capture) -> None:
    """EVT3's 24 bits of time wrap every 16.8 s."""
    t_us = np.arange(0, 60_000_000, 2_000, dtype=np.int64)
    n = len(t_us)
    long = Events.of(t_us, np.arange(n) % 80, np.arange(n) % 60, np.arange(n) % 2, (80, 60))
    write_recording(folder / "long.raw", [long], (80, 60))
    capsys.readouterr()
    assert main(["info", f"{folder}/long.raw", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["t_last_us"] - facts["t_first_us"] == t_us[-1]


def test_tracks(folder: Path, capsys: Capture) -> None:
    start = ("train", folder / "day.aedat4", "-o", folder / "m", "--scorer", "sad")
    assert "no positions" in fault(capsys, *start)
    assert "none.csv" in fault(capsys, *start, "--track", folder / "none.csv")
    later = (folder / "day.csv").read_text().splitlines()
    moved = [later[0], *(f"{int(line.split(',')[0]) + 10**12},{line.split(',', 1)[1]}" for line in later[1:])]
    (folder / "later.csv").write_text("\n".join(moved))
    message = fault(capsys, *start, "--track", folder / "later.csv")
    assert "do not overlap" in message
    lost = [later[0], *(f"{line.split(',')[0]},nan,nan" for line in later[1:])]
    (folder / "lost.csv").write_text("\n".join(lost))
    assert "lost.csv" in fault(capsys, *start, "--track", folder / "lost.csv")
    (folder / "nofix.nmea").write_text("$GPRMC,134730.361,V,,,,,,,041112,,,N*4C\n")
    assert "nofix.nmea" in fault(capsys, *start, "--track", folder / "nofix.nmea")
    assert not (folder / "m").exists()
    for shift in ("-1000000", "1000000"):
        message = fault(
            capsys, "images", folder / "day.aedat4", "-o", folder / "x", "--track", folder / "day.csv",
            "--track-offset", shift, "--every-m", "2",
        )  # fmt: skip
        assert "do not overlap" in message
    assert "--track-preset" in fault(
        capsys, "images", folder / "day.aedat4", "-o", folder / "x", "--track-offset", "1"
    )
    assert "cannot be shifted" in fault(
        capsys, *start, "--track", folder / "day.csv", "--track-offset", "inf"
    )


def test_one_place_only_is_a_map(folder: Path, capsys: Capture) -> None:
    arguments = ["train", f"{folder}/day.aedat4", "--track", f"{folder}/day.csv", "-o", f"{folder}/m"]
    assert main([*arguments, "--scorer", "sad", "--cell-m", "1e6", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["places"] == 1


def test_a_query_of_another_town(folder: Path, street: Path, capsys: Capture) -> None:
    lines = (folder / "day.csv").read_text().splitlines()
    away = [lines[0], *(line.replace(",48.0,", ",49.0,") for line in lines[1:])]
    (folder / "away.csv").write_text("\n".join(away))
    message = fault(
        capsys, "evaluate", street, folder / "day.aedat4", "--track", folder / "away.csv", "-o", folder / "r"
    )
    assert "share no ground" in message
    assert "no positions" in fault(capsys, "evaluate", street, folder / "day.aedat4", "-o", folder / "r")
    np.save(folder / "t.npy", np.eye(3))
    message = fault(
        capsys, "evaluate", street, folder / "day.aedat4", "--truth", folder / "t.npy", "-o", folder / "r"
    )
    assert "(3, 3)" in message


def test_zero_images(folder: Path, capsys: Capture) -> None:
    write_recording(folder / "none.npz", [], (80, 60))
    message = fault(capsys, "images", folder / "none.npz", "-o", folder / "x")
    assert "no image" in message or "no event" in message
    (folder / "pictures").mkdir()
    fault(capsys, "images", folder / "pictures", "-o", folder / "x")
    assert not (folder / "x").exists()


def test_a_map_of_other_settings_or_of_another_sensor(folder: Path, street: Path, capsys: Capture) -> None:
    main(["images", f"{folder}/day.aedat4", "-o", f"{folder}/narrow", "--width", "40"])
    assert "the map was made with width 160, the query with 40" in fault(
        capsys, "localize", street, folder / "narrow"
    )
    other = Events.of([0, 5], [0, 1], [0, 1], [1, 1], (320, 240))
    write_recording(folder / "other.aedat4", [other], (320, 240))
    assert "80x60" in fault(capsys, "localize", street, folder / "other.aedat4")


@pytest.mark.parametrize("name", ["weights.safetensors", "network.onnx", "map.json"])
def test_a_flipped_byte_in_a_map(folder: Path, capsys: Capture, name: str) -> None:
    pytest.importorskip("torch", reason="the network needs the extra 'train'")
    arguments = ["train", f"{folder}/day.aedat4", "--track", f"{folder}/day.csv", "-o", f"{folder}/m"]
    assert main([*arguments, "--scorer", "network", "--steps", "1", "--batch", "4"]) == 0
    file = folder / "m" / name
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 4
    file.write_bytes(content)
    assert name in fault(capsys, "localize", folder / "m", folder / "day.aedat4")


def test_what_is_no_map_or_result(folder: Path, capsys: Capture) -> None:
    assert "is no map" in fault(capsys, "localize", folder, folder / "day.aedat4")
    fault(capsys, "compare", folder)


def test_an_output_that_exists(folder: Path, street: Path, capsys: Capture) -> None:
    day, track = folder / "day.aedat4", ("--track", folder / "day.csv")
    taken = folder / "taken"
    taken.mkdir()
    (taken / "mine").write_text("mine")
    for command in (
        ("images", day, "-o", taken),
        ("train", day, *track, "-o", taken, "--scorer", "sad"),
        ("evaluate", street, day, *track, "-o", taken),
        ("localize", street, day, "-o", taken),
        ("convert", day, folder / "day.csv", ),
    ):  # fmt: skip
        message = fault(capsys, *command)
        assert "exists" in message or "suffix" in message
    assert (taken / "mine").read_text() == "mine"


def test_what_is_not_ours_is_never_replaced(folder: Path, street: Path, capsys: Capture) -> None:
    day, track = folder / "day.aedat4", ("--track", folder / "day.csv")
    pictures = folder / "pictures"
    pictures.mkdir()
    Image.fromarray(np.zeros((20, 30), np.uint8)).save(pictures / "1.png")
    main(["images", f"{day}", *map(str, track), "-o", f"{folder}/made"])
    for command in (
        ("images", pictures, "-o", pictures),
        ("images", day, "-o", day),
        ("train", day, *track, "-o", pictures, "--scorer", "sad"),
        ("evaluate", street, day, *track, "-o", pictures),
        ("evaluate", street, day, *track, "-o", street),
        ("localize", street, day, "-o", pictures),
        ("convert", folder / "made", pictures),
        ("doctor", day, "--report", pictures),
        ("images", day, "-o", folder / "x", "--sheet", pictures),
    ):
        fault(capsys, *command, "--overwrite")
    assert left(pictures) == ["1.png"]
    assert main(["images", f"{day}", *map(str, track), "-o", f"{folder}/made", "--overwrite"]) == 0
    assert not (folder / "x").exists()


def test_outputs_need_a_name(
    folder: Path, street: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    day, track = folder / "day.aedat4", ("--track", folder / "day.csv")
    monkeypatch.chdir(folder)
    for command in (
        ("images", day, "-o", "."),
        ("train", day, *track, "-o", ".", "--scorer", "sad"),
        ("evaluate", street, day, *track, "-o", "."),
        ("localize", street, day, "-o", "."),
        ("doctor", day, "--report", "."),
    ):
        assert "no name of an output" in fault(capsys, *command, "--overwrite")


def test_a_sheet_that_exists_is_told_before_the_work(folder: Path, capsys: Capture) -> None:
    (folder / "sheet.png").write_text("mine")
    command = ("images", folder / "day.aedat4", "-o", folder / "x", "--sheet", folder / "sheet.png")
    assert "exists" in fault(capsys, *command)
    assert not (folder / "x").exists()


def test_a_report_without_matplotlib_is_told_before_the_work(
    folder: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    # The recording does not exist: what is missing is said before it is looked at.
    assert "matplotlib" in fault(capsys, "doctor", folder / "none.aedat4", "--report", folder / "x")


def test_a_full_disk(folder: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(storage.GrowingArray, "append", full)
    monkeypatch.setattr(storage.GrowingArray, "extend", full)
    before = left(folder)
    assert "the disk is full" in fault(capsys, "images", folder / "day.aedat4", "-o", folder / "x")
    assert left(folder) == before


def test_a_second_writer(folder: Path, capsys: Capture) -> None:
    with storage.new_folder(folder / "x"):
        run = subprocess.run(
            [sys.executable, "-m", "evplace", "images", folder / "day.aedat4", "-o", folder / "x"],
            capture_output=True, text=True,
        )  # fmt: skip
    assert run.returncode == 2
    assert "another process" in run.stderr


def limited(kilobytes: int, *arguments: object) -> subprocess.CompletedProcess[str]:
    """A command that may write no more than so many bytes into a file."""
    import resource

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (kilobytes << 10, kilobytes << 10))

    command = [sys.executable, "-m", "evplace", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, preexec_fn=limit)


@pytest.mark.skipif(os.name == "nt", reason="Windows limits no process")
@pytest.mark.parametrize("suffix", ["h5", "npz", "aedat4", "raw"])
def test_no_writer_outgrows_the_disk(tmp_path: Path, suffix: str) -> None:
    rng = np.random.default_rng(0)
    n = 300_000
    events = Events.of(
        np.arange(n) * 9, rng.integers(0, 240, n), rng.integers(0, 180, n), n * [1], (240, 180)
    )
    write_recording(tmp_path / "day.aedat4", [events], events.size)
    run = limited(40, "convert", tmp_path / "day.aedat4", tmp_path / f"x.{suffix}")
    assert run.returncode == 2
    assert run.stderr == f"evplace: the disk is full: {tmp_path}/x.{suffix} was not written\n"
    assert left(tmp_path) == ["day.aedat4"]


@pytest.mark.parametrize("command", [["info", "--json"], ["info"], ["doctor"]])
def test_a_full_standard_output(folder: Path, command: list[str]) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("this system has no /dev/full")
    with Path("/dev/full").open("w") as full:
        run = subprocess.run(
            [sys.executable, "-m", "evplace", command[0], folder / "day.aedat4", *command[1:]],
            stdout=full, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
    assert run.returncode == 2
    assert run.stderr == "evplace: cannot write to standard output: No space left on device\n"


WAITS_HALFWAY = """
import sys
from evplace.cli import main
from evplace.core.storage import GrowingArray

def append(self, item):
    grow(self, item)
    print("half", flush=True)
    sys.stdin.read()

grow, GrowingArray.append = GrowingArray.append, append
sys.exit(main(sys.argv[1:]))
"""
"""A command that says when a part of its output was written, and waits then to be stopped."""


@pytest.mark.skipif(os.name == "nt", reason="Windows sends no signals to one process")
@pytest.mark.parametrize("how", ["SIGTERM", "SIGHUP"])
def test_being_asked_to_end_leaves_nothing(folder: Path, how: str) -> None:
    number, pipe = getattr(signal, how), subprocess.PIPE
    if signal.getsignal(number) is signal.SIG_IGN:
        pytest.skip(f"{how} is passed over, as nohup has it")
    command = [sys.executable, "-c", WAITS_HALFWAY, "images", folder / "day.aedat4", "-o", folder / "x"]
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "half\n"
        process.send_signal(number)
        _, message = process.communicate(timeout=HANG_S)
    assert process.returncode == 128 + number
    assert message == "evplace: interrupted; nothing half-written was left\n"
    assert [path.name for path in folder.iterdir() if path.name.startswith(".")] == []
    assert not (folder / "x").exists()


STOPPED_IN_A_CALLBACK = """
import ctypes, os, signal, sys, time
from evplace.cli import main
from evplace.core.storage import GrowingArray

def stopped():
    os.kill(os.getpid(), number)
    time.sleep(0.01)  # it arrives here, where nothing that is raised goes any further

def append(self, item):
    grow(self, item)
    ctypes.CFUNCTYPE(None)(stopped)()
    print("goes on", flush=True)
    while True:
        time.sleep(0.01)

number = int(sys.argv.pop())
grow, GrowingArray.append = GrowingArray.append, append
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.exit(main(sys.argv[1:]))
"""
"""A command to which a signal comes while C code calls back."""


@pytest.mark.skipif(os.name == "nt", reason="Windows sends no signals to one process")
@pytest.mark.parametrize("how", ["SIGTERM", "SIGINT"])
def test_an_end_that_is_passed_over_in_a_callback_is_asked_for_again(folder: Path, how: str) -> None:
    number = int(getattr(signal, how))
    command = [sys.executable, "-c", STOPPED_IN_A_CALLBACK, "images", folder / "day.aedat4"]
    run = subprocess.run(
        [*command, "-o", folder / "x", str(number)], capture_output=True, text=True, timeout=HANG_S
    )
    assert run.stdout == "goes on\n"
    assert run.stderr == "evplace: interrupted; nothing half-written was left\n"
    assert run.returncode == 128 + number
    assert not (folder / "x").exists()


WAITS_ONCE_SAVED = """
import signal, sys
from evplace.cli import main
from evplace.scorers._network import checkpoint

def keep(self, *state):
    save(self, *state)
    if self._path.exists():
        print("saved", flush=True)
        sys.stdin.read()

checkpoint.EVERY = 20
save, checkpoint.Checkpoint.keep = checkpoint.Checkpoint.keep, keep
# A shell's background jobs, and tests among them, are born deaf to SIGINT.
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.exit(main(sys.argv[1:]))
"""
"""A command that says when a checkpoint was written, and waits then to be stopped."""


@pytest.mark.skipif(os.name == "nt", reason="Windows sends no SIGINT to one process")
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_a_training_that_was_stopped_goes_on(folder: Path, how: signal.Signals) -> None:
    pytest.importorskip("torch", reason="the network needs the extra 'train'")
    day = [
        "train",
        folder / "day.aedat4",
        "--track",
        folder / "day.csv",
        "--scorer",
        "network",
        "--batch",
        "8",
    ]
    command = [*map(str, [*day, "--steps", "60"]), "-o"]
    waiting, pipe = [sys.executable, "-c", WAITS_ONCE_SAVED, *command, folder / "stopped"], subprocess.PIPE
    alone = {**os.environ, "OMP_NUM_THREADS": "1"}  # more threads wait for each other on a busy machine
    with subprocess.Popen(waiting, stdin=pipe, stdout=pipe, stderr=pipe, text=True, env=alone) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "saved\n"
        process.send_signal(how)
        _, message = process.communicate(timeout=HANG_S)
    if how == signal.SIGINT:
        assert process.returncode == 130
        assert message.splitlines() == ["evplace: interrupted; nothing half-written was left"]
    assert not (folder / "stopped").exists()
    for name in ("stopped", "whole"):
        again = [sys.executable, "-m", "evplace", *command, folder / name]
        subprocess.run(again, check=True, capture_output=True, env=alone)
    stopped, whole = ((folder / name / "network.onnx").read_bytes() for name in ("stopped", "whole"))
    assert stopped == whole
    assert not (folder / ".stopped.checkpoint").exists()


def test_guesses_are_told_and_unclear_ones_refused(folder: Path, street: Path, capsys: Capture) -> None:
    """Neither the unit of time nor the sensor's size stands in the file."""
    events = make_drive(windows=20, noise=0.1).events
    np.savez(folder / "guess.npz", t=events.t_us, x=events.x, y=events.y, p=events.p)
    learn = ("--track", folder / "day.csv", "-o", folder / "m", "--scorer", "sad", "--run-length", 2)
    size = ("--size", 80, 60)
    for command in (
        ("images", folder / "guess.npz", "-o", folder / "g"),
        ("train", folder / "guess.npz", *learn),
        ("localize", street, folder / "guess.npz", "-o", folder / "a.csv", *size),
        ("evaluate", street, folder / "guess.npz", "-o", folder / "r", "--track", folder / "day.csv", *size),
    ):
        capsys.readouterr()
        assert main([*map(str, command)]) == 0
        message = capsys.readouterr().err
        assert "evplace: times in 't' are taken as us" in message
        assert ("128x128 inferred from its events" in message) == (size[1] not in command)
    np.savez(folder / "unclear.npz", t=events.t_us * 30, x=events.x, y=events.y, p=events.p)
    message = fault(capsys, "images", folder / "unclear.npz", "-o", folder / "u")
    assert "give --time-unit" in message
