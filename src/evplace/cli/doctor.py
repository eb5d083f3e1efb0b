"""Examine a recording, a video, a folder of images or a GPS log: what is wrong with it, and what to do.

Examples:
  evplace doctor night.aedat4
  evplace doctor night.aedat4 --track night.nmea --dt 1/60      also the track and the two clocks
  evplace doctor night.aedat4 --report night.doctor             a folder of pictures and findings.json
  evplace doctor drive.mp4                                      are there enough frames to simulate from?
  evplace doctor brisbane/ --drive sunset1                      with its GPS
  evplace doctor night.aedat4 --json                            one object: facts, findings, fault
  evplace doctor night.nmea                                     a GPS log by itself
  evplace doctor night.aedat4 --strict                          exit code 2 where anything is bad: for scripts

States: bad costs results; look may; unknown cannot be told from this recording; good needs nothing. Advice
names flags of `evplace images`.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import tyro

from evplace.cli._output import USED_GOOD_PART, in_flags, note, print_json, say
from evplace.cli._recording import RecordingFlags
from evplace.cli._settings import a_part_of
from evplace.cli._track import TrackFlags
from evplace.core.errors import TrackError
from evplace.doctor import STATES, Examination, Finding, as_json, check_drawing, draw, examine, examine_log
from evplace.sources.film import is_video
from evplace.sources.readers import is_recording
from evplace.sources.tracks import Track, open_track

WIDTH = 110
"""Columns of the text."""
WORDS = {"bad": "bad", "look": "to look at", "unknown": "unknown", "good": "good"}
"""State -> how the summary counts it."""


@dataclass(frozen=True)
class Args(TrackFlags, RecordingFlags):
    """Flags of `evplace doctor`."""

    recording: tyro.conf.Positional[Path]
    """An event recording, a video, a folder of images, a data set's folder, or a GPS log."""
    dt: str = "1/30"
    """Length of a window in seconds, as a fraction or a decimal."""
    fps: float | None = None
    """For a folder of images without timestamps.txt: images a second, 30 unless given."""
    drive: str | None = None
    """For a data set: which drive."""
    dataset: Annotated[str | None, a_part_of("datasets")] = None
    """For a data set that is not recognised by its layout: its name."""
    report: Path | None = None
    """Also write a folder of pictures and findings.json."""
    overwrite: bool = False
    """Replace the report if it exists."""
    strict: bool = False
    """End with exit code 2 where a finding is bad."""
    json: bool = False
    """Print one JSON object."""


def run(args: Args) -> int:
    """Examine, print, and draw if asked."""
    if args.report is not None:
        check_drawing(args.report, args.overwrite)
    log = _log(args)
    found = _examined(args) if log is None else examine_log(args.recording, log)
    found = replace(found, findings=tuple(map(_with_flags, found.findings)))
    if args.report is not None:
        draw(found, args.report, args.overwrite)
    if args.json:
        print_json(as_json(found))
    else:
        say(*_lines(found))
    if found.fault is not None:
        note(f"{found.fault}; the good part was examined")
    if args.strict and found.count("bad"):
        return 2
    return USED_GOOD_PART if found.fault is not None else 0


def _log(args: Args) -> Track | None:
    """The log of positions that is given by itself; None for anything else."""
    path = args.recording
    if args.track is not None or not path.is_file() or is_video(path) or is_recording(path):
        return None
    try:
        return open_track(path)
    except TrackError:
        return None


def _examined(args: Args) -> Examination:
    return examine(
        args.recording,
        args.opened_track(),
        args.dt,
        args.size,
        args.time_unit,
        args.fps,
        args.drive,
        args.dataset,
        args.stream,
        args.columns,
    )


def _with_flags(finding: Finding) -> Finding:
    """A finding whose texts name flags."""
    return replace(finding, sentence=in_flags(finding.sentence), advice=in_flags(finding.advice))


def _lines(found: Examination) -> list[str]:
    """The summary, then each finding, the worst first."""
    numbers = [(found.count(state), WORDS[state]) for state in STATES]
    counts = [f"{number} {word}" for number, word in numbers if number]
    facts = found.facts
    kind = facts["kind"]
    of_sensor = f"{facts['width']} x {facts['height']}, " if "width" in facts else ""
    what = f"{of_sensor}{facts[kind]:,} {kind}"
    if facts["t_first_us"] is not None:
        what += f", {(facts['t_last_us'] - facts['t_first_us']) / 1e6:.3f} s"
    lines = [f"{found.path}: {', '.join(counts)}", f"  {what}", ""]
    width = max(len(finding.name) for finding in found.findings)
    return lines + [line for finding in found.findings for line in _told(finding, width)]


def _told(finding: Finding, width: int) -> list[str]:
    head = f"  {finding.state:<7}  {finding.name:<{width}}  "
    indent = " " * len(head)
    lines = _wrapped(in_flags(finding.sentence), head, indent)
    if finding.advice:
        lines += _wrapped(f"-> {finding.advice}", indent, indent + "   ")
    return lines


def _wrapped(text: str, first: str, other: str) -> list[str]:
    """Lines of a text; flags are not broken at their hyphens."""
    return textwrap.wrap(text, WIDTH, initial_indent=first, subsequent_indent=other, break_on_hyphens=False)
