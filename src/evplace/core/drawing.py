"""Figures to draw on: one look for all pictures, and one error where matplotlib is missing."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

from evplace.core.errors import MissingExtraError
from evplace.core.storage import new_file

DRAWN_BY = "evplace"
"""What a picture says of itself."""


def new_figure(width: float, height: float) -> Any:
    """An empty matplotlib figure of so many inches; MissingExtraError without matplotlib."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("matplotlib", "report", "drawing a picture") from error
    return Figure(figsize=(width, height), layout="constrained")


def check_drawing() -> None:
    """MissingExtraError where nothing can be drawn: for saying so before the work."""
    new_figure(1, 1)


def save(figure: Any, path: str | Path) -> None:
    """Write a figure as a .png, whole or not at all, without the upper and right edges of its axes.

    Its texts, which may be names of files, are drawn as they are: a $ begins no formula, and a letter that
    the font lacks is an empty box.
    """
    from matplotlib.text import Text

    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
    for text in figure.findobj(Text):
        text.set_parse_math(False)
    with new_file(path, overwrite=True) as partial, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from", UserWarning)
        figure.savefig(partial, dpi=120, metadata={"Software": DRAWN_BY})


def is_drawn_here(path: Path) -> bool:
    """Whether `save` wrote a file."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            return image.info.get("Software") == DRAWN_BY
    except (OSError, UnidentifiedImageError, ValueError, SyntaxError):
        return False
