"""What holds for every data set, and for folders that are none or several."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path

import pytest

import made_sets
from evplace.core import families
from evplace.core.errors import DatasetError, RecordingError, SettingsError
from evplace.drives.datasets import drives, matching, open_drive
from evplace.drives.to_traverse import open_source, open_traverse
from evplace.testing import check_dataset
from made_sets import write_gta, write_robotcar

MAKERS: dict[str, Callable[[Path], object]] = {
    name: getattr(made_sets, f"write_{name}") for name in families.names("datasets")
}
"""`made_sets` has a maker for each."""


@pytest.mark.parametrize("name", sorted(MAKERS))
def test_each_meets_the_contract(name: str) -> None:
    check_dataset(families.load("datasets", name), MAKERS[name])


@pytest.mark.parametrize("name", sorted(MAKERS))
def test_each_is_found_by_its_layout(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    MAKERS[name](folder)
    assert matching(folder) == [name]
    assert open_source(folder, drive=drives(folder)[0]).source.size[0] > 0


@pytest.mark.parametrize("name", sorted(MAKERS))
def test_each_says_where_it_comes_from(name: str) -> None:
    about = inspect.getdoc(families.load("datasets", name)) or ""
    for word in ("itation", "icence", "ddress", "ayout"):
        assert word in about


def test_folders_that_are_no_set_or_several(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="there is no folder"):
        open_drive(tmp_path / "none", "day")
    with pytest.raises(DatasetError, match=r"layout of no known data set: known are brisbane, .*utm_folders"):
        open_drive(tmp_path, "day")
    with pytest.raises(RecordingError, match="the folder is of no known recording format"):
        open_traverse(tmp_path)
    with pytest.raises(SettingsError, match="'brisbayne' is none of the datasets: known are brisbane"):
        open_drive(tmp_path, "day", "brisbayne")
    with pytest.raises(DatasetError, match="holds no drive of robotcar, which needs: DATE/stereo"):
        open_drive(tmp_path, "day", "robotcar")
    write_gta(tmp_path)
    write_robotcar(tmp_path)
    with pytest.raises(DatasetError, match="may be gta or robotcar: say which with `dataset`"):
        open_drive(tmp_path, "day")
    assert open_drive(tmp_path, "day", "gta").track is not None
    assert drives(tmp_path, "robotcar") == ["2014-12-09-13-21-02"]
