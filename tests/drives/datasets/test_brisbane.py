from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evplace.core.errors import DatasetError
from evplace.drives.datasets import drives, open_drive
from evplace.drives.to_traverse import open_traverse
from evplace.sources.readers import Recording
from made_sets import some_events, write_brisbane


def test_a_drive_has_events_track_and_hot_pixels(tmp_path: Path) -> None:
    events = write_brisbane(tmp_path)
    drive = open_drive(tmp_path, "sunset1")
    assert isinstance(drive.source, Recording)
    assert drive.source.size == (346, 260)
    first = next(iter(drive.source.packets()))
    assert first.t_us[0] == events.t_us[0]
    # The log's first sentence, two seconds before its first fix, is the start of the dash camera's film.
    assert drive.track is not None
    assert drive.track.t_us[0] == 1_587_452_584_350_000
    assert (drive.track.zone, drive.track.northern) == (56, False)
    assert drive.mask == tmp_path / "dvs_vpr_2020-04-21-17-03-03_hot_pixels.txt"


def test_images_are_placed_and_hot_pixels_left_out(tmp_path: Path) -> None:
    write_brisbane(tmp_path / "sunset1")
    found = open_traverse(tmp_path, drive="sunset1")
    assert found.track is not None
    assert found.track.known.all()
    assert found.mask is not None
    assert found.mask[[4, 39], [3, 59]].all()
    assert found.mask.sum() == 2


def test_parquet_counts_microseconds(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow", reason="needs the extra 'parquet'")
    write_brisbane(tmp_path)
    (tmp_path / "dvs_vpr_2020-04-21-17-03-03.hdf5").unlink()
    events = some_events(1_587_452_584_350_000)
    columns = {"t": events.t_us, "x": events.x, "y": events.y, "p": events.p}
    file = tmp_path / "dvs_vpr_2020-04-21-17-03-03_no_hot_pixels_nobursts_denoised.parquet"
    __import__("pyarrow.parquet").parquet.write_table(pyarrow.table(columns), file)
    drive = open_drive(tmp_path)
    assert isinstance(drive.source, Recording)
    assert np.array_equal(next(iter(drive.source.packets())).t_us, events.t_us)


def test_the_drives_that_are_there(tmp_path: Path) -> None:
    write_brisbane(tmp_path)
    write_brisbane(tmp_path, "night", "dvs_vpr_2020-04-27-18-13-29")
    assert drives(tmp_path) == ["sunset1", "night"]
    with pytest.raises(DatasetError, match="holds no drive 'sunrise': it holds sunset1, night"):
        open_drive(tmp_path, "sunrise")
    with pytest.raises(DatasetError, match="2 drives: say which with `drive`: sunset1, night"):
        open_drive(tmp_path)


def test_a_missing_log_is_named(tmp_path: Path) -> None:
    write_brisbane(tmp_path)
    next(tmp_path.glob("*.nmea")).unlink()
    with pytest.raises(DatasetError, match=r"GPS log of sunset1 is missing: .* \*-sunset1\*\.nmea"):
        open_drive(tmp_path)
