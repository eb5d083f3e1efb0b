"""The trained network as an ONNX graph, written node by node, and the file that says what it is."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from evplace.core.storage import new_file, write_json
from evplace.scorers._network.network_onnx import Graph, Port
from evplace.scorers._reduction import reduction
from evplace.scorers.trained import ABOUT, INPUT, OUTPUT, WEIGHTS
from evplace_lab.descriptor.network import (
    ADDED,
    DIMENSIONS,
    FLOOR,
    LAYERS,
    POOLED,
    SHARP,
    WIDE,
    Weights,
)
from evplace_lab.descriptor.sensors import SIZE

COLUMNS, ROWS = SIZE


def onnx_bytes(weights: Weights) -> bytes:
    """The graph: `images` (n, 45, 80) float32 in 0 to 255 -> `vectors` (n, 256) float32 of length 1.

    Batch norms are taken into their convolutions; weights are kept in half precision.
    """
    from onnx import TensorProto

    graph = Graph()
    x = _surroundings(graph)
    for number, (_, _, side, stride) in enumerate(LAYERS):
        if number in POOLED:
            x = graph.add("MaxPool", [x], kernel_shape=[2, 2], strides=[2, 2], ceil_mode=1)
        kernel, bias = _folded(weights, number)
        inputs = [x, _half(graph, f"kernel{number}", kernel), _half(graph, f"bias{number}", bias)]
        said = graph.add("Conv", inputs, pads=[side // 2] * 4, strides=[stride, stride])
        x = graph.add("Relu", [graph.add("Add", [x, said]) if number in ADDED else said])
    last, full = (
        [_half(graph, f"{name}.{part}", weights[f"{name}.{part}"]) for part in ("weight", "bias")]
        for name in ("last", "full")
    )
    x = graph.add("Gemm", [graph.add("Flatten", [graph.add("Conv", [x, *last])]), *full], transB=1)
    graph.add("LpNormalization", [x], axis=1, p=2, output=OUTPUT)
    takes: Port = (INPUT, TensorProto.FLOAT, ["n", ROWS, COLUMNS])
    return graph.model(takes, (OUTPUT, TensorProto.FLOAT, ["n", DIMENSIONS]))


def _surroundings(graph: Graph) -> str:
    """See `network.Surroundings`."""
    full = graph.constant("full_scale", np.array(255, np.float32))
    values = _blurred(graph, graph.add("Sqrt", [graph.add("Div", [INPUT, full])]), "sharp", SHARP)
    mean = _blurred(graph, values, "wide", WIDE)
    squared = _blurred(graph, graph.add("Mul", [values, values]), "wide", WIDE)
    variance = graph.add("Sub", [squared, graph.add("Mul", [mean, mean])])
    deviation = graph.add("Sqrt", [graph.add("Relu", [variance])])
    floor = graph.add("ReduceMean", [deviation], axes=[1, 2], keepdims=1)
    floor = graph.add("Mul", [floor, graph.constant("floor", np.array(FLOOR, np.float32))])
    floor = graph.add("Add", [floor, graph.constant("least", np.array(1e-3, np.float32))])
    contrast = graph.add("Sub", [values, mean])
    contrast = graph.add("Div", [contrast, graph.add("Add", [deviation, floor])])
    return graph.add("Unsqueeze", [contrast, graph.constant("axis", np.array([1], np.int64))])


def _blurred(graph: Graph, values: str, name: str, sigma: float) -> str:
    rows = graph.constant(f"{name}_rows", reduction(ROWS, ROWS, sigma))
    columns = graph.constant(f"{name}_columns", reduction(COLUMNS, COLUMNS, sigma).T.copy())
    return graph.add("MatMul", [graph.add("MatMul", [rows, values]), columns])


def _folded(weights: Weights, number: int) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Kernel and bias of a convolution with its batch norm."""
    scale, shift, mean, variance = (
        weights[f"norms.{number}.{part}"].astype(np.float64)
        for part in ("weight", "bias", "running_mean", "running_var")
    )
    scale = scale / np.sqrt(variance + 1e-5)
    kernel = weights[f"convolutions.{number}.weight"] * scale[:, None, None, None]
    return kernel.astype(np.float32), (shift - mean * scale).astype(np.float32)


def _half(graph: Graph, name: str, values: np.ndarray[Any, Any]) -> str:
    """A constant that is kept in half precision and used in single."""
    from onnx import TensorProto

    return graph.add("Cast", [graph.constant(name, values.astype(np.float16))], to=TensorProto.FLOAT)


def write_descriptor(folder: Path, weights: Weights, about: dict[str, Any]) -> str:
    """Write the graph and what it is into `folder`; returns its checksum."""
    graph = onnx_bytes(weights)
    checksum = hashlib.sha256(graph).hexdigest()
    with new_file(folder / WEIGHTS, overwrite=True) as partial:
        partial.write_bytes(graph)
    with new_file(folder / ABOUT, overwrite=True) as partial:
        write_json(partial, {"sha256": checksum, "licence": "Apache-2.0", **about})
    return checksum
