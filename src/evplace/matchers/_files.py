"""Score matrices from .npy files, matches to .csv files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core import storage
from evplace.core.errors import ScoresError
from evplace.matchers import Path, Rows

HEADER = "query,reference,score,accepted"


def open_scores(path: FilePath) -> NDArray[Any]:
    """The (queries, references) matrix of a .npy file, read from the disk as it is needed.

    Raises ScoresError where there is none: no such file, damaged, or not a matrix of real numbers.
    """
    if storage.is_stream(path):
        raise ScoresError(f"{path} is a pipe or a device: scores are read from files, so save it first")
    try:
        table = np.lib.format.open_memmap(path, mode="r")
    except OSError as error:
        raise ScoresError(f"cannot read scores from {path}: {error.strerror or error}") from error
    except (ValueError, EOFError, OverflowError) as error:
        raise ScoresError(
            f"{path} is not a whole .npy file of numbers ({error}): write it with numpy.save"
        ) from error
    if table.ndim != 2 or 0 in table.shape:
        raise ScoresError(f"scores have the shape (queries, references), but {path} has {table.shape}")
    if table.dtype.kind not in "fiub":
        raise ScoresError(f"scores are real numbers, but {path} holds {table.dtype}")
    return table


def score_blocks(table: NDArray[Any], distances: bool, rows: int = 256) -> Iterator[Rows]:
    """The rows of `table` in order, a few at a time, larger is better: distances are negated."""
    for start in range(0, len(table), rows):
        block = np.asarray(table[start : start + rows])
        scores = block if block.dtype.kind == "f" else block.astype(np.float64)
        yield -scores if distances else scores


def write_matches(path: FilePath, matches: Path, overwrite: bool = False) -> None:
    """The matches as text: query and reference from 0, reference -1 where there is none, accepted 1 or 0.

    Raises OutputError as `storage.new_file` does.
    """
    rows = zip(matches.item.tolist(), matches.score.tolist(), matches.accepted.tolist(), strict=True)
    lines = [f"{query},{item},{score:.9g},{accepted:d}" for query, (item, score, accepted) in enumerate(rows)]
    with storage.new_file(path, overwrite) as partial:
        partial.write_text("\n".join([HEADER, *lines]) + "\n", "utf-8")
