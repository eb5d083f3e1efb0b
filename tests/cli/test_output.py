"""What the command line makes of the library's texts."""

from __future__ import annotations

import pytest

from evplace.cli._output import in_flags


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
