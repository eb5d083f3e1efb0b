"""The network as an ONNX graph, written node by node from its weights.

So few nodes need no tracing: this takes milliseconds where torch's exporter takes seconds, and no torch.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import MissingExtraError

OPSET = 17
INPUT, OUTPUT = "images", "scores"


def onnx_bytes(
    weights: dict[str, NDArray[np.float32]], image: tuple[int, int, int], last_relu: bool
) -> bytes:
    """The graph: `images` (n, C, h, w) uint8 -> `scores` (n, N) float32 softmax probabilities."""
    try:
        from onnx import TensorProto, checker, helper, numpy_helper
    except ModuleNotFoundError as error:
        raise MissingExtraError("onnx", "train", "saving a trained network") from error
    graph = _Graph(helper)
    x = graph.add("Cast", [INPUT], to=TensorProto.FLOAT)
    x = graph.add("Div", [x, "full_scale"])
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
    tensors = weights | {"full_scale": np.array(255, np.float32)}
    n_places = len(weights["full3.bias"])
    model = helper.make_model(
        helper.make_graph(
            graph.nodes,
            "evplace",
            [helper.make_tensor_value_info(INPUT, TensorProto.UINT8, ["n", *image])],
            [helper.make_tensor_value_info(OUTPUT, TensorProto.FLOAT, ["n", n_places])],
            [numpy_helper.from_array(value, name) for name, value in tensors.items()],
        ),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=8,
        producer_name="evplace",
    )
    checker.check_model(model)
    content: bytes = model.SerializeToString()
    return content


class _Graph:
    """Nodes in order, each named after its place in it."""

    def __init__(self, helper: Any) -> None:
        self._helper = helper
        self.nodes: list[Any] = []

    def add(self, kind: str, inputs: list[str], output: str = "", **attributes: object) -> str:
        output = output or f"{kind.lower()}{len(self.nodes)}"
        self.nodes.append(self._helper.make_node(kind, inputs, [output], name=output, **attributes))
        return output
