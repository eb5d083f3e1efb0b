"""What a long evaluation keeps now and then, so that one that was stopped goes on where it was.

A matcher's state is whatever it holds. Only classes of those packages that the localizer is made of are made
again, and only from a file of the same localizer, query and truth.
"""

from __future__ import annotations

import hashlib
import json
import time
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from evplace import __version__
from evplace.core import families
from evplace.core.state import packed, unpacked
from evplace.core.storage import new_file
from evplace.evaluation.truth import Truth
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer

EVERY_S = 60.0
"""Seconds between two."""
BLOCK = 1024
"""Images of a query that are read at once."""
OF_POSITIONS = ("cells", "places", "radius", "view")
"""Rules by which all that is right follows from positions,"""
SOME = 64
"""so that of these truths a row in so many is enough to tell them from others."""


class Checkpoint:
    """The file of an evaluation that is under way."""

    def __init__(
        self, path: Path, localizer: Localizer, query: Traverse, truths: list[Truth], answers: str
    ) -> None:
        self._path, self._of = path, (localizer, query, truths, answers)
        parts = (localizer.matcher, localizer.map.scorer)
        self._packages = {"evplace", *(type(part).__module__.partition(".")[0] for part in parts)}
        self._key: str | None = None
        self._next = time.monotonic() + EVERY_S

    @property
    def is_due(self) -> bool:
        """Whether it is time to save."""
        return time.monotonic() >= self._next

    def save(self, state: Mapping[str, Any]) -> None:
        """Keep a state; where a matcher's cannot be kept, that is said once."""
        try:
            data = packed({"key": self._same(), **state})
        except TypeError as error:
            matcher = families.described("matchers", self._of[0].matcher)
            warnings.warn(f"{matcher} cannot be kept ({error}): a stopped call begins anew", stacklevel=2)
            self._next = float("inf")
            return
        with new_file(self._path, overwrite=True) as partial:
            partial.write_bytes(data)
        self._next = time.monotonic() + EVERY_S

    def found(self) -> dict[str, Any] | None:
        """The state that was kept; None where there is none, or it is damaged or of something else."""
        if not self._path.is_file():
            return None
        try:
            state = unpacked(self._path.read_bytes(), self._packages)
        except ValueError:
            return None
        return state if isinstance(state, dict) and state.get("key") == self._same() else None

    def remove(self) -> None:
        """The evaluation is done."""
        self._path.unlink(missing_ok=True)

    def _same(self) -> str:
        if self._key is None:
            self._key = _key(*self._of)
        return self._key


def _key(localizer: Localizer, query: Traverse, truths: list[Truth], answers: str) -> str:
    """A checksum of all that the answers and their figures depend on."""
    place_map = localizer.map
    about = [__version__, answers, place_map.settings, localizer.settings, [truth.rule for truth in truths]]
    found = hashlib.sha256(json.dumps(about, sort_keys=True, default=str).encode())
    for name, part in sorted([*place_map.content.items(), *(place_map.learned or {}).items()]):
        found.update(name.encode())
        found.update(part if isinstance(part, bytes) else np.ascontiguousarray(part).data)
    for array in (query.t_us, query.counts, *(truth.judged for truth in truths)):
        found.update(np.ascontiguousarray(array).data)
    for start in range(0, len(query), BLOCK):
        found.update(np.ascontiguousarray(query.images[start : start + BLOCK]).data)
    for position in (query.xy, place_map.items.position, place_map.drive):
        found.update(np.ascontiguousarray(position).data)
    for truth in truths:
        follows = truth.rule.get("by") in OF_POSITIONS
        for at in range(0, truth.n_queries, SOME if follows else 1):
            found.update(np.packbits(truth.block(slice(at, at + 1))).data)
    return found.hexdigest()
