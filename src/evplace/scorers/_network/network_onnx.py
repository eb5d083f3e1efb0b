"""The network as an ONNX graph, written node by node from its weights.

So few nodes need no tracing: this takes milliseconds where torch's exporter takes seconds, and no torch.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import MissingExtraError, PlaceMapError

OPSET = 17
INPUT, OUTPUT = "images", "scores"
SCALE = 0.4
"""Root mean square of a scaled image: what busy event images have anyhow, where full scale is 1."""
LEAST = 0.02
"""Added to its own before: what is nearly empty is not blown up."""
MOST_NODES, MOST_NUMBER = 64, 16
"""How many nodes a graph has at most, and how large a number in one is: paddings, strides and kernels."""
MOST_PIXELS = 1 << 25
"""Numbers of an image that a network may ask for."""
OPERATORS = frozenset(
    (
        "Add", "BatchNormalization", "Cast", "Conv", "Div", "Flatten", "Gemm", "GlobalLpPool", "MaxPool",
        "Relu", "Softmax",
    )
)  # fmt: skip
"""What the graph is made of: a map is an input, and others could run for ever or read files."""
Port = tuple[str, int, list[str | int]]
"""What a graph takes or gives: name, type of its numbers, shape."""


def onnx_bytes(
    weights: dict[str, NDArray[np.float32]],
    image: tuple[int, int, int],
    last_relu: bool,
    own_scale: bool = False,
) -> bytes:
    """The graph: `images` (n, C, h, w) uint8 -> `scores` (n, N) float32 softmax probabilities."""
    graph = Graph()
    from onnx import TensorProto

    for name, value in weights.items():
        graph.constant(name, value)
    x = graph.add("Cast", [INPUT], to=TensorProto.FLOAT)
    x = graph.add("Div", [x, graph.constant("full_scale", np.array(255, np.float32))])
    if own_scale:
        x = _scaled(graph, x, image[1] * image[2])
    for layer in ("1", "2", "3"):
        x = graph.add("Conv", [x, f"conv{layer}.weight", f"conv{layer}.bias"], pads=[2, 2, 2, 2])
        x = graph.add("Relu", [x])
        x = graph.add("MaxPool", [x], kernel_shape=[2, 2], strides=[2, 2])
        if layer != "3":
            names = [f"norm{layer}.{part}" for part in ("weight", "bias", "running_mean", "running_var")]
            x = graph.add("BatchNormalization", [x, *names], epsilon=1e-5)
    x = graph.add("Flatten", [x])
    for layer in ("1", "2", "3"):
        x = graph.add("Gemm", [x, f"full{layer}.weight", f"full{layer}.bias"], transB=1)
        if layer != "3" or last_relu:
            x = graph.add("Relu", [x])
    graph.add("Softmax", [x], axis=1, output=OUTPUT)
    takes: Port = (INPUT, TensorProto.UINT8, ["n", *image])
    gives: Port = (OUTPUT, TensorProto.FLOAT, ["n", len(weights["full3.bias"])])
    return graph.model(takes, gives)


def _scaled(graph: Graph, x: str, pixels: int) -> str:
    """As `scaled` of the network has it; the pool gives the root of the sum of squares."""
    size = graph.constant("size", np.array(SCALE * np.sqrt(pixels), np.float32))
    least = graph.constant("least", np.array(LEAST / SCALE, np.float32))
    own = graph.add("Div", [graph.add("GlobalLpPool", [x], p=2), size])
    return graph.add("Div", [x, graph.add("Add", [own, least])])


def check_graph(network: bytes) -> None:
    """PlaceMapError where an ONNX graph is damaged, or holds anything but what `onnx_bytes` writes.

    Read without the package onnx, which answering does not need. The numbers are those of onnx.proto.
    """
    try:
        model = _Message(network)
        graphs = model.parts(7)  # a parser merges those of one message
        nodes = [node for graph in graphs for node in graph.parts(1)]
        tensors = [tensor for graph in graphs for tensor in graph.parts(5)]
        kinds = {kind.text for node in nodes for kind in node.parts(4)}
        foreign = {kind.text for node in nodes for kind in node.parts(7)} - {""}
        others = sorted(kinds - OPERATORS) or sorted(foreign) or ["functions of its own"] * model.has(25)
        large = any(abs(number) > MOST_NUMBER for node in nodes for number in _numbers(node))
        elsewhere = any(graph.has(15) for graph in graphs) or any(
            one.has(13) or one.has(14) for one in tensors
        )
    except IndexError as error:
        raise PlaceMapError("the map's network is damaged: it is no ONNX graph") from error
    if len(nodes) > MOST_NODES or large:
        raise PlaceMapError("the map's network is none that evplace writes: layers too large, or too many")
    if others:
        raise PlaceMapError(
            f"the map's network is none that evplace writes: it holds {', '.join(others)[:99]!r}"
        )
    if elsewhere:
        raise PlaceMapError("the map's network is none that evplace writes: its weights lie in other files")


def _numbers(node: _Message) -> Iterator[int]:
    """The whole numbers among a node's attributes: i, and ints, packed or not."""
    for attribute in node.parts(5):
        for kind, value in attribute.numbers():
            if kind in (3, 8):
                yield value


