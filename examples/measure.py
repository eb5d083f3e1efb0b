"""Measure how well a map finds a drive, for two matchers.

python examples/measure.py street.evp night
"""

import sys

import evplace as ev


def main(map_folder: str, query_folder: str) -> None:
    """Print accuracy and average precision."""
    street, night = ev.PlaceMap.load(map_folder), ev.Traverse.load(query_folder)
    for matcher in ("best", "hmm"):
        figures = ev.evaluate(ev.Localizer(street, matcher), night).figures
        print(
            matcher,
            f"accuracy {figures['accuracy']:.3f}, average precision {figures['average_precision']:.3f}",
        )


if __name__ == "__main__":
    main(*sys.argv[1:])
