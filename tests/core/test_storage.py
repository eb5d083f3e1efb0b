"""Outputs appear whole or not at all."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

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
    write_json,
)


def test_a_folder_appears_at_the_end(tmp_path: Path) -> None:
    with new_folder(tmp_path / "out") as folder:
        (folder / "a").write_text("1")
        assert not (tmp_path / "out").exists()
    assert (tmp_path / "out" / "a").read_text() == "1"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("fault", [KeyboardInterrupt(), OSError(errno.ENOSPC, "No space left on device")])
def test_a_fault_leaves_what_was_there(tmp_path: Path, fault: BaseException) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "old").write_text("old")
    (tmp_path / "file").write_text("old")
    wanted = OutputError if isinstance(fault, OSError) else KeyboardInterrupt
    with pytest.raises(wanted), new_folder(tmp_path / "out", True, "old") as folder:
        (folder / "new").write_text("new")
        raise fault
    with pytest.raises(wanted), new_file(tmp_path / "file", overwrite=True) as file:
        file.write_text("new")
        raise fault
    assert (tmp_path / "out" / "old").read_text() == "old"
    assert (tmp_path / "file").read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir() if not path.name.endswith(".lock")) == [
        "file",
        "out",
    ]


def test_a_full_disk_is_named(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="the disk is full"), new_file(tmp_path / "x"):
        raise OSError(errno.ENOSPC, "No space left on device")


def test_a_really_full_disk_is_named() -> None:
    if not Path("/dev/full").exists():
        pytest.skip("this system has no /dev/full")
    with pytest.raises(OutputError, match="the disk is full"), new_file(Path("/tmp/evplace-full")):
        array = GrowingArray(Path("/dev/full"), np.uint8, (1000,))
        try:
            for _ in range(100):
                array.append(np.zeros(1000, np.uint8))
            array.close()
        finally:
            array.discard()


def test_other_errors_pass(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), new_file(tmp_path / "x"):
        Path("/nothing/here").read_text()


def test_what_exists_is_not_overwritten_unasked(tmp_path: Path) -> None:
    (tmp_path / "x").write_text("1")
    with pytest.raises(OutputError, match="exists"), new_file(tmp_path / "x"):
        pass
    with pytest.raises(OutputError, match="exists"), new_folder(tmp_path / "x"):
        pass


def test_only_a_folder_of_the_same_kind_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "holiday").mkdir()
    (tmp_path / "holiday" / "beach.jpg").write_text("dear")
    (tmp_path / "day.aedat4").write_text("dear")
    for mark in ("", "traverse.json", "@*.jpg"):
        with pytest.raises(OutputError, match="not replaced"), new_folder(tmp_path / "holiday", True, mark):
            pass
        with pytest.raises(OutputError, match="is a file"), new_folder(tmp_path / "day.aedat4", True, mark):
            pass
    with pytest.raises(OutputError, match="is a folder"), new_file(tmp_path / "holiday", True):
        pass
    assert (tmp_path / "holiday" / "beach.jpg").read_text() == "dear"
    with new_folder(tmp_path / "holiday", True, "*.jpg"):
        pass
    assert list((tmp_path / "holiday").iterdir()) == []
    with new_folder(tmp_path / "holiday", True, "traverse.json"):
        pass


@pytest.mark.parametrize("name", [".", "..", "/"])
def test_a_place_is_no_name(name: str) -> None:
    for refused in (new_file(name, True), new_folder(name, True), locked(Path(name))):
        with pytest.raises(OutputError, match="no name of an output"), refused:
            pass


def test_a_second_writer_is_refused(tmp_path: Path) -> None:
    code = f"""
from evplace.core.storage import new_folder
from evplace.core.errors import OutputError
try:
    with new_folder({str(tmp_path / "out")!r}): print("written")
except OutputError as error: print(error)
"""
    with new_folder(tmp_path / "out"):
        second = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "another process" in second.stdout
    assert (tmp_path / "out").exists()


def test_a_place_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot write"), new_folder(tmp_path / "file" / "out"):
        pass


def test_a_growing_array_is_a_plain_npy_file(tmp_path: Path) -> None:
    array = GrowingArray(tmp_path / "a.npy", np.uint8, (2, 3))
    blocks = np.arange(3000, dtype=np.uint8).reshape(-1, 2, 3)
    for block in blocks:
        array.append(block)
    array.close()
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), blocks)
    np.testing.assert_array_equal(read_array(tmp_path / "a.npy", "it", memory_mapped=True), blocks)


def test_damaged_files_are_told(tmp_path: Path) -> None:
    (tmp_path / "a.npy").write_bytes(b"\x93NUMPY\x01\x00")
    (tmp_path / "a.json").write_text("{")
    (tmp_path / "b.json").write_text("[]")
    with pytest.raises(InputError, match="it is damaged"):
        read_array(tmp_path / "a.npy", "it")
    for name in ("a.json", "b.json"):
        with pytest.raises(InputError, match="it is damaged"):
            read_json(tmp_path / name, "it")
    with pytest.raises(InputError, match="cannot read it"):
        read_array(tmp_path / "none.npy", "it")
    np.save(tmp_path / "o.npy", np.array([{}], object), allow_pickle=True)
    with pytest.raises(InputError, match="damaged"):
        read_array(tmp_path / "o.npy", "it")


def test_json_and_checksums(tmp_path: Path) -> None:
    write_json(tmp_path / "x.json", {"a": 1})
    assert read_json(tmp_path / "x.json", "it") == {"a": 1}
    (tmp_path / "abc").write_bytes(b"abc")
    assert sha256(tmp_path / "abc").startswith("ba7816bf")


@pytest.mark.parametrize("shape", [(10**15,), (10**30,), (-5,), (9,)])
def test_what_an_array_claims_is_held_against_its_file(shape: tuple[int, ...], tmp_path: Path) -> None:
    with (tmp_path / "bomb.npy").open("wb") as file:
        header = {"descr": "<i8", "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_1_0(file, header)
        file.write(bytes(64))
    for mapped in (False, True):
        with pytest.raises(InputError, match="it is damaged"):
            read_array(tmp_path / "bomb.npy", "it", memory_mapped=mapped)


def test_an_archive_or_objects_under_the_name_of_an_array(tmp_path: Path) -> None:
    with (tmp_path / "zip.npy").open("wb") as file:
        np.savez(file, a=[1])
    np.save(tmp_path / "objects.npy", np.array([{}]))
    for name in ("zip.npy", "objects.npy"):
        with pytest.raises(InputError, match="it is damaged"):
            read_array(tmp_path / name, "it")
    np.save(tmp_path / "empty.npy", np.zeros((0, 4)))
    assert read_array(tmp_path / "empty.npy", "it").shape == (0, 4)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_is_no_output(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for check in (check_new_file, lambda path, overwrite: check_new_folder(path, overwrite, "x")):
        with pytest.raises(OutputError, match="is a pipe or a device, which no output replaces"):
            check(pipe, overwrite=True)
    with pytest.raises(OutputError, match="pipe or a device"), new_file(pipe, overwrite=True):
        pass
    assert pipe.is_fifo()
