"""Small fake data sets, each in the layout of the real one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evplace.core.events import Events
from evplace.sources.writers import write_recording

Floats = NDArray[np.float64]
WGS84 = (6_378_137.0, 0.0066943799901413165)
SAN_FRANCISCO = "@0544388.51@4172758.25@10@S@037.70098@-122.49646@kPnABhWJ1kA61eMNPLs1vQ@@210@@@@201606"
INS_HEADER = (
    "timestamp,ins_status,latitude,longitude,altitude,northing,easting,down,utm_zone,"
    "velocity_north,velocity_east,velocity_down,roll,pitch,yaw"
)
GPS_HEADER = (
    "timestamp,num_satellites,latitude,longitude,altitude,latitude_sigma,longitude_sigma,altitude_sigma,"
    "northing,easting,down,utm_zone"
)


def some_events(start_us: int, seconds: float = 3.0, count: int = 3000) -> Events:
    """Events at random pixels of 60 x 40, evenly in time."""
    size = (60, 40)
    rng = np.random.default_rng(5)
    t_us = start_us + np.linspace(0, seconds * 1e6, count).astype(np.int64)
    x, y = rng.integers(0, size[0], count), rng.integers(0, size[1], count)
    return Events.of(t_us, x, y, rng.random(count) < 0.5, size)


def write_h5(path: Path, events: Events, names: str = "t x y p", **about: Any) -> Path:
    """Events as four rows of the group `events`, times in ns; `about` are its attributes."""
    import h5py

    path.parent.mkdir(parents=True, exist_ok=True)
    with h5py.File(path, "w") as file:
        rows = (events.t_us * 1000, events.x, events.y, events.p.astype(np.uint8))
        for name, row in zip(names.split(), rows, strict=True):
            file[f"events/{name}"] = row
        file["events"].attrs.update(about)
    return path


def sentence(body: str) -> str:
    """An NMEA sentence with its checksum."""
    checksum = 0
    for letter in body:
        checksum ^= ord(letter)
    return f"${body}*{checksum:02X}\n"


def write_nmea(path: Path, seconds: list[int], without_fix: int = 0, south: float = 27.5) -> Path:
    """RMC sentences at 07:00:00 UTC plus `seconds`, driving east; before them `without_fix` void ones."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [sentence(f"GPRMC,{70000 + n:06}.00,V,,,,,,,210420,,,N") for n in range(without_fix)]
    for n in seconds:
        minutes = 90 + n * 0.006
        lines.append(
            sentence(
                f"GPRMC,{70000 + n:06}.00,A,{south * 100 - south * 100 % 100 + 30:09.4f},S,"
                f"{15200 + minutes - 60:010.4f},E,020.0,090.0,210420,,,A"
            )
        )
    path.write_text("".join(lines))
    return path


def write_brisbane(folder: Path, name: str = "sunset1", stem: str = "dvs_vpr_2020-04-21-17-03-03") -> Events:
    """HDF5, hot pixels and the log of the dash camera, which has no fix in its first two seconds."""
    folder.mkdir(parents=True, exist_ok=True)
    events = some_events(1_587_452_582_350_000 + 2_000_000)
    write_h5(folder / f"{stem}.hdf5", events)
    write_nmea(folder / f"20200421_170039-{name}_concat.nmea", [2, 3, 4, 5, 6], without_fix=2)
    (folder / f"{stem}_hot_pixels.txt").write_text("3,4\n59,39\n")
    return events


def ecef(latitude: Floats, longitude: Floats, height: float = 0.0) -> Floats:
    """(n, 3) metres from the centre of the Earth."""
    radius, squared = WGS84
    across = radius / np.sqrt(1 - squared * np.sin(np.deg2rad(latitude)) ** 2)
    flat = (across + height) * np.cos(np.deg2rad(latitude))
    x, y = flat * np.cos(np.deg2rad(longitude)), flat * np.sin(np.deg2rad(longitude))
    return np.column_stack([x, y, (across * (1 - squared) + height) * np.sin(np.deg2rad(latitude))])


