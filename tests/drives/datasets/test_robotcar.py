from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from evplace.core.errors import DatasetError, TrackError, TraverseError
from evplace.drives.datasets import drives, open_drive
from evplace.drives.datasets.robotcar import demosaiced
from evplace.drives.to_traverse import open_traverse
from evplace.sources.film import Film
from made_sets import picture, write_robotcar


def test_bayer_blocks_become_pixels() -> None:
    raw = np.array([[10, 3], [200, 21]], np.uint8)  # G B over R G
    assert demosaiced(raw).tolist() == [[[200, 16, 3]]]
    for odd in ((3, 4), (4, 3)):
        with pytest.raises(TraverseError, match="even sides"):
            demosaiced(np.zeros(odd, np.uint8))
    with pytest.raises(TraverseError, match="one channel"):
        demosaiced(np.zeros((4, 4, 3), np.uint8))


def test_images_times_and_positions(tmp_path: Path) -> None:
    place = write_robotcar(tmp_path)
    assert drives(tmp_path) == drives(place) == ["2014-12-09-13-21-02"]
    drive = open_drive(tmp_path)
    assert isinstance(drive.source, Film)
    assert drive.source.size == (32, 24)
    assert drive.recipe.windows.dt == "1/16"
    times = [t_us for t_us, _ in drive.source]
    assert (times[0], times[-1], len(times)) == (1_418_132_504_537_582, 1_418_132_505_037_582, 9)
    assert drive.track is not None
    assert drive.track.heading_deg[0] == pytest.approx(np.rad2deg(1.5))


def test_the_default_is_simulated_events_and_colours_if_asked(tmp_path: Path) -> None:
    write_robotcar(tmp_path, log="gps")
    events = open_traverse(tmp_path, drive="2014-12-09-13-21-02")
    assert events.recipe.kind == "events"
    assert events.recipe.windows.dt == "1/16"
    assert events.info["simulated"]["log_eps"] == 0.02
    assert events.images.ndim == 3
    assert events.counts.sum() > 0
    assert events.track is not None
    assert events.track.known.any()
    colours = open_traverse(tmp_path, kind="frames")
    assert (colours.recipe.kind, colours.images.shape) == ("frames", (9, 90, 160, 3))
    assert open_traverse(tmp_path, kind="events").recipe.kind == "events"


def test_times_and_images_must_fit(tmp_path: Path) -> None:
    place = write_robotcar(tmp_path)
    images = place / "stereo" / "centre"
    lost = images / "1418132504600082.png"
    lost.unlink()
    with pytest.raises(TraverseError, match=r"lists 1 images that are missing, first 1418132504600082\.png"):
        open_drive(tmp_path)
    Image.fromarray(picture(0)).save(lost)
    Image.fromarray(picture(0)).save(images / "1418132504600083.png")
    with pytest.raises(TraverseError, match=r"1 images are not in .*stereo.timestamps"):
        open_drive(tmp_path)
    (images / "1418132504600083.png").rename(images / "first.png")
    with pytest.raises(TraverseError, match=r"first\.png has no time"):
        open_drive(tmp_path)
    (images / "first.png").unlink()
    (place / "stereo.timestamps").write_text("now 1\n")
    with pytest.raises(TraverseError, match="lines of microseconds and chunk"):
        open_drive(tmp_path)
    (place / "stereo.timestamps").unlink()
    with pytest.raises(DatasetError, match="times of the images are missing"):
        open_drive(tmp_path)


def test_what_is_missing_or_broken_is_named(tmp_path: Path) -> None:
    place = write_robotcar(tmp_path)
    log = place / "gps" / "ins.csv"
    log.write_text(log.read_text().replace("51.76", "nan"))
    with pytest.raises(TrackError, match="no usable fix"):
        open_drive(tmp_path)
    log.unlink()
    with pytest.raises(DatasetError, match=r"positions are missing: .* neither ins.csv nor gps.csv"):
        open_drive(tmp_path)
    first = next((place / "stereo" / "centre").iterdir())
    Image.fromarray(picture(0, (63, 48))).save(min((place / "stereo" / "centre").iterdir()))
    with pytest.raises(TraverseError, match=r"\.png: a Bayer image .* even sides"):
        open_drive(tmp_path)
    for file in first.parent.iterdir():
        file.unlink()
    with pytest.raises(DatasetError, match="holds no images"):
        open_drive(tmp_path)
