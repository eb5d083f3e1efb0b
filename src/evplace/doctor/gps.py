"""The track: how many fixes, how good, where they are missing, and how much of the recording they cover."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.doctor._outcome import Finding, Outcome, State, counted
from evplace.doctor._subject import AtTheEnd, Subject, mean_around
from evplace.sources.tracks import Track
from evplace.sources.tracks._apart import apart

OF = ("events", "frames")

LEAP_M = 20.0
"""A shorter step is no jump: noise, or one cell of the map."""
AROUND = 5
"""Steps before and after by which a step is judged."""
DRIFTS = {
    "speed and course": "No slow drift: the positions go as the log's own speed and course say",
    "speed": "A slow drift to the side is not checked: that takes a speed and course of the log's own",
    "": "A slow drift is not checked: that takes a speed and course of the log's own",
}
"""What the positions were held against -> what is known of a drift."""
ADVICE = {
    "no fix": "keep the receiver in the open and wait for its fix before driving off",
    "repeated": "have the receiver hold no position while it moves (static navigation off), and in the open",
    "faster": "keep the aerial off walls, which reflect; `max_speed_mps` says how fast the vehicle goes",
    "against": "keep the aerial off walls, which reflect; take speed, course and position of one receiver",
    "of a clock": "have the clock set before the log begins, and by GPS time",
    "of the other side": "see on a map which side of the leap is right",
    "duplicate": "let one program alone write the log, each fix once",
}
"""Beginning of a reason why fixes were left out -> what to do."""
ELSE = "look at the lines shown: they are of no use as they are"


class Check(AtTheEnd):
    """Asks the track."""

    def outcome(self) -> Outcome:
        """Findings: GPS fixes, the log, gaps, jumps, coverage; none without a track."""
        track = self._subject.track
        if track is None:
            return Outcome()
        return Outcome([*of_track(track), _covered(self._subject, track)])


def of_track(track: Track) -> list[Finding]:
    """What a log says of itself, without a recording."""
    findings = [_quality(track), *_log(track)]
    return findings if len(track) < 2 else [*findings, _gaps(track), _jumps(track), _repeated(track)]


def _quality(track: Track) -> Finding:
    lost = sum(track.dropped.values())
    share = 100 * lost / (lost + len(track))
    seconds = (track.t_us[-1] - track.t_us[0]) / 1e6
    sentence = f"{counted(len(track), 'fix', 'fixes')} in {seconds:.1f} s"
    if len(track) < 2:
        advice = "give the log of the whole drive"
        return Finding("GPS fixes", "bad", share, "% unusable", f"{sentence}: that makes no track.", advice)
    drift = DRIFTS[track.held_against]
    if not lost:
        return Finding("GPS fixes", "good", 0.0, "% unusable", f"{sentence}; all can be used. {drift}.")
    reasons = ", ".join(f"{number:,} {reason}" for reason, number in track.dropped.items())
    state: State = "good" if share < 1 else "look" if share < 20 else "bad"
    most = max(track.dropped, key=lambda reason: track.dropped[reason])
    fit = next((ADVICE[begin] for begin in ADVICE if most.startswith(begin)), ELSE)
    advice = "" if state == "good" else fit
    return Finding(
        "GPS fixes", state, share, "% unusable", f"{sentence}; left out: {reasons}. {drift}.", advice
    )


def _log(track: Track) -> list[Finding]:
    """What was guessed, left out and broken off in the log, with its examples."""
    if track.fault is not None:
        sentence = ". ".join([f"The log is damaged: {track.fault}", *track.notes])
        advice = "copy the log anew: the track ends where it breaks off"
        return [Finding("GPS log", "bad", len(track.notes), "remarks", f"{sentence}.", advice)]
    if not track.notes:
        return []
    sentence = ". ".join(note[0].upper() + note[1:] for note in track.notes)
    return [Finding("GPS log", "look", len(track.notes), "remarks", f"{sentence}.", "see that this is so")]


def _gaps(track: Track) -> Finding:
    """Steps that `Track.at` does not bridge, as it itself says."""
    middles = (track.t_us[1:] + track.t_us[:-1]) // 2
    far = ~track.at(middles).known
    steps_s = np.diff(track.t_us) / 1e6
    share = 100 * float(steps_s[far].sum() / steps_s.sum())
    if not far.any():
        return Finding("GPS gaps", "good", 0.0, "%", "Positions are known from the first fix to the last.")
    state: State = "good" if share < 1 else "look" if share < 20 else "bad"
    return Finding(
        "GPS gaps", state, share, "%",
        f"{counted(int(far.sum()), 'step', 'steps')} from one fix to the next, {share:.1f} % of the track's "
        f"time, are over 1 s or 20 m: no position is known inside them (longest {steps_s.max():.1f} s, usual "
        f"{np.median(steps_s):.1f} s).",
        "" if state == "good" else "log at 5 Hz or more; images without a position are left out of the truth",
    )  # fmt: skip


def _jumps(track: Track) -> Finding:
    jump = jumps(track)
    if not jump.any():
        return Finding("GPS jumps", "good", 0, "jumps", "The track has no jump.")
    steps = np.hypot(np.diff(track.easting), np.diff(track.northing))
    worst = int(np.argmax(np.where(jump, steps, 0)))
    return Finding(
        "GPS jumps", "look" if jump.mean() < 0.01 else "bad", int(jump.sum()), "jumps",
        f"{counted(int(jump.sum()), 'step is', 'steps are')} far longer than those around; the longest is "
        f"{steps[worst]:,.0f} m in {(track.t_us[worst + 1] - track.t_us[worst]) / 1e6:.1f} s.",
        "take these fixes out of the log, or smooth it",
    )  # fmt: skip


def jumps(track: Track) -> NDArray[np.bool_]:
    """(N - 1,) which steps are over LEAP_M and more than three times as fast, by 10 m/s, as those around."""
    metres = np.hypot(np.diff(track.easting), np.diff(track.northing))
    mps = metres / np.diff(track.t_us) * 1e6
    padded = np.pad(mps, AROUND, constant_values=np.nan)
    around = np.nanmedian(np.lib.stride_tricks.sliding_window_view(padded, 2 * AROUND + 1), axis=1)
    return np.asarray((metres > LEAP_M) & (mps > 3 * around + 10), np.bool_)


def _repeated(track: Track) -> Finding:
    """A receiver slower than its log repeats its positions: the track moves in steps."""
    same = (np.diff(track.easting) == 0) & (np.diff(track.northing) == 0)
    moves = mean_around(~same, AROUND) * (2 * AROUND + 1) >= 2
    share = 100 * float(np.mean(same & moves))
    sentence = f"{share:.1f} % of the fixes repeat the position before them while the track moves."
    if share < 20:
        return Finding("GPS repeats", "good", share, "%", sentence)
    return Finding("GPS repeats", "look", share, "%", sentence, "keep only the fixes that are new")


def _covered(subject: Subject, track: Track) -> Finding:
    """Asked every tenth of a second, as long as the recording runs."""
    t_us, _ = subject.smooth_activity()
    if not len(t_us):
        return Finding(
            "GPS coverage", "unknown", None, "%", "Cannot be determined: the recording holds nothing."
        )
    share = 100 * float(track.at(t_us).known.mean())
    if track.t_us[-1] < subject.t_first_us or track.t_us[0] > subject.t_last_us:
        why = apart(track, subject.t_first_us, subject.t_last_us)
        sentence = why.sentence[0].upper() + why.sentence[1:]
        return Finding("GPS coverage", "bad", 0.0, "%", f"{sentence}.", why.advice)
    state: State = "good" if share >= 95 else "look" if share >= 50 else "bad"
    sentence = f"{share:.1f} % of the recording has a position."
    advice = "" if state == "good" else "images without a position are left out of the truth: see GPS gaps"
    return Finding("GPS coverage", state, share, "%", sentence, advice)
