"""A state comes back as it was, from a file that nothing is run of."""

from __future__ import annotations

import io
import json
from array import array
from collections import deque
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evplace.core.state import TEXT, packed, unpacked

HERE = {__name__.partition(".")[0]}


class Pair(NamedTuple):
    first: object
    second: object


@dataclass(frozen=True)
class Frozen:
    number: float


class Slotted:
    __slots__ = ("a", "b")


class Node:
    """Holds itself."""

    def __init__(self) -> None:
        self.me = self


def there_and_back(value: object) -> Any:
    return unpacked(packed(value), HERE)


plain = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
states = st.recursive(
    plain,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.text(max_size=3), inner, max_size=4)
        | st.tuples(inner, inner)
        | st.builds(Pair, inner, inner)
        | st.builds(lambda items: deque(items, maxlen=3), st.lists(inner, max_size=4))
    ),
    max_leaves=12,
)


@given(states)
def test_plain_values_and_containers_come_back(state: object) -> None:
    assert repr(there_and_back(state)) == repr(state)


@pytest.mark.parametrize(
    "state",
    [
        np.arange(6, dtype=np.int16).reshape(2, 3),
        np.zeros((0, 4), np.float32),
        np.array(3.5),
        np.zeros(2, bool),
    ],
)
def test_arrays_come_back_of_their_own_type(state: np.ndarray) -> None:
    found = there_and_back(state)
    assert (found.dtype, found.shape) == (state.dtype, state.shape)
    np.testing.assert_array_equal(found, state)


def test_numbers_of_numpy_bytes_and_arrays_of_python_come_back() -> None:
    state = [np.float32(0.1), np.int64(-3), b"\x00\xff", array("d", [1.5, 2.5]), {1, 2}]
    found = there_and_back(state)
    assert found == state
    assert [type(value) for value in found] == [type(value) for value in state]


def test_objects_get_back_what_they_held() -> None:
    slotted, node = Slotted(), Node()
    slotted.a = Frozen(float("inf"))
    found = there_and_back([slotted, node])
    assert found[0].a == slotted.a
    assert not hasattr(found[0], "b")
    assert found[1].me is found[1]


def test_what_is_shared_is_shared_again() -> None:
    shared = np.zeros(3)
    one, other = there_and_back((shared, [shared]))
    one[0] = 7
    assert other[0][0] == 7


@pytest.mark.parametrize("state", [len, lambda: None, int, np.sum, np.array([None]), open, object()])
def test_what_is_no_data_is_told(state: object) -> None:
    with pytest.raises(TypeError):
        packed([state])


def test_only_classes_of_trusted_packages_are_made() -> None:
    data = packed(Frozen(1.0))
    with pytest.raises(ValueError, match="of a package that makes no such state"):
        unpacked(data, {"evplace"})


def written(about: object) -> bytes:
    file = io.BytesIO()
    np.savez(file, **{TEXT: np.frombuffer(json.dumps(about).encode(), np.uint8)})  # type: ignore[arg-type]
    return file.getvalue()


@pytest.mark.parametrize(
    "name", ["os:system", "os:mkdir", "builtins:eval", "subprocess:Popen", "test_state:HERE"]
)
def test_nothing_is_called(name: str) -> None:
    node = {"class": name, "names": [], "values": []}
    with pytest.raises(ValueError, match="no state"):
        unpacked(written({"top": [0], "nodes": [node]}), HERE)


@pytest.mark.parametrize(
    "about",
    [
        [],
        {},
        {"top": [5], "nodes": []},
        {"top": [0], "nodes": [{}]},
        {"top": [0], "nodes": [{"array": None, "of": "x"}]},
    ],
)
def test_a_text_that_makes_no_sense_is_told(about: object) -> None:
    with pytest.raises(ValueError, match="no state"):
        unpacked(written(about), HERE)


@given(st.data())
def test_a_damaged_file_is_told_or_read(data: st.DataObject) -> None:
    whole = packed({"a": [1.0, np.arange(4)], "b": Frozen(2.0)})
    at = data.draw(st.integers(0, len(whole) - 1))
    damaged = bytearray(whole)
    damaged[at] ^= 1 << data.draw(st.integers(0, 7))
    for broken in (bytes(damaged), whole[:at]):
        try:
            unpacked(broken, HERE)
        except ValueError as error:
            assert str(error).startswith("this is no state")  # noqa: PT017 - both outcomes are right
