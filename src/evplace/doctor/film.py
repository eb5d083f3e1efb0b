"""A video or a folder of images: whether frames come often and evenly enough to simulate events from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.doctor._outcome import Curve, Finding, Outcome, State, counted
from evplace.doctor._subject import Subject
from evplace.sources.simulators.motion import TOO_FAST, Frame, image_motion

OF = ("frames",)


SLOWEST_FPS, FASTEST_FPS = 0.1, 10_000.0
"""Frames a second beyond which the times must be in another unit."""


class Check:
    """Measures the motion from each frame to the next."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        self._before: Frame | None = None
        self._t_us: list[int] = []
        self._pixels: list[float] = []
        self._same = self._odd = 0

    def see(self, part: tuple[int, Frame]) -> None:
        """Compare the next frame with the one before."""
        t_us, frame = part
        if self._before is not None and self._before.shape == frame.shape:
            motion = image_motion(self._before, frame)
            span_us = t_us - self._t_us[-1]
            self._pixels.append(motion)
            self._subject.motion.append((self._t_us[-1] + span_us // 2, motion / max(span_us, 1) * 1e6))
            self._same += int(motion == 0.0 and np.array_equal(self._before, frame))
        elif self._before is not None:
            self._odd += 1
        self._before = frame
        self._t_us.append(t_us)

    def outcome(self) -> Outcome:
        """Findings: frames, frame times, repeated frames, image motion; the motion as a curve."""
        pixels = np.array(self._pixels)
        if not len(pixels):
            sentence = "Fewer than two frames of one size: no events can come of them."
            return Outcome(
                [Finding("frames", "bad", len(self._t_us), "frames", sentence, "give the whole film")]
            )
        times = np.array(self._t_us, np.int64)
        steps = times[1:] - times[:-1]
        fps = 1e6 / float(np.median(steps))
        findings = [
            _sizes(self._odd, len(self._t_us)),
            _times(steps, fps, self._subject.timed),
            _repeated(self._same, len(pixels)),
            _motion(pixels, fps),
        ]
        t_us = np.array([t_us for t_us, _ in self._subject.motion], np.int64)
        curve = Curve(
            "motion", "Motion of the image", "time in s", "pixels from one frame to the next",
            self._subject.seconds(t_us), pixels,
        )  # fmt: skip
        return Outcome(findings, [curve])


def _sizes(odd: int, frames: int) -> Finding:
    if not odd:
        return Finding("frames", "good", frames, "frames", "All frames are of one size.")
    sentence = f"The size of the frames changes {counted(odd, 'time', 'times')}: no sensor does that."
    return Finding("frames", "bad", frames, "frames", sentence, "bring all frames to one size")


def _times(steps: NDArray[np.int64], fps: float, timed: bool) -> Finding:
    late = int(np.sum(steps > 1.5 * np.median(steps)))
    sentence = f"{len(steps) + 1:,} frames, {fps:.1f} a second; {counted(late, 'comes', 'come')} late."
    if not timed:
        return Finding(
            "frame times", "look", fps, "frames/s", f"{sentence} It has no times: the rate is that of `fps`.",
            "put timestamps.txt (seconds, one a line) beside the images",
        )  # fmt: skip
    if not SLOWEST_FPS <= fps <= FASTEST_FPS:
        sentence = f"{len(steps) + 1:,} frames, {fps:.3g} a second: no camera does that."
        return Finding("frame times", "bad", fps, "frames/s", sentence, "are the times in seconds?")
    state: State = "good" if not late else "look" if late < 0.01 * len(steps) else "bad"
    advice = "" if state == "good" else "frames are missing: the motion across a hole is guessed"
    return Finding("frame times", state, fps, "frames/s", sentence, advice)


def _repeated(same: int, pairs: int) -> Finding:
    share = 100 * same / pairs
    sentence = f"{same:,} of {pairs + 1:,} frames equal the one before them."
    if share < 1:
        return Finding("repeated frames", "good", share, "%", sentence)
    advice = "take the film at its own rate: repeated frames make bursts of events"
    return Finding("repeated frames", "look" if share < 20 else "bad", share, "%", sentence, advice)


def _motion(pixels: NDArray[np.float64], fps: float) -> Finding:
    usual, most = float(np.median(pixels)), float(np.percentile(pixels, 95))
    fast = 100 * float(np.mean(pixels > TOO_FAST))
    sentence = (
        f"The image moves by {usual:.2f} pixels from one frame to the next, 95 % by less than {most:.2f}; "
        f"{fast:.1f} % of the steps are over {TOO_FAST:g} pixel, where events are guessed."
    )
    state: State = "good" if fast < 1 else "look" if fast < 10 else "bad"
    advice = f"give about {fps * most / TOO_FAST:.0f} frames a second or more (record so, or interpolate)"
    return Finding("image motion", state, most, "pixels", sentence, "" if state == "good" else advice)
