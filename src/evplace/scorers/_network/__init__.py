"""The paper's network: its layers, its training, its ONNX graph."""
