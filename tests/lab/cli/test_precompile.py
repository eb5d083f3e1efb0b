"""What is compiled ahead of time is what readers and commands call."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from made import MAKERS, SIZE, some_events

from evplace.core._arguments import is_known_here
from evplace.imaging.stream import EventImages
from evplace.sources.readers import aedat2, dat, es, evt2, evt3, evt21, open_recording
from evplace_lab.cli import precompile

DECODERS: dict[str, Any] = {
    module.__name__.rpartition(".")[2]: module._decode for module in (aedat2, dat, es, evt2, evt21, evt3)
}

pytestmark = pytest.mark.skipif(not is_known_here(), reason="never tried on this system")


@pytest.mark.parametrize("form", DECODERS)
def test_a_loop_that_decodes_nothing_is_called_as_by_its_reader(
    form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loop = DECODERS[form]
    assert loop in list(precompile.decoding_loops())
    monkeypatch.setattr(loop, "_entries", {})
    recording = open_recording(MAKERS[form](tmp_path, some_events()), size=SIZE)
    for canvas in (None, EventImages(SIZE).canvas):
        assert list(recording.packets(canvas)) or canvas
    by_reader = set(loop._entries)
    monkeypatch.setattr(loop, "_entries", {})
    precompile.decode_nothing(loop)
    assert by_reader
    assert all(loop._entries.values()), "numba itself was called"
    assert by_reader <= set(loop._entries)


FILL = """
from evplace_lab.cli import precompile
precompile.COMMANDS = ("info day.npz",)
precompile.decoding_loops = lambda: []
precompile.main()
"""
FIRST = """
import sys
from evplace.cli import main
main(["info", "day.npz"])
print(*{"numba", "evplace.placemap"} & set(sys.modules))
"""


def test_the_first_command_imports_little(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a copy of the package, whose own folder is filled by one command."""
    source = Path(__file__).parents[3] / "src"
    shutil.copytree(source, tmp_path / "src", ignore=shutil.ignore_patterns("__pycache__", "_shipped"))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "src"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    precompile.make_drives()
    subprocess.run([sys.executable, "-c", FILL], check=True)
    said = subprocess.run([sys.executable, "-c", FIRST], check=True, capture_output=True, text=True).stdout
    assert said.splitlines()[-1] == ""
