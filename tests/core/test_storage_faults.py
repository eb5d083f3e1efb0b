"""Outputs beside other writers, killed writers and faults of the system."""

from __future__ import annotations

import errno
import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evplace.core import storage
from evplace.core.errors import InputError, OutputError
from evplace.core.storage import (
    GrowingArray,
    check_new_file,
    check_new_folder,
    locked,
    new_file,
    new_folder,
    read_array,
    read_json,
    sha256,
    write_array,
    write_json,
)

KILLED = """
import os, sys
from evplace.core.storage import new_file, new_folder
with new_folder(sys.argv[1] + "/folder") as folder, new_file(sys.argv[1] + "/file.txt") as file:
    (folder / "half").write_text("half")
    file.write_text("half")
    os.kill(os.getpid(), 9)
"""


@pytest.mark.skipif(os.name == "nt", reason="Windows kills no process by a signal")
def test_a_killed_writer_blocks_nobody_and_leaves_nothing_in_the_next_output(tmp_path: Path) -> None:
    killed = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)])
    assert killed.returncode == -signal.SIGKILL
    assert not (tmp_path / "folder").exists()
    assert not (tmp_path / "file.txt").exists()
    with new_folder(tmp_path / "folder") as folder:
        (folder / "whole").write_text("whole")
    with new_file(tmp_path / "file.txt") as file:
        file.write_text("whole")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file.txt", "folder"]
    assert [path.name for path in (tmp_path / "folder").iterdir()] == ["whole"]


@pytest.mark.parametrize("left", ["partial", "old"])
def test_what_a_killed_writer_left_of_the_old_output_blocks_nobody(tmp_path: Path, left: str) -> None:
    """Killed while it removed the old output, or before the new one had its name."""
    stale = tmp_path / f".out.{'0123456789abcdef'}.{left}"
    (stale / "inner").mkdir(parents=True)
    (stale / "mark").write_text("old")
    for name in ("out", "other"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "mark").write_text("new")
    mine = tmp_path / ".out.mine.partial"
    mine.write_text("mine")
    with new_folder(tmp_path / "out", overwrite=True, mark="mark") as folder:
        (folder / "mark").write_text("newer")
    assert sorted(path.name for path in tmp_path.iterdir()) == [mine.name, "other", "out"]
    assert (tmp_path / "out" / "mark").read_text() == "newer"


def test_an_old_output_whose_place_was_never_taken_comes_back(tmp_path: Path) -> None:
    stale = tmp_path / f".out.{'0' * 16}.old"
    stale.mkdir()
    (stale / "mark").write_text("old")
    with pytest.raises(OutputError, match="exists"), new_folder(tmp_path / "out"):
        pass
    assert (tmp_path / "out" / "mark").read_text() == "old"


@pytest.mark.parametrize("exchanges", [True, False])
def test_a_folder_is_replaced_in_one_step_where_the_system_can(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, exchanges: bool
) -> None:
    if not exchanges:
        monkeypatch.setattr(storage, "_exchange", lambda *_: False)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mark").write_text("old")
    with new_folder(tmp_path / "out", overwrite=True, mark="mark") as folder:
        (folder / "mark").write_text("new")
    assert (tmp_path / "out" / "mark").read_text() == "new"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.skipif(os.name == "nt", reason="Windows makes links for administrators only")
@pytest.mark.parametrize("points_to", ["folder", "file", "nowhere"])
def test_a_link_is_no_output(tmp_path: Path, points_to: str) -> None:
    """Said before the work; what it points to stays."""
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "mark").write_text("dear")
    (tmp_path / "file").write_text("dear")
    (tmp_path / "link").symlink_to(points_to)
    for refused in (
        lambda: check_new_folder(tmp_path / "link", True, "mark"),
        lambda: check_new_file(tmp_path / "link", True),
        lambda: new_folder(tmp_path / "link", True, "mark").__enter__(),
        lambda: new_file(tmp_path / "link", True).__enter__(),
    ):
        with pytest.raises(OutputError, match=f"is a link to {points_to}|is a folder"):
            refused()
    assert (tmp_path / "folder" / "mark").read_text() == (tmp_path / "file").read_text() == "dear"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder", "link"]


@pytest.mark.skipif(os.name == "nt", reason="Windows makes links for administrators only")
def test_names_in_a_shared_folder_cannot_be_laid_in_wait(tmp_path: Path) -> None:
    """Links under the names that a writer uses lead nowhere: the victim stays as it was."""
    victim = tmp_path / "victim"
    victim.write_text("dear")
    for name in (".x.npz.partial", ".x.partial.npz", ".x.npz.old", ".x.partial", ".x.old"):
        (tmp_path / name).symlink_to(victim)
    with new_file(tmp_path / "x.npz") as file:
        file.write_text("new")
    with new_folder(tmp_path / "x") as folder:
        (folder / "mark").write_text("new")
    (tmp_path / ".y.lock").symlink_to(victim)
    with pytest.raises(OutputError, match="cannot write"), new_file(tmp_path / "y"):
        pass
    assert victim.read_text() == "dear"
    assert not victim.is_symlink()