def write_nsavp(folder: Path, name: str = "R0_FA0") -> Events:
    """Events and poses."""
    import h5py

    events = some_events(1_690_000_000_000_000)
    names = "timestamps x_coordinates y_coordinates polarities"
    write_h5(folder / f"{name}_dvxplorer_left.h5", events, names, width=640, height=480)
    with h5py.File(folder / f"{name}_applanix.h5", "w") as file:
        t_us = events.t_us[0] + np.arange(0, 4_000_000, 5000)
        longitude = -83.7 + np.arange(len(t_us)) * 1e-6
        file["pose_base_link/positions"] = ecef(np.full(len(t_us), 42.3), longitude, 250.0)
        file["pose_base_link/quaternions"] = np.zeros((len(t_us), 4))
        file["pose_base_link/timestamps"] = (t_us * 1000).astype(np.uint64)
    return events


def picture(shift: float, size: tuple[int, int] = (64, 48)) -> NDArray[np.uint8]:
    """(h, w) waves that slide by `shift` pixels."""
    y, x = np.mgrid[: size[1], : size[0]]
    return (128 + 100 * np.sin((x + shift) / 6.0) * np.cos(y / 9.0)).astype(np.uint8)


def write_robotcar(folder: Path, log: str = "ins", images: int = 9) -> Path:
    """Raw Bayer images of chunk 1 (chunk 2 is not there), their times and the log."""
    place = folder / "2014-12-09-13-21-02"
    (place / "stereo" / "centre").mkdir(parents=True)
    (place / "gps").mkdir()
    times = [1_418_132_504_537_582 + 62_500 * n for n in range(images)]
    for n, t_us in enumerate(times):
        Image.fromarray(picture(0.5 * n)).save(place / "stereo" / "centre" / f"{t_us}.png")
    lines = [f"{t} 1\n" for t in times] + [f"{times[-1] + 62_500} 2\n"]
    (place / "stereo.timestamps").write_text("".join(lines))
    rows = []
    for n in range(40):
        t_us, longitude = times[0] - 100_000 + 20_000 * n, -1.26 + n * 2e-6
        rows.append(
            f"{t_us},INS_SOLUTION_GOOD,51.76,{longitude},110,5735000,620000,-110,30U,0,10,0,0.0,0.0,1.5"
            if log == "ins"
            else f"{t_us},7,51.76,{longitude},110,5,5,5,5735000,620000,-110,30U"
        )
    header = INS_HEADER if log == "ins" else GPS_HEADER
    (place / "gps" / f"{log}.csv").write_text("\n".join([header, *rows]) + "\n")
    return place


def write_gta(folder: Path, name: str = "day", images: int = 6) -> Path:
    """Images and poses, as the capturing tool numbers them."""
    place = folder / name
    (place / "images").mkdir(parents=True)
    lines = []
    for n in range(images):
        image = Image.fromarray(np.stack([picture(0.4 * n)] * 3, axis=-1))
        image.save(place / "images" / f"{n}.jpg", quality=98)
        lines.append(f"dataset/images/{n}.jpg {-100 + 0.2 * n:.6f} 50.000000 30.000000 0.1 0.0 -90.000000\n")
    (place / "6dpose_list.txt").write_text("".join(lines))
    return place


def write_lens(folder: Path, name: str = "sunset1", images: int = 5) -> Path:
    """A list and count images of 7 x 7 pixels."""
    place = folder / "brisevent" / "davis346" / name
    place.mkdir(parents=True)
    for n in range(images):
        Image.fromarray(np.full((7, 7), n, np.uint8)).save(place / f"images_{n:05}.png")
    rows = "".join(f"images_{n:05}.png,{n}\n" for n in range(images))
    (folder / f"{name}.csv").write_text("Image_name,index\n" + rows)
    return place


