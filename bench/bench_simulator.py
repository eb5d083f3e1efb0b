"""Frames to events against eventify-dvs and eventcv: python bench/bench_simulator.py

320x240, 8 bits, one core; each simulates the same 200 frames, without noise, in alternation.
"""

from __future__ import annotations

import itertools

import cv2
import eventcv
import numpy as np
from eventify.dvs import frame_to_event_tuples
from numpy.typing import NDArray

from evplace.sources.simulators.esim import SensorSettings, Simulator
from harness import alternate, report

FRAMES, STEP_US = 200, 4000
AS_MANY = 0.085
"""eventify-dvs forgets what is left of a change at each frame; with this threshold it gives about as many."""
CLEAN = SensorSettings(threshold_spread=0.0, noise_hz=0.0, log_eps=1 / 255)


def film() -> NDArray[np.uint8]:
    """A blurred random pattern that moves by half a pixel a frame."""
    rng = np.random.default_rng(0)
    blocks = np.kron(rng.integers(0, 256, (40, 60)), np.ones((8, 8))).astype(np.uint8)
    wide = cv2.GaussianBlur(blocks, (0, 0), 2)
    moves = (np.float32([[1, 0, -k / 2], [0, 1, -k / 8]]) for k in range(FRAMES))
    return np.array([cv2.warpAffine(wide, move, (320, 240)) for move in moves])


def main() -> None:
    cv2.setNumThreads(1)
    frames = film()

    def ours() -> int:
        sensor = Simulator((320, 240), CLEAN)
        return sum(len(sensor.push(frame, k * STEP_US)) for k, frame in enumerate(frames))

    def eventify(threshold: float) -> int:
        pairs = enumerate(itertools.pairwise(frames))
        times = ((k * STEP_US, (k + 1) * STEP_US, a, b) for k, (a, b) in pairs)
        return sum(len(frame_to_event_tuples(a, b, t0, t1, c_thresh=threshold)) for t0, t1, a, b in times)

    def cv() -> int:
        clean = {"sigma_thres": 0.0, "leak_rate_hz": 0.0, "shot_noise_rate_hz": 0.0}
        return len(eventcv.simulate(frames, fps=1e6 / STEP_US, **clean))

    functions = {
        "evplace": ours,
        "eventify-dvs, same threshold": lambda: eventify(0.2),
        "eventify-dvs, as many events": lambda: eventify(AS_MANY),
        "eventcv.simulate": cv,
    }
    print({name: function() for name, function in functions.items()}, "events")
    timings = alternate(functions)
    report(f"{FRAMES} frames of 320x240, CPU time a frame", timings, FRAMES / 1e3, "ms")


if __name__ == "__main__":
    main()