class _Message:
    """A protobuf message, as far as its fields are asked for; IndexError where it is cut off."""

    def __init__(self, data: object) -> None:
        if not isinstance(data, bytes | memoryview):
            raise IndexError("a number in place of a message")
        self._data = memoryview(data)

    @functools.cached_property
    def _fields(self) -> list[tuple[int, object]]:
        return list(_fields(self._data))

    @property
    def text(self) -> str:
        """What it says, where it is a text."""
        return bytes(self._data).decode("ascii", "replace")

    def parts(self, number: int) -> list[_Message]:
        """The messages, or texts, of that number."""
        return [_Message(value) for found, value in self._fields if found == number]

    def numbers(self) -> Iterator[tuple[int, int]]:
        """Number of the field and value of each whole number, also of those in a packed row."""
        for found, value in self._fields:
            if isinstance(value, int):
                yield found, _signed(value)
            elif found == 8 and isinstance(value, memoryview):
                at = 0
                while at < len(value):
                    packed, at = _varint(value, at)
                    yield found, _signed(packed)

    def has(self, number: int) -> bool:
        """Whether there is a field of that number."""
        return any(found == number for found, _ in self._fields)


def _fields(message: memoryview) -> Iterator[tuple[int, object]]:
    """Number and value of each field of a protobuf message; IndexError where it is cut off."""
    at = 0
    while at < len(message):
        key, at = _varint(message, at)
        kind, size = key & 7, {1: 8, 5: 4}.get(key & 7, 0)
        value: object = None
        if kind == 0:
            value, at = _varint(message, at)
        elif kind == 2:
            size, at = _varint(message, at)
            value = message[at : at + size]
        elif not size:
            raise IndexError(f"a field of kind {kind}")
        at += size
        if at > len(message):
            raise IndexError("cut off")
        yield key >> 3, value


def _signed(value: int) -> int:
    """A number as 64 bits hold it."""
    return value - (1 << 64) if value >> 63 else value


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    """The number that begins at a place, and the place after it."""
    value = 0
    for shift in range(0, 70, 7):
        byte = message[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, at
    raise IndexError("a number without an end")


class Graph:
    """Nodes in order, each named after its place in it, and the constants that they take."""

    def __init__(self) -> None:
        """MissingExtraError where the package onnx is not installed."""
        try:
            from onnx import helper
        except ModuleNotFoundError as error:
            raise MissingExtraError("onnx", "train", "saving a trained network") from error
        self._helper: Any = helper
        self._nodes: list[Any] = []
        self._constants: dict[str, NDArray[Any]] = {}

    def add(self, kind: str, inputs: list[str], output: str = "", **attributes: object) -> str:
        """A node; returns the name of what it gives."""
        output = output or f"{kind.lower()}{len(self._nodes)}"
        self._nodes.append(self._helper.make_node(kind, inputs, [output], name=output, **attributes))
        return output

    def constant(self, name: str, value: NDArray[Any]) -> str:
        """A tensor by its name, which is returned."""
        self._constants[name] = value
        return name

    def model(self, takes: Port, gives: Port) -> bytes:
        """The whole graph, checked."""
        from onnx import checker, numpy_helper

        ports = [self._helper.make_tensor_value_info(*port) for port in (takes, gives)]
        tensors = [numpy_helper.from_array(value, name) for name, value in self._constants.items()]
        model = self._helper.make_model(
            self._helper.make_graph(self._nodes, "evplace", ports[:1], ports[1:], tensors),
            opset_imports=[self._helper.make_opsetid("", OPSET)],
            ir_version=8,
            producer_name="evplace",
        )
        checker.check_model(model)
        content: bytes = model.SerializeToString()
        return content
