"""Folders that were saved and then altered, as other programs, editors and broken disks alter them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

RAW = [
    "null", "true", "-1", "0", "3", "0.5", "1e308", "1e400", "NaN", "1" + "0" * 30, "1" + "0" * 5000,
    '""', '"x"', "[]", "{}", "[[[[1]]]]", '{"x": [null]}', '"\\ud800"',
]  # fmt: skip
"""What stands in place of a value, as JSON has it."""

Alteration = tuple[str, Callable[[Path], None]]
"""What is done, in words; and what does it to a folder."""


def json_alterations(folder: Path, name: str) -> Iterator[Alteration]:
    """Every key of a JSON file removed, and every value replaced by each of RAW."""
    about = json.loads((folder / name).read_text())
    for keys in _paths(about):
        if keys:
            yield f"{name} without {keys}", _removing(name, keys)
        for raw in RAW:
            yield f"{name} with {keys} = {raw[:20]}", _replacing(name, keys, raw)
    for text in ("[" * 100_000 + "]" * 100_000, "", "{", "\x00" * 100, '{"a": 1}' * 2, "\ufeff{}"):
        yield f"{name} is {text[:9]!r}", _writing(name, text.encode())
    yield f"{name} is no UTF-8", _writing(name, b"\xff\xfe{}")


def array_alterations(folder: Path, name: str) -> Iterator[Alteration]:
    """Other types, shapes and values of a .npy file, and files that are cut or claim too much."""
    array = np.load(folder / name)
    data = (folder / name).read_bytes()
    for kind in ("i1", "u1", "i8", "u8", "f2", "f4", "f8", ">f8", ">i8", "c16", "?", "U3", "M8[us]", "V4"):
        yield f"{name} as {kind}", _saving(name, _cast(array, kind))
    yield f"{name} as objects", _saving(name, np.array([{}, []], dtype=object))
    yield f"{name} as a record", _saving(name, np.zeros(len(array), [("a", "i4"), ("b", "f8")]))
    for what, other in (
        ("empty", array[:0]), ("one shorter", array[:-1]), ("twice", np.concatenate([array, array])),
        ("without its first axis", array[0]), ("with one axis more", array[None]),
        ("flat", array.reshape(-1)), ("turned", array.T), ("a number", np.array(3)),
        ("backwards", array[::-1]), ("narrow", array[..., :0]),
        ("in Fortran's order", np.asfortranarray(array)),
    ):  # fmt: skip
        yield f"{name} {what}", _saving(name, other)
    for value in (np.nan, np.inf, -np.inf, 1e308, -1, 2**62, -(2**62)):
        yield f"{name} all {value}", _saving(name, _full(array, value))
        yield f"{name} with one {value}", _saving(name, _with_one(array, value))
    for size in (0, 5, 64, 128, len(data) - 1):
        yield f"{name} cut after {size} bytes", _writing(name, data[:size])
    yield f"{name} with more bytes", _writing(name, data + b"more")
    for shape in (b"(99999999999, 99999999999)", b"(-1,)", b"(9999999999999999999999,)", b"()", b"'x'"):
        yield f"{name} that claims {shape.decode()}", _writing(name, _claiming(data, shape))


def file_alterations(folder: Path) -> Iterator[Alteration]:
    """Each file missing, a folder, a link to something else, or a file of nothing."""
    for name in sorted(file.name for file in folder.iterdir()):
        yield f"{name} is missing", lambda place, name=name: (place / name).unlink()
        yield f"{name} is a folder", _becoming(name, lambda file: file.mkdir())
        yield f"{name} is a link into nothing", _becoming(name, lambda file: file.symlink_to("nowhere"))
        yield f"{name} is a link to itself", _becoming(name, lambda file: file.symlink_to(file.name))
        yield f"{name} is a link to a device", _becoming(name, lambda file: file.symlink_to("/dev/zero"))
        yield f"{name} is empty", _becoming(name, lambda file: file.touch())
        yield f"{name} cannot be read", lambda place, name=name: (place / name).chmod(0)
    yield "a file more", lambda place: (place / "more.txt").write_text("more")


def altered(saved: Path, place: Path, alteration: Callable[[Path], None]) -> Path:
    """A copy of a folder, altered; what stood in its place goes."""
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(saved, place)
    alteration(place)
    return place


def _paths(value: Any, keys: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where each value of a JSON document lies; of a list, its first two."""
    yield keys
    inner = (
        value.items() if isinstance(value, dict) else enumerate(value[:2]) if isinstance(value, list) else ()
    )
    for key, part in inner:
        yield from _paths(part, (*keys, key))


def _removing(name: str, keys: tuple[Any, ...]) -> Callable[[Path], None]:
    def alter(folder: Path) -> None:
        about = json.loads((folder / name).read_text())
        inner = about
        for key in keys[:-1]:
            inner = inner[key]
        del inner[keys[-1]]
        (folder / name).write_text(json.dumps(about))

    return alter


def _replacing(name: str, keys: tuple[Any, ...], raw: str) -> Callable[[Path], None]:
    def alter(folder: Path) -> None:
        about = {"": json.loads((folder / name).read_text())}
        inner: Any = about
        for key in ("", *keys)[:-1]:
            inner = inner[key]
        inner[("", *keys)[-1]] = "HERE"
        (folder / name).write_text(json.dumps(about[""]).replace('"HERE"', raw))

    return alter


def _writing(name: str, data: bytes) -> Callable[[Path], None]:
    return lambda folder: (folder / name).write_bytes(data) and None


def _saving(name: str, array: Any) -> Callable[[Path], None]:
    return lambda folder: np.save(folder / name, array)


def _becoming(name: str, make: Callable[[Path], object]) -> Callable[[Path], None]:
    def alter(folder: Path) -> None:
        (folder / name).unlink()
        make(folder / name)

    return alter


def _cast(array: Any, kind: str) -> Any:
    with np.errstate(all="ignore"):
        if kind == "V4":
            return np.zeros(array.shape, kind)
        return (
            np.nan_to_num(array).astype("i8").astype(kind) if kind in ("M8[us]", "U3") else array.astype(kind)
        )


def _full(array: Any, value: float) -> Any:
    whole = int(np.nan_to_num(value)) if abs(value) < 2**63 else 127
    with np.errstate(all="ignore"):
        return np.full(array.shape, value if array.dtype.kind == "f" else whole).astype(array.dtype)


def _with_one(array: Any, value: float) -> Any:
    changed = np.array(array)
    changed.reshape(-1)[-1] = _full(array[:1], value).reshape(-1)[0]
    return changed


def _claiming(data: bytes, shape: bytes) -> bytes:
    start = data.index(b"'shape': ") + len(b"'shape': ")
    end = data.index(b")", start) + 1
    room = data.index(b"\n") - start
    return data[:start] + (shape + b", }").ljust(room)[:room] + data[data.index(b"\n") :] if end else data
