from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from evplace.imaging.sheets import contact_sheet


@pytest.mark.parametrize(("events", "shade"), [(True, 225), (False, 30)])
def test_only_event_images_become_ink_on_paper(tmp_path: Path, events: bool, shade: int) -> None:
    contact_sheet(np.full((2, 10, 160), 30, np.uint8), tmp_path / "sheet.png", events=events)
    assert np.asarray(Image.open(tmp_path / "sheet.png"))[0, 0].tolist() == [shade] * 3
