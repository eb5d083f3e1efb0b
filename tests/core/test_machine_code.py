"""The machine code of loops: as numba calls them, kept, and made anew where it is damaged or stale."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from evplace.core import _bitcode, _code_files, _machine_code
from evplace.core._arguments import is_known_here
from evplace.core.compiled import njit
from evplace.sources.readers import _canvas, _checks, evt3

pytestmark = pytest.mark.skipif(not is_known_here(), reason="never tried on this system")


class Pair(NamedTuple):
    values: Any
    mask: Any


@njit(cache=True)
def weighed(pair: Pair, by: float, least: int, strict: bool) -> float:
    """The sum of what is at least so much, or more than it; all counts where there is no mask."""
    total = 0.0
    for row in range(pair.values.shape[0]):
        for column in range(pair.values.shape[1]):
            value = pair.values[row, column]
            if value > least or (value == least and not strict):
                total += by * value
    return total


@njit(cache=True)
def filled(values: np.ndarray, number: int) -> None:
    """Every item becomes `number`."""
    for i in range(len(values)):
        values[i] = number


@njit(cache=True)
def within(bounds: tuple[tuple[float, int], int], values: np.ndarray) -> int:
    """How many values lie in a range, and one number more."""
    (low, high), more = bounds
    count = more
    for value in values:
        count += low <= value < high
    return count


@njit(cache=True)
def doubled(values: np.ndarray) -> np.ndarray:
    """A loop that makes an array."""
    return values * 2


@njit(cache=True)
def half_of(number: int, by: int) -> float:
    """It may divide by zero."""
    return number / by


@njit(cache=True)
def bounds(values: np.ndarray) -> tuple[int, int]:
    """A loop that returns two numbers."""
    low, high = np.int64(values[0]), np.int64(values[0])
    for value in values:
        low, high = min(low, value), max(high, value)
    return low, high


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder for what is kept; loops know of no entry yet, and none comes with the package."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(_code_files, "SHIPPED", tmp_path / "shipped")
    for loop in (weighed, filled, within, doubled, half_of, bounds):
        monkeypatch.setattr(loop, "_entries", {})
    return tmp_path / "evplace" / _code_files._environment()


def test_it_says_what_numba_says_of_all_kinds_of_arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    small = np.arange(6, dtype=np.uint8).reshape(2, 3)
    sealed = np.linspace(-1, 1, 8).reshape(4, 2)
    sealed.flags.writeable = False
    calls = [(small, 0.5, 3, True), (small, 0.5, 3, False), (sealed, 2, np.int16(0), np.bool_(True))]
    found = [weighed(Pair(values, None), *others) for values, *others in calls]
    assert all(weighed._entries.values()), "numba itself was called"
    assert found == [weighed.dispatcher(Pair(values, None), *others) for values, *others in calls]
    assert within(((0.5, 4), 7), small.ravel()) == 3 + 7
    assert all(within._entries.values())
    assert bounds(np.array([3, -(1 << 40), 5])) == (-(1 << 40), 5)
    assert all(bounds._entries.values())


def test_what_is_not_plain_is_called_by_numba() -> None:
    spread, large = np.zeros(8, np.int64)[::2], np.zeros(3, np.uint64)
    filled(spread, 7)
    filled(large, (1 << 64) - 1)
    assert spread.tolist() == [7] * 4
    assert large.tolist() == [(1 << 64) - 1] * 3
    assert filled._entries == {}


def test_a_loop_that_makes_arrays_is_called_by_numba_and_that_is_remembered(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert doubled(np.arange(3)).tolist() == [0, 2, 4]
    assert list(doubled._entries.values()) == [None]
    monkeypatch.setattr(doubled, "_entries", {})
    monkeypatch.setattr(_bitcode, "bitcode_of", lambda *_: pytest.fail("tried again"))
    assert doubled(np.arange(3)).tolist() == [0, 2, 4]


def test_a_division_by_zero_is_an_error() -> None:
    assert half_of(3, 2) == 1.5
    with pytest.raises(ArithmeticError, match="divided by zero"):
        half_of(3, 0)


@pytest.mark.parametrize(
    "fault", [lambda old: old[:-40] + b"x" + old[-39:], lambda old: old[:100], lambda old: b""]
)
def test_a_damaged_file_is_made_anew(folder: Path, monkeypatch: pytest.MonkeyPatch, fault: Any) -> None:
    filled(np.zeros(2, np.int32), 5)
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    file.write_bytes(fault(whole))
    monkeypatch.setattr(filled, "_entries", {})
    values = np.zeros(2, np.int32)
    filled(values, 6)
    assert values.tolist() == [6, 6]
    assert len(file.read_bytes()) > 1000
    assert len(list(folder.iterdir())) == 1


def test_it_is_made_where_nothing_can_be_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    values = np.zeros(2, np.float32)
    filled(values, 6)
    assert values.tolist() == [6, 6]


SOURCE = """
import sys
from evplace.core.compiled import njit
@njit(cache=True)
def number(by: int) -> int:
    return {number} * by
