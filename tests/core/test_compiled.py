"""Loops that are compiled with their first call."""

from __future__ import annotations

import subprocess
import sys

import numpy as np

from evplace.core.compiled import njit


@njit()
def doubled(values: np.ndarray) -> np.ndarray:
    """Twice the values."""
    return values * 2


@njit(error_model="numpy")
def share(values: np.ndarray, by: float) -> float:
    """Calls another loop."""
    return doubled(doubled(values))[0] / by


def test_a_loop_calls_another_with_its_options() -> None:
    assert share(np.full(1, 3.0), 2.0) == 6
    assert share(np.ones(1), 0.0) == np.inf
    assert share.__doc__ == "Calls another loop."


IMPORTS = """
import sys, pathlib, importlib
from evplace import cli
for module in cli._modules().values():
    importlib.import_module(module)
import evplace.matchers.bayes, evplace.matchers.graph, evplace.scorers.fused, evplace.scorers.sad
assert cli.main(["list", "matchers"]) == 0
print(*({"numba", "onnxruntime", "torch", "h5py", "matplotlib"} & set(sys.modules)))
"""


def test_no_command_waits_for_what_it_may_not_need() -> None:
    """All of them imported in one child: what is slow to import is not among what came along."""
    child = subprocess.run([sys.executable, "-c", IMPORTS], capture_output=True, text=True, check=True)
    assert child.stdout.splitlines()[-1] == ""
