"""What the command line makes of the library's texts."""

from __future__ import annotations

import pytest

from evplace.cli._output import in_flags, print_facts, print_table, say

EVIL = "a\nb\x1b[2J[/]\udcff"
"""As a file may be called."""


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("leave out `size` and `time_unit`", "leave out --size and --time-unit"),
        ("`fps=30` or `dt=1/30`; `every_m=1`", "--fps 30 or --dt 1/30; --every-m 1"),
        ("`mask_hot=True`, `blur=False`", "--mask-hot, --no-blur"),
        ("`listing` and `offset_us`", "--list and --track-offset"),
        ("`offset_us=-36000000000` or `keep=before`", "--track-offset -36000 or --track-keep before"),
        ("`offset_us=1500000`, `date`", "--track-offset 1.5, --track-date"),
        ("`open_track(time_unit=ms)`", "--track-set time_unit=ms"),
        ("`evplace list datasets` says; the setting 'dt'", "`evplace list datasets` says; the setting 'dt'"),
        ("day`s.npz, night`s.npz", "day`s.npz, night`s.npz"),
    ],
)
def test_arguments_are_shown_as_flags(text: str, shown: str) -> None:
    assert in_flags(text) == shown


def test_names_move_no_cursor_and_break_no_line(capsys: pytest.CaptureFixture[str]) -> None:
    say(EVIL, "next")
    print_facts(EVIL, {"file": EVIL})
    lines = capsys.readouterr().out.splitlines()
    escaped = "a\\nb\\x1b[2J[/]\\udcff"
    assert lines == [escaped, "next", escaped, f"  file  {escaped}"]


def test_names_in_a_table_are_no_marks(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(EVIL, [EVIL, "figure"], [[EVIL, 1.0]])
    lines = capsys.readouterr().out.splitlines()
    assert len([line for line in lines if "a\\nb\\x1b[2J[/]\\udcff" in line]) == 3
