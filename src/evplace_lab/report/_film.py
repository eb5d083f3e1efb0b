"""A drive as a film: what the camera sees beside what it is taken for, and where on the route that is."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from evplace.evaluation import OUTCOMES, ItemImages, Result
from evplace.evaluation.charts import OUTCOME_COLOURS, OUTCOME_WORDS
from evplace.imaging.sheets import Picture, stacked
from evplace_lab.report._pictures import are_events, for_the_eye

FPS = 10
WIDEST, HIGHEST = 320, 240
"""Pixels of an image in the film, at most."""
CAPTION, LETTERS = 22, 15
"""Pixels of the line over an image, and of its letters."""
ROUTE_HIGH, MARGIN, FINER = 200, 14, 2
"""Pixels of the route and of its margin; it is drawn so much larger and then made small, which is smooth."""
INK, FAINT, NOT_JUDGED = "#1a1a1a", "#dcdcdc", "#9a9a9a"


def film(result: Result, images: NDArray[np.uint8], of_items: ItemImages, frames: int) -> Iterator[Picture]:
    """At most so many pictures of the drive, evenly chosen from its `images` (queries, ...).

    Without positions in the result the pair stands alone.
    """
    chosen = np.linspace(0, len(images) - 1, min(frames, len(images))).astype(np.int64)
    route = None
    for query in chosen:
        pair = _pair(result, images[query], of_items, int(query))
        if result.query_xy is not None and result.item_xy is not None:
            route = route or _Route(result, pair.shape[1])
            pair = np.concatenate([pair, route.at(int(query))])
        yield pair


def _pair(result: Result, image: NDArray[np.uint8], of_items: ItemImages, query: int) -> Picture:
    """A query beside its match, each with a line over it; what was rejected is pale."""
    events, item = are_events(result), int(result.answers.item[query])
    seen = _sized(for_the_eye(image, events))
    matched = np.full_like(seen, 255)
    if item >= 0:
        matched = _sized(for_the_eye(of_items(np.array([item]))[0], events))
        if not result.answers.accepted[query]:
            matched = 255 - (255 - matched) // 3
    words, colour = _said(result, query)
    columns = [
        (_caption(f"query {_clock(result, query)}", INK), seen),
        (_caption(words, colour), matched),
    ]
    return stacked([[np.concatenate(column) for column in columns]])


def _sized(shown: Picture) -> Picture:
    """In the middle of WIDEST pixels, as large as fits; small ones by whole steps: pixels stay square."""
    height, width = shown.shape[:2]
    if width > WIDEST or height > HIGHEST:
        picture = Image.fromarray(shown)
        picture.thumbnail((WIDEST, HIGHEST), Image.Resampling.BOX)
        fitting = np.asarray(picture)
    else:
        zoom = min(WIDEST // width, HIGHEST // height)
        fitting = shown.repeat(zoom, axis=0).repeat(zoom, axis=1)
    left = WIDEST - fitting.shape[1]
    return np.pad(fitting, ((0, 0), (left // 2, left - left // 2), (0, 0)), constant_values=255)


def _said(result: Result, query: int) -> tuple[str, str]:
    """What became of a query, in words and as a colour."""
    kind = int(result.outcome[query])
    words = "not judged" if kind < 0 else OUTCOME_WORDS[OUTCOMES[kind]]
    if result.answers.item[query] < 0:
        words = f"none: {words}"
    elif result.answers.accepted[query] and np.isfinite(off := result.error_m[query]):
        words = f"{words}, {off:.0f} m off"
    return f"match: {words}", _colour(kind)


def _colour(kind: int) -> str:
    return NOT_JUDGED if kind < 0 else OUTCOME_COLOURS[OUTCOMES[kind]]


def _clock(result: Result, query: int) -> str:
    """Minutes and seconds since the drive began; its number where its time is not known."""
    if result.t_us[query] < 0:
        return str(query)
    minutes, seconds = divmod(int(result.t_us[query] - result.t_us[0]) // 1_000_000, 60)
    return f"at {minutes}:{seconds:02}"


def _caption(words: str, colour: str) -> Picture:
    line = Image.new("RGB", (WIDEST, CAPTION), "white")
    ImageDraw.Draw(line).text((2, 2), words, colour, ImageFont.load_default(LETTERS))
    return np.asarray(line)


class _Route:
    """The route from above, north up, which grows as the drive goes on."""

    def __init__(self, result: Result, width: int) -> None:
        """The map's items alone, `width` pixels wide."""
        assert result.query_xy is not None
        assert result.item_xy is not None  # whoever calls has looked
        self._result, self._done = result, 0
        self._size = (width * FINER, ROUTE_HIGH * FINER)
        self._here, self._there = self._pixels(result.query_xy, result.item_xy)
        self._drawn = Image.new("RGB", self._size, "white")
        for point in self._there:
            self._dot(self._drawn, point, 5, FAINT)
        self._scale()

    def at(self, query: int) -> Picture:
        """What was driven up to a query, where that is, and a line to where it is taken to be."""
        for number in range(self._done, query + 1):
            self._dot(self._drawn, self._here[number], 2, _colour(int(self._result.outcome[number])))
        self._done = query + 1
        picture = self._drawn.copy()
        item = int(self._result.answers.item[query])
        if item >= 0 and self._result.answers.accepted[query]:
            ends = np.array([self._here[query], self._there[item]])
            if np.isfinite(ends).all():
                ImageDraw.Draw(picture).line(ends.ravel().tolist(), INK, 2 * FINER)
            self._dot(picture, self._there[item], 5, _said(self._result, query)[1])
        self._dot(picture, self._here[query], 6, None)
        small = picture.resize((self._size[0] // FINER, self._size[1] // FINER), Image.Resampling.BOX)
        return np.asarray(small)

    def _pixels(self, *metres: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Positions (n, 2) in pixels of the picture, all by one scale."""
        everything = np.concatenate(metres)
        low, high = np.nanmin(everything, axis=0), np.nanmax(everything, axis=0)
        space = np.array(self._size) - 2 * MARGIN * FINER
        self._per_m = float((space / np.maximum(high - low, 1.0)).min())
        middle, flip = (low + high) / 2, np.array([1.0, -1.0])
        return [(xy - middle) * self._per_m * flip + np.array(self._size) / 2 for xy in metres]

    def _scale(self) -> None:
        """A bar of a round number of metres, at most a fifth of the picture, in the lower right corner."""
        most = self._size[0] / 5 / self._per_m
        metres = 10.0 ** np.floor(np.log10(most))
        metres *= max(step for step in (1, 2, 5) if step * metres <= most)
        x, y = (length - MARGIN * FINER for length in self._size)
        draw, letters = ImageDraw.Draw(self._drawn), ImageFont.load_default(LETTERS * FINER)
        draw.line((x - metres * self._per_m, y, x, y), INK, 2 * FINER)
        draw.text((x, y - 2 * FINER), f"{metres:g} m", INK, letters, anchor="rb")

    def _dot(self, picture: Image.Image, at: NDArray[np.float64], radius: int, colour: str | None) -> None:
        """A dot, or a ring without a colour; nothing where the position is not known."""
        if not np.isfinite(at).all():
            return
        low, high = at - radius * FINER, at + radius * FINER
        outline = INK if colour is None else None
        ImageDraw.Draw(picture).ellipse((*low.tolist(), *high.tolist()), colour, outline, 2 * FINER)
