"""What an object holds, in an open format: a text that says how its parts hang together, and its arrays.

For what goes on where it was stopped. Nothing of a file is ever run: objects are made empty and get back what
they held, and only classes of packages that the caller trusts are made.
"""

from __future__ import annotations

import importlib
import io
import json
import zipfile
import zlib
from array import array
from collections import deque
from collections.abc import Callable, Collection
from typing import Any

import numpy as np

TEXT = "state"
"""The array that holds the text, as bytes."""
DAMAGED = (
    ValueError, LookupError, TypeError, AttributeError, EOFError, OSError, ImportError, RuntimeError,
    zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""What a file that is no state may raise: numpy, zipfile (of encryption, say) and the text's own nonsense."""
PLAIN = (type(None), bool, int, float, str)


def packed(state: object) -> bytes:
    """`state` as .npz; TypeError where it holds what is no data: a function, a file, a lock."""
    packing = _Packing()
    top = packing.node(state)
    text = json.dumps({"top": top, "nodes": packing.nodes}).encode()
    file = io.BytesIO()
    np.savez(file, **{TEXT: np.frombuffer(text, np.uint8), **packing.arrays})
    return file.getvalue()


def unpacked(data: bytes, packages: Collection[str]) -> Any:
    """What `packed` was given, made of classes of these packages alone; ValueError where it is not such."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            about = json.loads(arrays[TEXT].tobytes())
            return _Unpacking(about["nodes"], dict(arrays), packages).value(about["top"])
    except DAMAGED as error:
        raise ValueError(f"this is no state: {error}") from error


class _Packing:
    """Each object once: what two parts share, they share again afterwards."""

    def __init__(self) -> None:
        self.nodes: list[dict[str, Any]] = []
        self.arrays: dict[str, Any] = {}
        self._known: dict[int, tuple[int, object]] = {}  # the object, too, so that its id stays its own

    def node(self, value: object) -> Any:
        """A plain value as it is, for anything else [its number]."""
        if type(value) in PLAIN:
            return {"float": value.hex()} if isinstance(value, float) else value
        if id(value) not in self._known:
            number = len(self.nodes)
            self._known[id(value)] = number, value
            self.nodes.append({})
            self.nodes[number] = self._described(value, number)
        return [self._known[id(value)][0]]

    def _described(self, value: Any, number: int) -> dict[str, Any]:
        kind = type(value)
        if kind in (list, set):
            return {kind.__name__: self._all(value)}
        if kind is dict:
            return {"dict": [self._all(value.keys()), self._all(value.values())]}
        if kind is deque:
            return {"deque": self._all(value), "most": value.maxlen}
        if isinstance(value, tuple):
            return {"tuple": self._all(value), "class": None if kind is tuple else _name_of(kind)}
        if isinstance(value, array):
            self.arrays[f"array{number}"] = np.asarray(value)
            return {"array": None, "of": "array" + value.typecode}
        if isinstance(value, np.ndarray | np.generic | bytes):
            self.arrays[f"array{number}"] = _as_array(value)
            return {"array": None, "of": kind.__name__}
        held = _held(value)
        return {"class": _name_of(kind), "names": list(held), "values": self._all(held.values())}

    def _all(self, values: Any) -> list[Any]:
        return [self.node(value) for value in values]


def _as_array(value: Any) -> Any:
    found = np.frombuffer(value, np.uint8) if isinstance(value, bytes) else np.asarray(value)
    if found.dtype.hasobject:
        raise TypeError("an array of objects")
    return found


def _held(value: object) -> dict[str, Any]:
    """The attributes of an object, in its `__dict__` and its slots."""
    if not hasattr(value, "__dict__") and not _slots(type(value)):
        raise TypeError(f"{type(value).__module__}.{type(value).__qualname__} holds no data")
    if isinstance(value, type) or (callable(value) and not _slots(type(value)) and not vars(value)):
        raise TypeError(f"{value!r} is no data")
    slots = {name: getattr(value, name) for name in _slots(type(value)) if hasattr(value, name)}
    return slots | getattr(value, "__dict__", {})


def _slots(kind: type) -> list[str]:
    return [name for each in kind.__mro__ for name in vars(each).get("__slots__", ())]


def _name_of(kind: type) -> str:
    if "<" in kind.__qualname__:
        raise TypeError(f"{kind.__qualname__} is known in one place only")
    return f"{kind.__module__}:{kind.__qualname__}"


class _Unpacking:
    def __init__(
        self, nodes: list[dict[str, Any]], arrays: dict[str, Any], packages: Collection[str]
    ) -> None:
        self._nodes, self._arrays, self._packages = nodes, arrays, packages
        self._made: dict[int, Any] = {}

    def value(self, node: Any) -> Any:
        """What `_Packing.node` described."""
        if isinstance(node, dict):
            return float.fromhex(node["float"])
        if not isinstance(node, list):
            return node
        (number,) = node
        if number not in self._made:
            self._make(number, self._nodes[number])
        return self._made[number]

    def _make(self, number: int, about: dict[str, Any]) -> None:
        """Empty first, where it can be: what an object holds may hold the object."""
        if "array" in about:
            self._made[number] = _as_it_was(self._arrays[f"array{number}"], about["of"])
        elif "tuple" in about:
            items = [self.value(node) for node in about["tuple"]]
            self._made[number] = tuple(items) if about["class"] is None else self._class(about)._make(items)
        elif "names" in about:
            kind = self._class(about)
            self._made[number] = made = kind.__new__(kind)
            for name, node in zip(about["names"], about["values"], strict=True):
                object.__setattr__(made, name, self.value(node))
        else:
            self._fill(number, about)

    def _fill(self, number: int, about: dict[str, Any]) -> None:
        if "dict" in about:
            self._made[number] = made = dict[Any, Any]()
            keys, values = ([self.value(node) for node in nodes] for nodes in about["dict"])
            made.update(zip(keys, values, strict=True))
        elif "set" in about:
            self._made[number] = {self.value(node) for node in about["set"]}
        else:
            (name, nodes), *_ = about.items()
            filled: list[Any] | deque[Any] = deque(maxlen=about["most"]) if name == "deque" else []
            self._made[number] = filled
            filled.extend(self.value(node) for node in nodes)

    def _class(self, about: dict[str, Any]) -> Any:
        module, _, path = about["class"].partition(":")
        if module.partition(".")[0] not in self._packages:
            raise ValueError(f"{about['class']} is of a package that makes no such state")
        found: Any = importlib.import_module(module)
        for name in path.split("."):
            found = getattr(found, name)
        if not isinstance(found, type) or f"{found.__module__}:{found.__qualname__}" != about["class"]:
            raise ValueError(f"{about['class']} is no class")
        return found


def _as_it_was(values: Any, kind: str) -> Any:
    """An array of numpy's or Python's, a number of numpy's, or bytes."""
    made: dict[str, Callable[[], Any]] = {
        "ndarray": lambda: values, "memmap": lambda: values, "bytes": values.tobytes,
    }  # fmt: skip
    if kind in made:
        return made[kind]()
    return array(kind.removeprefix("array"), values.tobytes()) if kind.startswith("array") else values[()]
