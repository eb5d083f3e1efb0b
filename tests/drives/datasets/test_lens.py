from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evplace.core.errors import DatasetError, TraverseError
from evplace.drives.datasets import drives, open_drive
from evplace.drives.to_traverse import open_traverse
from made_sets import write_lens


def test_count_images_are_kept_as_they_are(tmp_path: Path) -> None:
    write_lens(tmp_path)
    write_lens(tmp_path, "sunset2", images=3)
    assert drives(tmp_path) == ["sunset1", "sunset2"]
    found = open_traverse(tmp_path, drive="sunset1")
    assert found.recipe.kind == "frames"
    assert found.images.shape == (5, 7, 7)
    assert found.images[:, 3, 3].tolist() == [0, 1, 2, 3, 4]
    assert found.t_us.tolist() == [0, 1_000_000, 2_000_000, 3_000_000, 4_000_000]
    assert found.track is None


def test_lists_and_images_must_fit(tmp_path: Path) -> None:
    place = write_lens(tmp_path)
    (place / "images_00002.png").unlink()
    with pytest.raises(TraverseError, match=r"names 1 images that .* lacks, first images_00002.png"):
        open_drive(tmp_path)
    for file in place.iterdir():
        file.unlink()
    with pytest.raises(DatasetError, match="images of sunset1 are missing"):
        open_drive(tmp_path)


def test_the_real_files(data: Path) -> None:
    folder = data / "traverses" / "lens"
    assert drives(folder) == ["example-query", "example-reference", "sunset1", "sunset2"]
    reference = open_traverse(folder, drive="example-reference")
    assert reference.images.shape == (100, 80, 80)
    assert len(open_traverse(folder, drive="sunset2")) == 641
    assert np.load(folder / "brisevent" / "davis346" / "sunset2_sunset1_GT.npy").shape == (724, 641)
