"""Pictures: one look, whole files, and one line where nothing can be drawn."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from evplace.core.drawing import check_drawing, is_drawn_here, new_figure, save
from evplace.core.errors import MissingExtraError


@pytest.mark.parametrize("missing", ["matplotlib", "matplotlib.figure"])
def test_a_missing_matplotlib_is_one_line(missing: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(MissingExtraError, match=r"pip install 'evplace\[report\]'"):
        check_drawing()


def test_a_figure_has_its_inches_and_no_frame(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="pictures need the extra 'report'")
    from PIL import Image

    figure = new_figure(5, 3)
    axes = figure.subplots(1, 2)
    save(figure, tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as image:
        assert image.size == (600, 360)
    for one in axes:
        assert [one.spines[side].get_visible() for side in ("top", "right", "left")] == [False, False, True]
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


def test_a_picture_that_could_not_be_drawn_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib", reason="pictures need the extra 'report'")
    (tmp_path / "a.png").write_text("old")
    figure = new_figure(1, 1)
    monkeypatch.setattr(figure, "savefig", lambda *_, **__: int("nothing"))
    with pytest.raises(ValueError, match="nothing"):
        save(figure, tmp_path / "a.png")
    assert (tmp_path / "a.png").read_text() == "old"


@pytest.mark.filterwarnings("error")
def test_names_are_drawn_as_they_are(tmp_path: Path) -> None:
    """A $ begins no formula, which could be a wrong one, and what the font lacks is no warning."""
    figure = new_figure(3, 2)
    figure.add_subplot().set_title("a$\\frac$b\x1b日")
    save(figure, tmp_path / "x.png")
    assert is_drawn_here(tmp_path / "x.png")