@pytest.mark.parametrize("check", [check_new_file, lambda path, over: check_new_folder(path, over, "mark")])
def test_a_place_that_takes_nothing_is_told_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, check: Callable[[Path, bool], None]
) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"file is no folder"):
        check(tmp_path / "file" / "out", False)
    check(tmp_path / "none" / "yet" / "out", False)
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(OutputError, match="nothing can be written in"):
        check(tmp_path / "none" / "yet" / "out", False)


def test_arrays_on_a_full_disk_are_one_line(tmp_path: Path) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("this system has no /dev/full")
    with pytest.raises(OutputError, match="the disk is full"), new_folder(tmp_path / "x"):
        write_array(Path("/dev/full"), np.zeros((3000, 3)))


@pytest.mark.parametrize(
    "array", [np.float64(3), np.zeros((0, 4)), np.arange(6).reshape(2, 3).T, np.ones(3, bool)]
)
def test_arrays_come_back(tmp_path: Path, array: np.ndarray) -> None:
    write_array(tmp_path / "a.npy", array)
    got = np.load(tmp_path / "a.npy")
    assert (got.dtype, got.shape) == (array.dtype, array.shape)
    np.testing.assert_array_equal(got, array)


def test_two_outputs_of_one_name_but_of_two_folders_are_two(tmp_path: Path) -> None:
    with new_file(tmp_path / "a" / "x") as one, new_file(tmp_path / "b" / "x") as other:
        one.write_text("1")
        other.write_text("2")
    assert [(tmp_path / name / "x").read_text() for name in "ab"] == ["1", "2"]


