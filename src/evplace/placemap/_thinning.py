"""Which references of one more drive add something to a map.

A reference that never wins is left out: one that, for each image of its own drive just before and after it,
is no better than what other drives have left at its item. Such an image is asked only where one beside it is
the likest to it of all its drive; else it could not tell. The rule is ours. A stricter one, that a reference
must be more like those beside it than like any of another drive, left out half to three quarters, and cost
ten points by night.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evplace.placemap._parts import JoinedRows, Part
from evplace.scorers import OpenScorer, opened_together, thinned

if TYPE_CHECKING:
    from evplace.placemap import PlaceMap

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

RULE = "never best"
"""The reason why a reference was left out."""
BESIDE = 3.0
"""References of one drive are beside one another up to this many of its usual steps."""


def thin(parts: Sequence[Part], new: Part) -> Part:
    """One more drive without the references that add nothing to those of `parts`, as far as they can be."""
    kept = np.flatnonzero(useful(parts, new))
    content = thinned(new.map.scorer, new.map.content, kept)
    if content is None or len(kept) == len(new.item):
        return new
    left_out = {RULE: len(new.item) - len(kept)}
    items = new.map.items
    return Part(
        new.name,
        dataclasses.replace(
            new.map,
            content=content,
            items=dataclasses.replace(
                items, place=items.place[kept], position=items.position[kept],
                heading_deg=items.heading_deg[kept], t_us=None if items.t_us is None else items.t_us[kept],
            ),
            info=new.map.info | {"left_out": left_out},
            learned=None,
            sums=None,
        ),
        new.item[kept],
    )  # fmt: skip


def useful(parts: Sequence[Part], new: Part) -> Bools:
    """(references,) whether each reference of one more drive ever wins."""
    touched = [np.flatnonzero(np.isin(part.item, new.item)) for part in parts]
    seen = [(part, chosen) for part, chosen in zip(parts, touched, strict=True) if len(chosen)]
    contents = [thinned(new.map.scorer, part.map.content, chosen) for part, chosen in seen]
    few = [content for content in contents if content is not None]
    if not few or len(few) < len(contents):
        return np.ones(len(new.item), np.bool_)
    own, *others = opened_together(new.map.scorer, [new.map.content, *few])
    return _winners(new, own, JoinedRows(others, [part.item[chosen] for part, chosen in seen]))


def _winners(new: Part, own: OpenScorer, known: JoinedRows) -> Bools:
    """(references,) which are better than what is known, for an image beside them, or cannot be judged."""
    rival = np.minimum(np.searchsorted(known.items, new.item), len(known.items) - 1)
    rivals = known.items[rival] == new.item
    wins, judged = np.zeros((2, len(new.item)), np.bool_)
    for at, beside in enumerate(_beside(new.map)):
        asked = beside[rivals[beside]]
        if not len(asked):
            continue
        image = new.map.images_of([at])
        assert image is not None
        likeness = own.rows(image)[0]
        likeness[at] = -np.inf
        if likeness.argmax() in beside:
            judged[asked] = True
            wins[asked] |= likeness[asked] > known.rows(image)[0][rival[asked]]
    return np.asarray(wins | ~judged, np.bool_)


def _beside(one: PlaceMap) -> list[Ints]:
    """The references just before and after each of a drive, where they lie near by."""
    steps = np.hypot(*np.diff(one.items.position, axis=0).T)
    usual = np.median(steps[steps > 0]) if (steps > 0).any() else np.inf
    near = np.concatenate([[False], ~(steps > BESIDE * usual), [False]])
    around = (np.array([at - 1, at + 1], np.int64) for at in range(len(one.items)))
    return [both[near[at : at + 2]] for at, both in enumerate(around)]
