"""One pass: each part of a recording is shown to every examination."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

from evplace.core import families
from evplace.core.errors import DamagedRecordingError, InputError, TrackError
from evplace.core.events import Events, Size
from evplace.doctor import gps
from evplace.doctor._outcome import STATES, Examination, Finding, Outcome
from evplace.doctor._subject import Subject
from evplace.drives.to_traverse import on_its_day, open_source
from evplace.imaging.windows import WindowSettings
from evplace.sources.film import Film
from evplace.sources.simulators.motion import Frame
from evplace.sources.tracks import Track, open_track


class Check(Protocol):
    """One examination of one subject."""

    def see(self, part: Any) -> None:
        """The next events, or the next frame as (t_us, image)."""

    def outcome(self) -> Outcome:
        """What was found."""


def examine(
    path: str | Path,
    track: str | Path | Track | None = None,
    dt: str = "1/30",
    size: Size | None = None,
    time_unit: str | None = None,
    fps: float | None = None,
    drive: str | None = None,
    dataset: str | None = None,
    stream: str | None = None,
    columns: str | None = None,
) -> Examination:
    """Examine an event recording, a video, a folder of images or a drive of a data set, and its track.

    `dt` is the length of a window in seconds, as of `WindowSettings`; the others are as in `open_source`. A
    data set's drive has its own track, unless one is given. A damaged recording's good part is examined.
    InputError where something cannot be read, SettingsError for a `dt` of no length, an `fps` that cannot be
    or what has no meaning.
    """
    windows = WindowSettings(dt)
    given = open_track(track) if isinstance(track, str | Path) else track
    opened = open_source(path, size, time_unit, drive, dataset, fps=fps, stream=stream, columns=columns)
    positions, recording = _known(opened.track if given is None else given), opened.source
    positions = on_its_day(positions, recording)
    if isinstance(recording, Film):
        return _film(recording, windows, positions)
    return _examined(Subject(recording.path, "events", recording.size, windows, positions, recording))


def examine_log(path: str | Path, track: Track) -> Examination:
    """Examine a log of positions by itself; `track` is what it holds."""
    positions = _known(track)
    assert positions is not None  # a track has fixes, or it would have said so
    facts = {
        "kind": "fixes", "fixes": len(positions), "t_first_us": int(positions.t_us[0]),
        "t_last_us": int(positions.t_us[-1]), "dropped": positions.dropped,
    }  # fmt: skip
    findings = sorted(gps.of_track(positions), key=lambda finding: STATES.index(finding.state))
    return Examination(str(path), facts, tuple(findings), (), positions.fault)


def _known(track: Track | None) -> Track | None:
    """Only the fixes that have a position: a track that was asked at other times has some without."""
    if track is None or track.known.all():
        return track
    if not track.known.any():
        raise TrackError("no fix of the track has a position: give the log of this drive")
    per_fix = ("t_us", "latitude", "longitude", "easting", "northing", "heading_deg")
    return replace(track, **{name: getattr(track, name)[track.known] for name in per_fix})


def _film(film: Film, windows: WindowSettings, track: Track | None) -> Examination:
    return _examined(Subject(film.path, "frames", film.size, windows, track, timed=film.timed), film)


def _examined(subject: Subject, film: Film | None = None) -> Examination:
    checks: list[Check] = []
    for _, module in families.loadable("doctor"):
        with families.blaming("doctor", module):
            checks += [module.Check(subject)] if subject.kind in module.OF else []
    for part in _events(subject) if film is None else _frames(subject, film):
        for check in checks:
            with families.blaming("doctor", check):
                check.see(part)
    outcomes = [_outcome(check) for check in checks]
    findings: list[Finding] = [finding for outcome in outcomes for finding in outcome.findings]
    return Examination(
        str(subject.path),
        _facts(subject),
        tuple(sorted(findings, key=lambda finding: STATES.index(finding.state))),
        tuple(drawing for outcome in outcomes for drawing in outcome.drawings),
        subject.fault or (subject.track.fault if subject.track is not None else None),
    )


def _outcome(check: Check) -> Outcome:
    with families.blaming("doctor", check):
        return check.outcome()


def _events(subject: Subject) -> Iterator[Events]:
    """The good part's packets, each measured by the subject first."""
    assert subject.recording is not None
    try:
        for events in subject.recording.packets():
            if len(events):
                subject.see_events(events)
                yield events
    except DamagedRecordingError as error:
        subject.fault, subject.cause = str(error), error.__cause__ or error


def _frames(subject: Subject, film: Film) -> Iterator[tuple[int, Frame]]:
    """The frames up to one that cannot be decoded."""
    try:
        for t_us, frame in film:
            subject.see_frame(t_us)
            yield t_us, frame
    except InputError as error:
        if not subject.parts:
            raise
        subject.fault = str(error)


def _facts(subject: Subject) -> dict[str, Any]:
    recording = subject.recording
    facts: dict[str, Any] = {
        "kind": subject.kind,
        "width": subject.size[0],
        "height": subject.size[1],
        subject.kind: subject.parts,
        "t_first_us": subject.t_first_us if subject.parts else None,
        "t_last_us": subject.t_last_us if subject.parts else None,
    }
    if recording is None:
        return facts
    return facts | {"format": recording.format, "dropped": recording.dropped}
