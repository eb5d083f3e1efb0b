"""The default on a small car indoors, by day and in the dark: made halls that no training has seen, as film.

    python bench/best_halls.py [--halls 6]

Each hall is driven around twice, at two speeds and a little aside: the map by daylight, the query by its
lamps. The camera is an ordinary one: 20 frames a second of 8 bits, as JPEG; events are simulated between
them. Right is within 6 % of the lap, by chance 12 %. The halls are our own and drawn by the same recipe as
those of the descriptor's training, from other seeds: a real hall may be harder.
"""

from __future__ import annotations

import argparse

import numpy as np

from evplace import Localizer, PlaceMap, PlaceRuns, Traverse, evaluate, train
from evplace.evaluation.truth import Truth, by_matrix
from evplace.imaging.images import Imager, ImageSettings
from evplace.localizer import Answers
from evplace.sources.simulators.esim import PRESETS, Simulator
from evplace_lab.city.camera import ColourCamera, grey
from evplace_lab.descriptor.cameras import Camera, Carrying
from evplace_lab.descriptor.halls import Hall, HallFilm, build_hall
from evplace_lab.descriptor.sensors import _compressed

SEEDS = 77
FRAME_US = 50_000
WITHIN = 0.06
CAMERA = Camera((160, 120), 75.0, 0.2, 0.0, 0.0, 0.05, 1)
CARS = {"day": Carrying(1.0, 0.0, 0.0, 0.02), "dark": Carrying(1.4, 0.08, 0.03, 0.02)}
QUALITY = 80


def drive(hall: Hall, name: str, seed: int) -> tuple[Traverse, np.ndarray]:
    """One lap: its images, and the share of the lap (n,) at each."""
    rng = np.random.default_rng([SEEDS, seed, name == "dark"])
    film, car = HallFilm(hall, name == "dark", CAMERA.size, CAMERA.field_deg, rng), CARS[name]
    colour, simulator = ColourCamera([seed, 3]), Simulator(CAMERA.size, PRESETS["from-8bit"], seed)
    imager = Imager(CAMERA.size, ImageSettings(crop_bottom=0.0))
    frames = int(hall.length_m / car.speed * 1e6 / FRAME_US)
    images, times, begins = [], [], rng.uniform(0, 1) if name == "dark" else 0.0
    ways = begins * hall.length_m + car.speed * np.arange(frames) * FRAME_US * 1e-6
    turned = np.zeros(3)
    for number, way in enumerate(ways):
        turned = 0.9 * turned + rng.normal(0, car.shake * 0.2, 3)
        light = film.seen_from(car.pose(film.pose_at(float(way)), CAMERA, turned))
        colour.expose(light, number * FRAME_US)
        imager.add(simulator.push(_compressed(grey(colour.noisy_picture(light)), QUALITY), number * FRAME_US))
        if number:
            images.append(imager.image(number * FRAME_US))
            times.append(number * FRAME_US)
    counts = np.array([int(image.any()) for image in images], np.int64)
    return Traverse(np.stack(images), np.array(times), counts), ways[1:] / hall.length_m % 1.0


def truth_of(query: np.ndarray, reference: np.ndarray) -> Truth:
    """By shares of the lap."""
    apart = np.abs((query[:, None] - reference + 0.5) % 1.0 - 0.5)
    return by_matrix(apart <= WITHIN, len(query), len(reference), "queries")


def figures(place_map: PlaceMap, query: Traverse, truth: Truth) -> list[float]:
    """Right in %: single images, live, in hindsight."""
    always = Localizer(place_map, "bayes", threshold=-1.0)
    asked: list[tuple[Localizer, Answers]] = [
        (Localizer(place_map, "best"), "live"),
        (always, "live"),
        (always, "hindsight"),
    ]
    return [
        100 * evaluate(where, query, truth, answers=answers).figures["accuracy_seen"]
        for where, answers in asked
    ]


def main() -> None:
    """Print a line for each hall and scorer, and the means."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("--halls", type=int, default=6)
    args = flags.parse_args()
    found: dict[str, list[list[float]]] = {}
    print("hall, scorer: single images, live, hindsight, % right")
    for seed in range(args.halls):
        hall = build_hall(np.random.default_rng([SEEDS, seed]))
        (reference, at), (query, where) = (drive(hall, name, seed) for name in CARS)
        for scorer in ("ncc", "edges", "trained", "fused"):
            place_map = train(reference, PlaceRuns(len(reference)), scorer)
            kept = place_map.items.t_us
            assert kept is not None
            truth = truth_of(where, at[np.searchsorted(reference.t_us, kept)])
            shown = figures(place_map, query, truth)
            found.setdefault(scorer, []).append(shown)
            words = " ".join(f"{one:.1f}" for one in shown)
            print(f"{seed} ({hall.length_m:.0f} m), {scorer}: {words}", flush=True)
    for scorer, rows in found.items():
        means, spread = np.mean(rows, axis=0), np.std(rows, axis=0)
        print(f"mean, {scorer}: " + ", ".join(f"{a:.1f}±{b:.1f}" for a, b in zip(means, spread, strict=True)))


if __name__ == "__main__":
    main()