def caer_packet(events: Events, camera_us: NDArray[np.int64], overflow: int = 0) -> tuple[bytes, bytes]:
    """Header and data of a packet of polarity events; the first event is marked as not valid."""
    import struct

    words = np.zeros((len(events), 2), "<u4")
    x, y, p = (field.astype("u4") for field in (events.x, events.y, events.p))
    words[:, 0] = (x << 17) | (y << 2) | (p << 1) | 1
    words[0, 0] &= ~np.uint32(1)
    words[:, 1] = camera_us
    header = struct.pack("<hhiiiiii", 1, 1, 8, 4, overflow, len(events), len(events), len(events) - 1)
    return header, words.tobytes()


def write_ddd20(folder: Path, name: str = "rec1499023756") -> Events:
    """Two packets of events between which the camera's clock was reset, a frame, and rows never written."""
    import h5py

    events = some_events(1_499_023_756_000_000)
    half = len(events) // 2
    halves = [events[:half], events[half:]]
    clocks = [halves[0].t_us - events.t_us[0] + 9_000_000, halves[1].t_us - halves[1].t_us[0] + 50]
    folder.mkdir(parents=True, exist_ok=True)
    with h5py.File(folder / f"{name}.hdf5", "w") as file:
        data = file.create_dataset("dvs/data", (6, 3), h5py.special_dtype(vlen=np.uint8))
        times = np.zeros(6, np.int64)
        frame = (caer_packet(events[:2], np.arange(2))[0].replace(b"\x01\x00", b"\x02\x00", 1), b"\0" * 44)
        rows = [caer_packet(halves[0], clocks[0]), frame, caer_packet(halves[1], clocks[1])]
        received = [int(halves[0].t_us[-1]), int(halves[0].t_us[-1]) + 10, int(halves[1].t_us[-1])]
        for n, ((header, body), t_us) in enumerate(zip(rows, received, strict=True)):
            data[n, 0] = np.frombuffer(str(t_us).encode(), np.uint8)
            data[n, 1], data[n, 2] = np.frombuffer(header, np.uint8), np.frombuffer(body, np.uint8)
            times[n] = t_us
        file["dvs/timestamp"] = times
        fixes = events.t_us[0] + np.arange(8) * 500_000
        for what, degrees, late in (("latitude", 40.0, 100), ("longitude", -105.0, 0)):
            values = np.zeros((12, 2))
            values[:8] = np.column_stack([fixes + late, degrees + np.arange(8) * 5e-5])
            file[f"{what}/data"] = values
            file[f"{what}/timestamp"] = np.concatenate([fixes + late, np.zeros(4, np.int64)])
    return events


def write_qcr_event(folder: Path, stamp: str = "2021-08-19-08-25-42") -> Events:
    """Events of 20 s in HDF5."""
    folder.mkdir(parents=True, exist_ok=True)
    events = some_events(1_629_325_542_000_000, seconds=20.0)
    write_h5(folder / f"{stamp}.hdf5", events)
    return events


def write_own(folder: Path, names: tuple[str, ...] = ("day", "night")) -> Events:
    """A recording and a csv log a drive."""
    folder.mkdir(parents=True, exist_ok=True)
    events = some_events(1_700_000_000_000_000)
    for name in names:
        write_recording(folder / f"{name}.npz", [events], events.size)
        rows = [f"{events.t_us[0] + n * 500_000},48.0,{11 + n * 6e-5}" for n in range(8)]
        (folder / f"{name}.csv").write_text("timestamp,latitude,longitude\n" + "\n".join(rows) + "\n")
    return events


def write_utm(folder: Path, name: str, fields: list[str]) -> Path:
    """An image for each of the name's beginnings, as @0544388.51@4172758.25@10@S."""
    place = folder / name
    place.mkdir(parents=True, exist_ok=True)
    for n, beginning in enumerate(fields):
        missing = 16 - len(beginning.split("@"))
        file = place / f"{beginning}{'@' * missing}.jpg"
        Image.fromarray(np.full((12, 16), 20 * n, np.uint8)).save(file)
    return place


def write_utm_folders(folder: Path) -> Path:
    """One image of the map."""
    return write_utm(folder, "database", [SAN_FRANCISCO])