number(2)
print(number(3), "numba" in sys.modules)
"""


def test_a_changed_source_is_compiled_anew_and_an_unchanged_one_needs_no_numba(
    tmp_path: Path, folder: Path
) -> None:
    file, said = tmp_path / "loops.py", []
    for number in (2, 2, 51):
        source = SOURCE.format(number=number)
        if not file.exists() or file.read_text() != source:
            file.write_text(source)
        child = subprocess.run([sys.executable, file], capture_output=True, text=True, check=True)
        said.append(child.stdout.split())
    assert said == [["6", "True"], ["6", "False"], ["153", "True"]]
    assert len(list(folder.iterdir())) == 1


def test_a_loop_whose_source_cannot_be_read_is_called_by_numba(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.modules[__name__], "__file__", "/no/such/file")
    values = np.zeros(2, np.int32)
    filled(values, 6)
    assert values.tolist() == [6, 6]
    assert not folder.exists()


def ship(loop: Any, *arguments: Any) -> Path:
    """Have a loop's code come with the package, and nothing kept of it."""
    loop(*arguments)
    (name,) = (_code_files.name_of(loop, kinds) for kinds in loop._entries)
    assert name is not None
    _code_files.ship(name, _machine_code.made[name])
    loop._entries.clear()
    return _code_files.SHIPPED / name


def test_what_comes_with_the_package_is_not_compiled_again(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ship(filled, np.zeros(2, np.int32), 5)
    shutil.rmtree(folder)
    values = np.zeros(2, np.int32)
    with monkeypatch.context() as without:
        without.setattr(_bitcode, "bitcode_of", lambda *_: pytest.fail("compiled"))
        filled(values, 6)
    assert values.tolist() == [6, 6]
    assert len(list(folder.iterdir())) == 1


def test_what_comes_with_the_package_but_cannot_be_read_is_compiled(folder: Path) -> None:
    file = ship(filled, np.zeros(2, np.int32), 5)
    shutil.rmtree(folder)
    _code_files.ship(file.name, _code_files.Code("none", b"of another LLVM"))
    values = np.zeros(2, np.int32)
    filled(values, 6)
    assert values.tolist() == [6, 6]
    assert all(filled._entries.values())


def is_read(folder: Path) -> bool:
    """Whether the one file that is kept is found."""
    (file,) = folder.iterdir()
    return _code_files.kept(file.name) is not None


def test_nothing_is_kept_where_others_may_write(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    filled(np.zeros(2, np.int32), 5)
    assert is_read(folder)
    assert folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o770)
    assert not is_read(folder)
    folder.chmod(0o700)
    monkeypatch.setattr(_code_files.os, "geteuid", lambda: folder.stat().st_uid + 1)
    assert not is_read(folder)
    _code_files.keep("another", _code_files.UNFIT)
    assert len(list(folder.iterdir())) == 1
    monkeypatch.undo()


def test_a_link_is_no_folder_of_the_users_own(folder: Path) -> None:
    filled(np.zeros(2, np.int32), 5)
    folder.rename(folder.with_name("elsewhere"))
    folder.symlink_to("elsewhere")
    assert not is_read(folder)


def test_a_file_that_was_moved_is_not_taken_for_another(folder: Path) -> None:
    filled(np.zeros(2, np.int32), 5)
    (file,) = folder.iterdir()
    file.rename(folder / "another.name")
    assert _code_files.kept("another.name") is None


WRITER = """
from evplace.core._code_files import Code, keep, kept
for number in range(300):
    keep("loop.source", Code("none", bytes([number % 256]) * 5000))
    code = kept("loop.source")
    assert code is None or len(set(code.content)) == 1 and len(code.content) == 5000
"""


def test_processes_that_write_one_file_do_not_meet(folder: Path) -> None:
    """Each reads all of what one of them wrote."""
    children = [subprocess.Popen([sys.executable, "-c", WRITER]) for _ in range(3)]
    assert [child.wait() for child in children] == [0, 0, 0]
    assert is_read(folder)


@pytest.mark.parametrize("name", ["JUMP_US", "timely"])
def test_code_depends_on_what_other_modules_hold(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A decoder reaches both by what is said to numba before it is compiled."""
    before = _code_files.name_of(evt3._decode, ())
    monkeypatch.setattr(_checks if name == "JUMP_US" else _canvas, name, 5)
    assert _code_files.name_of(evt3._decode, ()) != before


def test_code_depends_on_which_constant_has_which_value(monkeypatch: pytest.MonkeyPatch) -> None:
    before = _code_files.name_of(evt3._decode, ())
    stored, marked = _canvas.STORED, _canvas.MARKED
    monkeypatch.setattr(_canvas, "STORED", marked)
    monkeypatch.setattr(_canvas, "MARKED", stored)
    assert _code_files.name_of(evt3._decode, ()) != before


def test_code_depends_on_options(monkeypatch: pytest.MonkeyPatch) -> None:
    before = _code_files.name_of(filled, ())
    monkeypatch.setitem(filled.options, "error_model", "numpy")
    assert _code_files.name_of(filled, ()) != before
