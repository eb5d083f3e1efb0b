"""Hot pixels on the virtual city's night drive: what they cost, and what `--mask-hot` gives back.

    evplace city -o city --conditions day night --paths 1 --sensors ideal --keep-events
    python bench/hot_pixels.py --city city --seeds 3

The map is day-1, the query night-1, both made from the events of the sensor `ideal`, three windows of
1/30 s after one another of which one is kept. To the night's events, 0.5 % of the pixels are added that
fire by themselves, at random places and times, at rates that are log-uniform from 10 to 1000 Hz. Accuracy
in %, global-max, by the paper's rule, of the blurred correlation and of the network (preset paper, mean
and standard deviation over the seeds).
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from evplace.core.events import Events, Size
from evplace.drives.to_traverse import open_source, record
from evplace.evaluation._evaluate import evaluate
from evplace.imaging.traverse import Traverse, new_traverse
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid
from evplace.sources.cleaning import CleaningSettings
from evplace.sources.readers import open_recording
from evplace.sources.writers import write_recording

SHARE = 0.005
"""Of the pixels are hot."""
RATES_HZ = (10.0, 1000.0)
EVERY = 3
"""One window in so many is kept, as the city keeps ten images a second."""
SEED = 0


@dataclass(frozen=True)
class HotPixels:
    """Pixels that fire by themselves."""

    x: np.ndarray
    y: np.ndarray
    rate_hz: np.ndarray

    @classmethod
    def drawn(cls, size: Size, seed: int) -> HotPixels:
        rng = np.random.default_rng(seed)
        at = rng.choice(size[0] * size[1], round(SHARE * size[0] * size[1]), replace=False)
        rates = np.exp(rng.uniform(*np.log(RATES_HZ), len(at)))
        return cls(at % size[0], at // size[0], rates)

    def added_to(self, packets: Iterator[Events], seed: int) -> Iterator[Events]:
        """The packets, each with what the hot pixels send within its time."""
        rng, start_us = np.random.default_rng(seed), None
        for events in packets:
            first = int(events.t_us[0]) if start_us is None else start_us
            start_us = int(events.t_us[-1])
            counts = rng.poisson(self.rate_hz * (start_us - first) / 1e6)
            n = int(counts.sum())
            pixels = rng.permutation(np.repeat(np.arange(len(self.x)), counts))
            own = Events.of(
                np.sort(rng.uniform(first, start_us, n).astype(np.int64)), self.x[pixels], self.y[pixels],
                rng.random(n) < 0.5, events.size,
            )  # fmt: skip
            both = Events.concatenate([events, own])
            order = np.argsort(both.t_us, kind="stable")
            yield Events(both.t_us[order], both.x[order], both.y[order], both.p[order], both.size)


def images(recording: Path, drive: Path, folder: Path, mask_hot: bool) -> Traverse:
    """The event images of a recording, with the positions of the city's own traverse of it."""
    with new_traverse(folder, {}) as writer:
        cleaning = CleaningSettings(mask_hot=mask_hot)
        record(open_source(recording), writer, Traverse.load(drive).track, cleaning=cleaning)
    return Traverse.load(folder)[::EVERY]


def queries(city: Path, folder: Path) -> dict[str, Traverse]:
    """The night's images: as it was, and with hot pixels, each as it is and cleaned."""
    night, drive = city / "night-1" / "ideal.aedat4", city / "night-1" / "ideal"
    recording = open_recording(night)
    hot = HotPixels.drawn(recording.size, SEED)
    noisy = folder / "noisy.aedat4"
    total = write_recording(noisy, hot.added_to(recording.packets(), SEED + 1), recording.size)
    clean = recording.events or 0
    print(f"{clean:,} events; {len(hot.x)} hot pixels send {total - clean:,} more", flush=True)
    made = {
        "clean": images(night, drive, folder / "clean", False),
        "clean, --mask-hot": images(night, drive, folder / "clean-masked", True),
        "hot pixels": images(noisy, drive, folder / "hot", False),
        "hot pixels, --mask-hot": images(noisy, drive, folder / "hot-masked", True),
    }
    truth = np.zeros(recording.size[::-1], np.bool_)
    truth[hot.y, hot.x] = True
    for name, traverse in made.items():
        if traverse.mask is not None:
            found = int((traverse.mask & truth).sum())
            print(f"{name}: {int(traverse.mask.sum())} pixels masked, {found} of them among those drawn")
    noisy.unlink()
    return made


def accuracies(place_map: PlaceMap, made: dict[str, Traverse]) -> list[float]:
    """In %, in the order of the queries."""
    where = Localizer(place_map, "best")
    return [100 * float(evaluate(where, query).figures["accuracy"]) for query in made.values()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--city", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=3)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="evplace-hot-") as name:
        folder, city = Path(name), arguments.city
        day = images(city / "day-1" / "ideal.aedat4", city / "day-1" / "ideal", folder / "day", False)
        made = queries(city, folder)
        assert day.track is not None
        places = PlaceGrid.from_track(day.track)
        plain = accuracies(train(day, places, "ncc"), made)
        for query, accuracy in zip(made, plain, strict=True):
            print(f"correlation  {query:<24} {accuracy:5.1f}", flush=True)
        trained = np.array(
            [
                accuracies(train(day, places, preset="paper", seed=seed), made)
                for seed in range(arguments.seeds)
            ]
        )
    for query, column in zip(made, trained.T, strict=True):
        spread = np.std(column, ddof=1) if len(column) > 1 else float("nan")
        print(f"network      {query:<24} {np.mean(column):5.1f} +- {spread:.1f}   {np.round(column, 1)}")


if __name__ == "__main__":
    main()
