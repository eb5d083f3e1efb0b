"""The notebooks run from top to bottom, on made drives in place of the city's."""

from __future__ import annotations

import json
import sys
import types
from pathlib import Path

import pytest

from made_pages import ROOT, write_sample

NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))


def test_there_are_notebooks() -> None:
    assert len(NOTEBOOKS) >= 3


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(notebook: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pyplot = pytest.importorskip("matplotlib.pyplot", reason="the notebooks draw: the extra 'report'")
    pyplot.switch_backend("agg")
    write_sample(tmp_path / "evplace-sample")
    monkeypatch.chdir(tmp_path)
    module = types.ModuleType("typed_in_a_notebook")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    for cell in json.loads(notebook.read_text("utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), notebook.name, "exec", dont_inherit=True), vars(module))
    pyplot.close("all")


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_with_what_it_showed(notebook: Path) -> None:
    cells = [cell for cell in json.loads(notebook.read_text("utf-8"))["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    assert not [output for cell in cells for output in cell["outputs"] if output["output_type"] == "error"]
    assert "/work" not in notebook.read_text("utf-8")
