"""The pictures of a film: the pair, what is said of it, and the route that grows."""

from __future__ import annotations

import dataclasses

import numpy as np
from made_results import make_result, make_unanswered
from numpy.typing import NDArray

from evplace.evaluation import Result
from evplace.evaluation.charts import OUTCOME_COLOURS
from evplace.imaging.sheets import Picture
from evplace_lab.report._film import CAPTION, ROUTE_HIGH, film

IMAGES = np.zeros((60, 12, 16), np.uint8)
"""Of a camera: black."""


def pictures(result: Result, images: NDArray[np.uint8] = IMAGES, frames: int = 60) -> list[Picture]:
    return list(film(result, images, lambda items: IMAGES[items], frames))


def inked(picture: Picture, colour: str) -> int:
    """Pixels of exactly this colour."""
    wanted = np.array([int(colour[at : at + 2], 16) for at in (1, 3, 5)])
    return int((picture == wanted).all(axis=2).sum())


def test_a_picture_is_a_pair_over_a_route() -> None:
    (picture, *others) = pictures(make_result(), frames=5)
    assert len(others) == 4
    assert picture.shape == (CAPTION + 240 + ROUTE_HIGH, 2 * 320 + 4, 3)  # 16 x 12 pixels, 20 times as large
    assert {other.shape for other in others} == {picture.shape}


def test_the_route_grows_in_the_colours_of_what_became_of_each_image() -> None:
    result = make_result()
    routes = [picture[-ROUTE_HIGH:] for picture in pictures(result)]
    for kind, name in enumerate(("right", "wrong", "missed")):
        first = int(np.flatnonzero(result.outcome == kind)[0])
        assert inked(routes[-1], OUTCOME_COLOURS[name]), name
        assert first == 0 or not inked(routes[first - 1], OUTCOME_COLOURS[name]), name


def test_what_was_rejected_is_pale_and_what_has_no_match_is_empty() -> None:
    result = make_result()
    accepted = pictures(result)[int(np.flatnonzero(result.answers.accepted)[0])]
    rejected = pictures(result)[int(np.flatnonzero(~result.answers.accepted)[0])]
    none = dataclasses.replace(result, answers=result.answers._replace(item=np.full(60, -1)))
    shades = [picture[CAPTION + 120, 500].tolist() for picture in (accepted, rejected, pictures(none)[0])]
    assert shades == [[0] * 3, [170] * 3, [255] * 3]


def test_without_positions_the_pair_stands_alone() -> None:
    result = dataclasses.replace(make_result(), query_xy=None)
    assert pictures(result)[0].shape[0] == CAPTION + 240


def test_large_images_are_made_small_and_narrow_ones_stand_in_the_middle() -> None:
    large = np.zeros((60, 500, 800), np.uint8)
    (picture,) = film(make_result(), large, lambda items: large[items], 1)
    assert picture.shape == (CAPTION + 200 + ROUTE_HIGH, 2 * 320 + 4, 3)
    narrow = np.zeros((60, 24, 7), np.uint8)
    (picture,) = film(make_result(), narrow, lambda items: narrow[items], 1)
    assert picture.shape == (CAPTION + 240 + ROUTE_HIGH, 2 * 320 + 4, 3)
    assert [picture[CAPTION + 100, x, 0] for x in (100, 160, 220)] == [255, 0, 255]


def test_a_drive_without_any_answer_and_without_length() -> None:
    result = make_unanswered()
    assert result.query_xy is not None
    standing = dataclasses.replace(result, query_xy=np.zeros_like(result.query_xy), item_xy=np.zeros((2, 2)))
    for one in (result, standing):
        assert len(pictures(one, IMAGES[:6])) == 6
