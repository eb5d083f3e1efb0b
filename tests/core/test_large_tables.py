"""Tables of score rows in memory and in files."""

from __future__ import annotations

import errno
import io

import numpy as np
import pytest

from evplace.core import tables
from evplace.core.errors import InputError


class Full(io.BytesIO):
    """A file on a full disk."""

    def write(self, _: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize("held", [0, 1 << 20])
def test_a_table_is_the_same_in_a_file(held: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "MEMORY_BYTES", held)
    table = tables.empty_rows(5, 7)
    assert isinstance(table, np.memmap) == (held == 0)
    assert (table == 0).all()
    wanted = np.random.default_rng(0).random((5, 7)).astype(np.float32)
    table[:] = wanted
    np.testing.assert_array_equal(tables.rows_of(table, np.array([0, 2, 4])), wanted[::2])
    assert tables.rows_of(table, np.arange(5)) is table


def test_a_full_disk_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "MEMORY_BYTES", 0)
    monkeypatch.setattr(tables.tempfile, "TemporaryFile", Full)
    with pytest.raises(InputError, match=r"5 x 7 scores, 0.0 GB, do not fit into .*No space left"):
        tables.empty_rows(5, 7)