def test_a_lock_is_held_by_one_and_given_back(tmp_path: Path) -> None:
    with locked(tmp_path / "x"):
        with pytest.raises(OutputError, match="another process"), locked(tmp_path / "x"):
            pass
        with locked(tmp_path / "y"):
            pass
    with locked(tmp_path / "x"):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_lock_file_that_was_taken_away_meanwhile_is_no_lock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The writer before removes its lock file between our opening and our locking it."""
    lock, try_lock = tmp_path / ".x.lock", storage._try_lock

    def late(handle: int) -> bool:
        lock.unlink()
        return try_lock(handle)

    monkeypatch.setattr(storage, "_try_lock", late)
    with pytest.raises(OutputError, match="another process"), locked(tmp_path / "x"):
        pass


def test_the_old_output_stands_until_the_new_one_is_whole(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mark").write_text("old")
    with new_folder(tmp_path / "out", overwrite=True, mark="mark") as folder:
        (folder / "mark").write_text("new")
        assert (tmp_path / "out" / "mark").read_text() == "old"
    assert (tmp_path / "out" / "mark").read_text() == "new"
    (tmp_path / "file").write_text("old")
    with new_file(tmp_path / "file", overwrite=True) as file:
        file.write_text("new")
        assert (tmp_path / "file").read_text() == "old"
    assert (tmp_path / "file").read_text() == "new"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "out"]


@pytest.mark.parametrize("overwritten", [True, False])
def test_an_output_that_cannot_take_its_name_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, overwritten: bool
) -> None:
    def refused(path: Path, target: Path) -> Path:
        raise OSError(errno.EIO, "Input/output error", str(path))

    if overwritten:
        (tmp_path / "file").write_text("old")
    monkeypatch.setattr(Path, "replace", refused)
    with (
        pytest.raises(OutputError, match="cannot write"),
        new_file(tmp_path / "file", overwrite=True) as file,
    ):
        file.write_text("new")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("file", "old")] * overwritten


def test_a_name_keeps_its_suffix_while_it_is_written(tmp_path: Path) -> None:
    """Writers choose their format by it."""
    with new_file(tmp_path / "drive.tar.npz") as file:
        assert file.suffix == ".npz"
        assert file.parent == tmp_path
        file.write_text("")


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
@pytest.mark.parametrize("made", [new_file, new_folder])
def test_every_kind_of_full_disk_is_one_line(
    tmp_path: Path, made: Callable[[Path], AbstractContextManager[Path]], number: int
) -> None:
    words = f"the disk is full: {tmp_path / 'x'} was not written"
    with pytest.raises(OutputError, match=words), made(tmp_path / "x"):
        raise OSError(number, os.strerror(number))
    assert list(tmp_path.iterdir()) == []


def test_a_fault_of_another_file_is_not_laid_at_the_outputs_door(tmp_path: Path) -> None:
    other = Path("/nowhere/at/all")
    with pytest.raises(FileNotFoundError), new_folder(tmp_path / "x"):
        other.read_text()
    with (
        pytest.raises(OutputError, match=f"cannot write {tmp_path / 'x'}"),
        new_folder(tmp_path / "x") as folder,
    ):
        (folder / "no" / "such").write_text("")


def test_asking_before_the_work_says_what_the_work_would(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "mine").write_text("")
    (tmp_path / "file").write_text("")
    check_new_folder(tmp_path / "none", False, "mark")
    check_new_file(tmp_path / "none", False)
    check_new_folder(tmp_path / "folder", True, "mi*")
    check_new_file(tmp_path / "file", True)
    for check, words in (
        (lambda: check_new_folder(tmp_path / "folder", False, "mine"), "exists"),
        (lambda: check_new_folder(tmp_path / "folder", True, "other"), "no other"),
        (lambda: check_new_folder(tmp_path / "folder", True, ""), "no sign of it"),
        (lambda: check_new_folder(tmp_path / "file", True, "mine"), "is a file"),
        (lambda: check_new_file(tmp_path / "folder", True), "is a folder"),
        (lambda: check_new_file(tmp_path / "file", False), "exists"),
    ):
        with pytest.raises(OutputError, match=words):
            check()


pieces = st.lists(st.integers(0, 5), max_size=8)


@given(pieces, st.sampled_from([np.uint8, np.int64, np.float32, np.bool_]), st.booleans())
def test_a_growing_array_is_the_sum_of_its_pieces(
    tmp_path_factory: pytest.TempPathFactory, lengths: list[int], kind: type[np.generic], pairs: bool
) -> None:
    path = tmp_path_factory.mktemp("grown") / "a.npy"
    shape = (2,) if pairs else ()
    rng = np.random.default_rng(sum(lengths))
    blocks = [rng.integers(0, 2, (n, *shape)).astype(kind) for n in lengths]
    array = GrowingArray(path, kind, shape)
    for block in blocks:
        if len(block) == 1:
            array.append(block[0])
        else:
            array.extend(block)
    array.close()
    array.discard()
    whole = np.concatenate([np.zeros((0, *shape), kind), *blocks])
    for mapped in (False, True):
        got = read_array(path, "it", memory_mapped=mapped)
        assert got.dtype == whole.dtype
        np.testing.assert_array_equal(got, whole)


def test_an_array_that_was_not_closed_claims_nothing(tmp_path: Path) -> None:
    array = GrowingArray(tmp_path / "a.npy", np.uint8, ())
    array.extend(np.ones(9, np.uint8))
    array.discard()
    assert read_array(tmp_path / "a.npy", "it").shape == (0,)


@pytest.mark.parametrize("wrong", [np.zeros((3, 4)), np.zeros(3), np.zeros((2, 3, 1))])
def test_items_of_another_shape_are_refused(tmp_path: Path, wrong: np.ndarray) -> None:
    array = GrowingArray(tmp_path / "a.npy", np.uint8, (3,))
    try:
        with pytest.raises(AssertionError):
            array.append(wrong if wrong.shape != (3,) else wrong[:2])
        with pytest.raises(AssertionError):
            array.extend(wrong)
    finally:
        array.discard()


@pytest.mark.parametrize("value", [math.nan, math.inf, [1, -math.inf], {"a": {"b": math.nan}}])
def test_json_has_no_nan(tmp_path: Path, value: object) -> None:
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "x.json", value)


json_values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**53), 2**53)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


@given(st.dictionaries(st.text(), json_values, max_size=4))
def test_json_comes_back(tmp_path_factory: pytest.TempPathFactory, value: dict[str, object]) -> None:
    path = tmp_path_factory.mktemp("json") / "x.json"
    write_json(path, value)
    assert read_json(path, "it") == value


@pytest.mark.parametrize("content", [b"", b"\xff\xfe", b"[1]", b"nul", b'{"a": 1'])
def test_what_is_no_json_object_is_damaged(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.json").write_bytes(content)
    with pytest.raises(InputError, match="the settings is damaged"):
        read_json(tmp_path / "x.json", "the settings")


def test_a_checksum_is_of_the_bytes(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"")
    (tmp_path / "b").write_bytes(bytes(3_000_000))
    assert sha256(tmp_path / "a").startswith("e3b0c44298fc1c14")
    assert sha256(tmp_path / "b") != sha256(tmp_path / "a")
    with pytest.raises(OSError, match="none"):
        sha256(tmp_path / "none")
