"""Learn a street from one drive and find a later drive in it.

python examples/find_a_drive.py day.aedat4 day.nmea night.aedat4
"""

import sys

import evplace as ev


def main(day_file: str, day_track: str, night_file: str) -> None:
    """Print a line for each window of the later drive."""
    day = ev.open_traverse(day_file, track=day_track)
    assert day.track is not None
    street = ev.train(day, ev.PlaceGrid.from_track(day.track, cell_m=20), scorer="ncc")
    where = ev.Localizer(street, matcher="best")
    for events in ev.open_recording(night_file).packets():
        for match in where.push(events):
            print(match.t_us, match.place, f"{match.score:.3f}", match.state)


if __name__ == "__main__":
    main(*sys.argv[1:])
