"""The house: one import direction, a light front door."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

SRC = Path(__file__).parents[1] / "src" / "evplace"

ROOMS = (
    "errors plugs storage settings workers events readers writers cleaning windows resampling "
    "representations tones images stream frames tracks spacing places truth traverse sheets simulators "
    "datasets capture city placemap network network_onnx augmentation checkpoint training distances "
    "seqslam_images scorers matchers sweeps localizer evaluation trial charts reproduction cli"
).split()
"""In the order of the data: a room imports only rooms before it, or files of its own."""


def imported_rooms(file: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("evplace"):
            parts = node.module.split(".")
            found |= {parts[1]} if len(parts) > 1 else {alias.name for alias in node.names}
        elif isinstance(node, ast.Import):
            found |= {alias.name.split(".")[1] for alias in node.names if alias.name.startswith("evplace.")}
    return found


def test_every_room_imports_only_rooms_before_it() -> None:
    for file in sorted(SRC.rglob("*.py")):
        room = file.relative_to(SRC).parts[0].removesuffix(".py")
        if room in ("__init__", "__main__"):
            continue
        assert room in ROOMS, f"{file}: give the room a place in the order"
        allowed = set(ROOMS[: ROOMS.index(room) + 1]) | {"__version__"}
        assert imported_rooms(file) <= allowed, f"{file} imports {imported_rooms(file) - allowed}"


def test_import_loads_numpy_and_nothing_heavier() -> None:
    heavy = "torch onnx onnxruntime numba h5py faery matplotlib PIL rosbags tyro rich scipy cv2 utm".split()
    code = f"import sys, evplace; print([name for name in {heavy} if name in sys.modules])"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"
