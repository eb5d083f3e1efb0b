"""HDF5 in the layout of DSEC: events/{t,x,y,p}, t_offset and ms_to_idx; sizes as attributes of the group.

Times are 64 bits wide, where DSEC has 32, so that recordings of more than 71 minutes fit. The library that
writes the file brings its process down where the disk is full, so it has one of its own.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from evplace.core.errors import OutputError
from evplace.core.events import Events, Size
from evplace.core.workers import start
from evplace.sources.writers import _hdf5_file

ABOUT = "HDF5 in the layout of DSEC"
SUFFIX = ".h5"
LEAST_FREE = 1 << 20
"""With fewer bytes left than this, a disk is full."""


def write(path: Path, packets: Iterable[Events], size: Size) -> None:
    """Packets one after the other; the time of the first event becomes t_offset."""
    with start(_hdf5_file.__name__, {"path": str(path), "size": size}, stderr=subprocess.DEVNULL) as process:
        try:
            assert process.stdin is not None
            _send(packets, process)
            answer, _ = process.communicate()
        except BaseException:
            process.kill()
            raise
    told = json.loads(answer) if answer else {}
    if told.get("errno"):
        raise OSError(told["errno"], os.strerror(told["errno"]), str(path))
    if process.returncode or not told:
        if shutil.disk_usage(path.parent).free < LEAST_FREE:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        raise OutputError(f"writing HDF5 failed: {told.get('text', 'the library crashed')}")


def _send(packets: Iterable[Events], process: subprocess.Popen[bytes]) -> None:
    """Packets to the process that writes them, until it ends: each with its number of events before it."""
    assert process.stdin is not None
    for packet in packets:
        try:
            process.stdin.write(_hdf5_file.LENGTH.pack(len(packet)))
            for field in (packet.t_us, packet.x, packet.y, packet.p):
                process.stdin.write(np.ascontiguousarray(field).data)
        except BrokenPipeError:
            return
    try:
        process.stdin.write(_hdf5_file.LENGTH.pack(0))
        process.stdin.flush()
    except BrokenPipeError:
        return
