"""The ONNX graph against the network that it was written from."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="the network needs the extra 'train'")

from evplace.core.errors import InputError  # noqa: E402
from evplace.scorers.trained import ABOUT, WEIGHTS, DescriptorGraph  # noqa: E402
from evplace_lab.descriptor.export import write_descriptor  # noqa: E402
from evplace_lab.descriptor.network import DescriptorNetwork  # noqa: E402
from evplace_lab.descriptor.training import as_arrays  # noqa: E402


@pytest.fixture
def network() -> DescriptorNetwork:
    """One whose batch norms have seen something."""
    torch.manual_seed(0)
    network = DescriptorNetwork()
    with torch.no_grad():
        for _ in range(3):
            network(255 * torch.rand(8, 45, 80))
    return network.eval()


def test_the_graph_gives_what_the_network_gives(network: DescriptorNetwork, tmp_path: Path) -> None:
    images = np.random.default_rng(0).integers(0, 256, (5, 45, 80), np.uint8)
    checksum = write_descriptor(tmp_path, as_arrays(network), {"seed": 0})
    graph = DescriptorGraph(tmp_path)
    with torch.no_grad():
        wanted = network(torch.from_numpy(images.astype(np.float32))).numpy()
    given = graph.describe(images)
    assert np.abs(given - wanted).max() < 2e-3  # its weights are kept in half precision
    np.testing.assert_allclose(np.linalg.norm(given, axis=1), 1, rtol=1e-5)
    assert graph.checksum == checksum
    assert json.loads((tmp_path / ABOUT).read_text()) == {
        "sha256": checksum, "licence": "Apache-2.0", "seed": 0,
    }  # fmt: skip


def test_other_weights_than_described_are_refused(network: DescriptorNetwork, tmp_path: Path) -> None:
    write_descriptor(tmp_path, as_arrays(network), {})
    file = tmp_path / WEIGHTS
    file.write_bytes(file.read_bytes()[:-1])
    with pytest.raises(InputError, match=r"is not the file that descriptor\.json beside it describes"):
        DescriptorGraph(tmp_path)
