from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from evplace.imaging.sheets import contact_sheet, write_film


@pytest.mark.parametrize(("events", "shade"), [(True, 225), (False, 30)])
def test_only_event_images_become_ink_on_paper(tmp_path: Path, events: bool, shade: int) -> None:
    contact_sheet(np.full((2, 10, 160), 30, np.uint8), tmp_path / "sheet.png", events=events)
    assert np.asarray(Image.open(tmp_path / "sheet.png"))[0, 0].tolist() == [shade] * 3


def test_a_short_last_row_leaves_room(tmp_path: Path) -> None:
    contact_sheet(np.zeros((5, 10, 160), np.uint8), tmp_path / "sheet.png", columns=3)
    sheet = np.asarray(Image.open(tmp_path / "sheet.png"))
    assert sheet.shape == (2 * 10 + 4, 3 * 160 + 2 * 4, 3)
    assert sheet[-1, -1].tolist() == [200] * 3
    assert sheet[-1, 0].tolist() == [255] * 3


def test_a_film_has_all_its_pictures(tmp_path: Path) -> None:
    pictures = [np.full((8, 12, 3), shade, np.uint8) for shade in (0, 120, 240)]
    for name in ("film.webp", "film.gif"):
        write_film(pictures, tmp_path / name, fps=10)
        with Image.open(tmp_path / name) as film:
            assert film.n_frames == 3  # type: ignore[attr-defined]
            film.seek(2)
            assert abs(int(np.asarray(film.convert("L"))[4, 6]) - 240) < 5
