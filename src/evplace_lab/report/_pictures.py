"""Images of samples as PNG inside the page, within a budget."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from evplace.evaluation import Result
from evplace.imaging.sheets import Picture, as_shown

BUDGET = 12_000_000
"""Characters of all images in a page."""
LEVELS = {"grey": 16, "colours": 128, "matrix": 32}
"""Shades that a shown image keeps: enough for the eye, and half the size or less."""

Shown = list[tuple[int, list[str]]]
"""A query and its three images (query, matched, true) as data URIs; empty text where there is none."""


def sample_images(results: Mapping[str, Result], budget: int = BUDGET) -> dict[str, Shown]:
    """The samples of each result that has any; where all are more than `budget`, as many of each as fit."""
    shown = {name: _of(result) for name, result in results.items() if result.samples is not None}
    size = sum(len(source) for samples in shown.values() for _, sources in samples for source in sources)
    if size <= budget:
        return shown
    share = budget / size
    return {name: _evenly(samples, max(1, int(share * len(samples)))) for name, samples in shown.items()}


def _of(result: Result) -> Shown:
    samples = result.samples
    assert samples is not None
    true_item = np.full(len(result.judged), 0) if result.true_item is None else result.true_item
    events = are_events(result)
    shown = []
    for query, images in zip(samples.query.tolist(), samples.images, strict=True):
        there = (True, result.answers.item[query] >= 0, true_item[query] >= 0)
        shown.append(
            (
                query,
                [_source(image, events) if some else "" for image, some in zip(images, there, strict=True)],
            )
        )
    return shown


def _evenly(samples: Shown, many: int) -> Shown:
    return [samples[at] for at in np.linspace(0, len(samples) - 1, many).astype(int)] if samples else []


def are_events(result: Result) -> bool:
    """Whether the map was made of event images."""
    of_map = result.settings.get("map")
    recipe = of_map.get("recipe") if isinstance(of_map, Mapping) else None
    return isinstance(recipe, Mapping) and recipe.get("kind") == "events"


def similarity_image(result: Result) -> str:
    """A result's similarities as a plot has them, queries to the right and items upwards; empty without."""
    if result.similarity is None:
        return ""
    return _png(255 - result.similarity.T[::-1], LEVELS["matrix"])


def _source(image: NDArray[np.uint8], events: bool) -> str:
    """An image (h, w) or (h, w, C) as the address of a PNG that holds itself."""
    shown = for_the_eye(image, events)
    grey = bool(np.all(shown == shown[..., :1]))
    return _png(shown[..., 0] if grey else shown, LEVELS["grey" if grey else "colours"])


def for_the_eye(image: NDArray[np.uint8], events: bool) -> Picture:
    """An image (h, w) or (h, w, C) as it is shown, however few its events are."""
    return as_shown(_stretched(image) if events else image, events)


def _stretched(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """An event image whose strongest pixel is full: few events of many counts are seen, too."""
    strongest = int(image.max(initial=0))
    return image if strongest in (0, 255) else (image.astype(np.uint16) * 255 // strongest).astype(np.uint8)


def _png(shown: NDArray[np.uint8], levels: int) -> str:
    """An image (h, w) or (h, w, 3) as an address."""
    from PIL import Image

    picture = Image.fromarray(np.ascontiguousarray(shown))
    file = io.BytesIO()
    # Pillow's median cut takes 20 times as long for a difference that is not seen at this size.
    picture.quantize(levels, None if shown.ndim == 2 else Image.Quantize.FASTOCTREE).save(file, "PNG")
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode("ascii")
