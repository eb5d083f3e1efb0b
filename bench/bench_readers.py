"""Reading: each format's decoder against another one's, and long recordings to images in little memory.

    python bench/bench_readers.py [--only aedat4 evt3 ...]                decoding, format by format
    python bench/bench_readers.py --images [RECORDING ...] [--million 200]      decoding and images

Files are generated in a temporary folder, which goes afterwards. Each reader gives arrays of t, x, y and p;
ours also checks every event's place and time. faery and ours stream, aedat gives a packet at a time,
eventcv, evt3, numpy, pyarrow and h5py fill the memory. Opening the file is part of the time; of HDF5 and
Parquet, where a child process decodes, its start and its work are too, and the files are larger. With
--images, the given recordings and a generated DAT file of so many million events become event images of
1/30 s, in a process of its own, whose peak memory is shown.
"""

from __future__ import annotations

import argparse
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from evplace.core.events import Events, Size
from evplace.sources.readers import open_recording
from evplace.sources.writers import write_recording
from harness import Timing, alternate

SIZE: Size = (640, 480)
EVENTS = 8_000_000
MANY = {"hdf5": 32_000_000, "parquet": 32_000_000}
"""Events in files whose reading begins with the start of processes."""
PACKET = 200_000
"""Events made at a time."""
RATE = 20e6
"""Events a second of the generated recordings."""


def generated(count: int, size: Size, seed: int = 0) -> Iterator[Events]:
    """Packets of edges that sweep over the sensor, one event in ten anywhere."""
    rng = np.random.default_rng(seed)
    for start in range(0, count, PACKET):
        n = min(PACKET, count - start)
        t_us = ((start + np.arange(n)) / RATE * 1e6).astype(np.int64)
        edge = rng.integers(0, 12, n)
        x = (edge * 97 + t_us // 700 + rng.integers(0, 3, n)) % size[0]
        noise = rng.random(n) < 0.1
        x[noise] = rng.integers(0, size[0], int(noise.sum()))
        y = np.sort(rng.integers(0, size[1], (-(-n // 40), 40)), axis=1).ravel()[:n]
        yield Events.of(t_us, x, y, edge % 2 == 0, size)


# Files: one of each format.


def by_faery(name: str, **options: Any) -> Callable[[Path, Events], Path]:
    def write(folder: Path, events: Events) -> Path:
        import faery

        array = np.zeros(len(events), faery.events_stream.EVENTS_DTYPE)
        array["t"], array["x"], array["y"], array["p"] = events.t_us, events.x, events.y, events.p
        parts = [array[start : start + 8192] for start in range(0, len(array), 8192)]
        faery.file_encoder.events_to_file(parts, folder / name, events.size, zero_t0=False, **options)
        return folder / name

    return write


def by_ours(name: str) -> Callable[[Path, Events], Path]:
    def write(folder: Path, events: Events) -> Path:
        write_recording(folder / name, [events], events.size)
        return folder / name

    return write


def aedat2(folder: Path, events: Events) -> Path:
    small = events.x < 346
    keep = small & (events.y < 260)
    x, y, t_us, p = (field[keep] for field in (events.x, events.y, events.t_us, events.p))
    address = (
        (259 - y.astype(np.uint32)) << 22 | (345 - x.astype(np.uint32)) << 12 | p.astype(np.uint32) << 11
    )
    words = np.stack([address, t_us.astype(np.uint32)], 1).astype(">u4")
    path = folder / "two.aedat"
    head = b"#!AER-DAT2.0\r\n# AEChip: eu.seebetter.ini.chips.davis.Davis346blue\r\n# End Of ASCII Header\r\n"
    path.write_bytes(head + words.tobytes())
    return path


def aedat3(folder: Path, events: Events) -> Path:
    pixel = events.x.astype("<u4") << 17 | events.y.astype("<u4") << 2 | events.p.astype("<u4") << 1 | 1
    words = np.stack([pixel, events.t_us.astype("<u4")], 1)
    path = folder / "three.aedat"
    with path.open("wb") as file:
        file.write(b"#!AER-DAT3.1\r\n#Format: RAW\r\n#Source 1: DAVIS640\r\n#!END-HEADER\r\n")
        for start in range(0, len(words), 4096):
            part = words[start : start + 4096]
            file.write(struct.pack("<hhiiiiii", 1, 1, 8, 4, 0, len(part), len(part), len(part)))
            file.write(part.tobytes())
    return path


def evt21(folder: Path, events: Events) -> Path:
    """A word an event, and one with the high bits of the time where these change."""
    t, x, y, p = (field.astype(np.uint64) for field in (events.t_us, events.x, events.y, events.p))
    words = p << np.uint64(60) | (t & np.uint64(63)) << np.uint64(54) | (x & ~np.uint64(31)) << np.uint64(43)
    words |= y << np.uint64(32) | np.uint64(1) << (x & np.uint64(31))
    at = np.flatnonzero(np.diff(t >> np.uint64(6), prepend=np.uint64(1 << 40)))
    high = np.uint64(8) << np.uint64(60) | t[at] >> np.uint64(6) << np.uint64(32)
    path = folder / "twentyone.raw"
    head = (
        f"% evt 2.1\n% format EVT21;height={SIZE[1]};width={SIZE[0]}\n% geometry {SIZE[0]}x{SIZE[1]}\n% end\n"
    )
    path.write_bytes(head.encode() + np.insert(words, at, high).astype("<u8").tobytes())
    return path


def parquet(folder: Path, events: Events) -> Path:
    import pyarrow
    import pyarrow.parquet

    columns = {"t_ns": events.t_us * 1000, "x": events.x, "y": events.y, "p": events.p.astype("u1")}
    pyarrow.parquet.write_table(pyarrow.table(columns), folder / "e.parquet")
    return folder / "e.parquet"


def text(folder: Path, events: Events) -> Path:
    path = folder / "events.txt"
    np.savetxt(
        path, np.stack([events.t_us / 1e6, events.x, events.y, events.p], 1), ["%.6f", "%d", "%d", "%d"]
    )
    return path


_NAMES: dict[str, Any] = {"names": ["x", "y", "s", "ns", "p"], "formats": ["<u2", "<u2", "<u4", "<u4", "u1"]}
PACKED = np.dtype(list(zip(_NAMES["names"], _NAMES["formats"], strict=True)))
PADDED = np.dtype({**_NAMES, "offsets": [0, 2, 6, 10, 14], "itemsize": 16})
"""An event of an EventArray in ROS 1, and in ROS 2 (all but a message's first, which lacks the two bytes)."""


def array_messages(events: Events, aligned: bool) -> Iterator[bytes]:
    """dvs_msgs/EventArray of 10,000 events each."""
    for start in range(0, len(events), 10_000):
        part = events[start : start + 10_000]
        rows = np.zeros(len(part), PADDED if aligned else PACKED)
        rows["x"], rows["y"], rows["p"] = part.x, part.y, part.p
        rows["s"], rows["ns"] = part.t_us // 1_000_000, part.t_us % 1_000_000 * 1000
        size = struct.pack("<III", SIZE[1], SIZE[0], len(part))
        stamp, name = struct.pack("<II", 0, 0), struct.pack("<I4s", 4, b"cam\0")
        if aligned:
            first = rows[:1].astype(PACKED).tobytes() + b"\0"
            yield b"\0\1\0\0" + stamp + name + size + first + rows[1:].tobytes()
        else:
            yield struct.pack("<I", start) + stamp + name + size + rows.tobytes()


def ros1(folder: Path, events: Events) -> Path:
    from rosbags.rosbag1 import Writer

    with Writer(folder / "events.bag") as bag:
        topic = bag.add_connection("/events", "dvs_msgs/msg/EventArray", msgdef="byte a", md5sum="*")
        for number, data in enumerate(array_messages(events, aligned=False)):
            bag.write(topic, number, data)
    return folder / "events.bag"


def ros2_db3(folder: Path, events: Events) -> Path:
    from rosbags.rosbag2 import Writer

    with Writer(folder / "bag", version=8) as bag:
        topic = bag.add_connection(
            "/events", "dvs_msgs/msg/EventArray", msgdef="byte a", rihs01="RIHS01_" + "0" * 64
        )
        for number, data in enumerate(array_messages(events, aligned=True)):
            bag.write(topic, number, data)
    return folder / "bag"


def ros2_mcap(folder: Path, events: Events) -> Path:
    from mcap.writer import CompressionType, Writer

    with (folder / "events.mcap").open("wb") as file:
        out = Writer(file, compression=CompressionType.ZSTD)
        out.start("ros2", "bench")
        schema = out.register_schema("dvs_msgs/msg/EventArray", "ros2msg", b"")
        channel = out.register_channel("/events", "cdr", schema)
        for number, data in enumerate(array_messages(events, aligned=True)):
            out.add_message(channel, log_time=number, publish_time=number, data=data)
        out.finish()
    return folder / "events.mcap"


MAKERS: dict[str, Callable[[Path, Events], Path]] = {
    "aedat2": aedat2,
    "aedat3": aedat3,
    "aedat4": by_faery("e.aedat4"),
    "dat": by_faery("e.dat", version="dat2"),
    "es": by_faery("e.es"),
    "evt2": by_faery("two.raw", version="evt2"),
    "evt21": evt21,
    "evt3": by_faery("three.raw", version="evt3"),
    "hdf5": by_ours("e.h5"),
    "npz": by_ours("e.npz"),
    "parquet": parquet,
    "ros1": ros1,
    "ros2_db3": ros2_db3,
    "ros2_mcap": ros2_mcap,
    "text": text,
}

# Readers: ours, and the others.


def ours(path: Path) -> int:
    unit = "s" if path.suffix == ".txt" else None
    return sum(len(packet) for packet in open_recording(path, SIZE, time_unit=unit).packets())


def with_faery(path: Path) -> int:
    import faery

    return sum(len(packet) for packet in faery.events_stream_from_file(path))


def with_aedat(path: Path) -> int:
    import aedat

    return sum(len(packet["events"]) for packet in aedat.Decoder(path) if "events" in packet)


def with_eventcv(path: Path) -> int:
    import eventcv

    return len(eventcv.load(str(path)))


def with_evt3(path: Path) -> int:
    import evt3

    return sum(len(batch.timestamp) for batch in evt3.decode_file_batches(str(path)))


def with_h5py(path: Path) -> int:
    import h5py

    with h5py.File(path) as file:
        t_us, *_ = (file["events"][name][:] for name in "txyp")
    return len(t_us)


def with_npz(path: Path) -> int:
    with np.load(path) as archive:
        t_us, *_ = (archive[name] for name in ("t_us", "x", "y", "p"))
    return len(t_us)


def with_pyarrow(path: Path) -> int:
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(path, use_threads=False)
    t_ns, *_ = (table.column(name).to_numpy() for name in ("t_ns", "x", "y", "p"))
    return len(t_ns)


def with_pyarrow_csv(path: Path) -> int:
    import pyarrow.csv

    table = pyarrow.csv.read_csv(
        path, pyarrow.csv.ReadOptions(use_threads=False, autogenerate_column_names=True),
        pyarrow.csv.ParseOptions(delimiter=" "),
    )  # fmt: skip
    t, *_ = (table.column(number).to_numpy() for number in range(4))
    return len(t)


def with_numpy_text(path: Path) -> int:
    return len(np.loadtxt(path))


def with_numpy_words(path: Path) -> int:
    """AEDAT 3 by hand: the packets' bytes, then shifts."""
    data, position, count = path.read_bytes(), path.read_bytes().find(b"#!END-HEADER\r\n") + 14, 0
    while position < len(data):
        kind, _, width, _, wraps, room, n, _ = struct.unpack_from("<hhiiiiii", data, position)
        if kind == 1:
            words = np.frombuffer(data, "<u4", 2 * n, position + 28).reshape(-1, 2)
            fields(words[:, 0], words[:, 1], wraps)
            count += n
        position += 28 + width * room
    return count


def fields(pixel: Any, low: Any, wraps: int) -> tuple[Any, ...]:
    return (
        low.astype(np.int64) + (wraps << 31), (pixel >> 17).astype(np.uint16),
        (pixel >> 2 & 0x7FFF).astype(np.uint16), (pixel >> 1 & 1).astype(np.bool_),
    )  # fmt: skip


def with_rosbags(path: Path) -> int:
    """The bag by rosbags, the messages by numpy."""
    import rosbags.rosbag1
    import rosbags.rosbag2

    aligned = path.is_dir()
    bag: Any = rosbags.rosbag2.Reader(path) if aligned else rosbags.rosbag1.Reader(path)
    with bag:
        return sum(array_length(raw, aligned) for _, _, raw in bag.messages())


def with_mcap(path: Path) -> int:
    """The file by mcap with checksums, the messages by numpy."""
    from mcap.records import Message
    from mcap.stream_reader import StreamReader

    with path.open("rb") as file:
        records = StreamReader(file, validate_crcs=True).records
        return sum(array_length(record.data, True) for record in records if isinstance(record, Message))


def array_length(raw: Any, aligned: bool) -> int:
    """A message's events as arrays."""
    rows = np.frombuffer(raw, PADDED, -1, 46) if aligned else np.frombuffer(raw, PACKED, -1, 32)
    t_us = rows["s"].astype(np.int64) * 1_000_000 + rows["ns"] // 1000
    columns = (rows["x"].astype(np.uint16), rows["y"].astype(np.uint16), rows["p"].astype(np.bool_))
    return len(t_us) + aligned + 0 * len(columns)  # the first of an aligned message is taken as read


PEERS: dict[str, dict[str, Callable[[Path], int]]] = {
    "aedat2": {"eventcv": with_eventcv},
    "aedat3": {"numpy": with_numpy_words},
    "aedat4": {"faery": with_faery, "aedat": with_aedat, "eventcv": with_eventcv},
    "dat": {"faery": with_faery, "eventcv": with_eventcv},
    "es": {"faery": with_faery},
    "evt2": {"faery": with_faery, "eventcv": with_eventcv},
    "evt21": {"eventcv": with_eventcv},
    "evt3": {"faery": with_faery, "evt3": with_evt3, "eventcv": with_eventcv},
    "hdf5": {"h5py": with_h5py, "eventcv": with_eventcv},
    "npz": {"numpy": with_npz},
    "parquet": {"pyarrow": with_pyarrow},
    "ros1": {"rosbags + numpy": with_rosbags, "eventcv": with_eventcv},
    "ros2_db3": {"rosbags + numpy": with_rosbags},
    "ros2_mcap": {"mcap + numpy": with_mcap},
    "text": {"pyarrow": with_pyarrow_csv, "numpy": with_numpy_text, "eventcv": with_eventcv},
}


def speeds(name: str, events: Events, rounds: int) -> tuple[int, dict[str, Timing]]:
    """The number of events, and reader -> CPU seconds for all of them, ours first."""
    with tempfile.TemporaryDirectory(prefix="evplace-bench-") as folder:
        path = MAKERS[name](Path(folder), events)
        return ours(path), timed(path, PEERS[name], rounds)


def timed(path: Path, peers: dict[str, Callable[[Path], int]], rounds: int) -> dict[str, Timing]:
    """A reader that gives another number of events, or none, is named and not timed."""
    wanted = ours(path)
    fitting: dict[str, Callable[[], object]] = {"ours": partial(ours, path)}
    for peer, read in peers.items():
        try:
            got = read(path)
        except Exception as error:
            print(f"  ({peer} does not read it: {' '.join(str(error).split())[:80]})")
            continue
        if got == wanted:
            fitting[peer] = partial(read, path)
        else:
            print(f"  ({peer} gives {got:,} events in place of {wanted:,})")
    return alternate(fitting, rounds)


def show(title: str, count: int, timings: dict[str, Timing]) -> None:
    """Mev/s, and our speed over each other one's, round by round."""
    base = timings["ours"]
    cells = [f"ours {count / base.median / 1e6:.0f}"]
    for peer, timing in list(timings.items())[1:]:
        ratios = [other / mine for other, mine in zip(timing.seconds, base.seconds, strict=True)]
        cells.append(
            f"{peer} {count / timing.median / 1e6:.0f}: x{np.median(ratios):.2f} "
            f"({min(ratios):.2f} to {max(ratios):.2f})"
        )
    print(f"{title:<10} " + "; ".join(cells), flush=True)


# Events to images.

CHILD = """
import sys, time
from evplace.sources.readers import open_recording
from evplace.imaging.stream import EventImages, images_of
recording = open_recording(sys.argv[1])
first = next(recording.packets())
list(EventImages(recording.size).push(first))  # compiles, or loads what is compiled
start, count, images = time.process_time(), 0, 0
for image, window in images_of(recording.packets(), EventImages(recording.size)):
    count, images = count + window.events, images + 1
taken = time.process_time() - start
peak = next(line for line in open("/proc/self/status") if line.startswith("VmHWM")).split()[1]
print(count, images, taken, int(peak) / 1024)
"""


def to_images(path: Path, rounds: int) -> None:
    """Print events, images, the median of Mev/s, its spread, and the highest peak memory."""
    speed, memory, answer = [], [], [0.0]
    for _ in range(rounds):
        command = [sys.executable, "-c", CHILD, str(path)]
        output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        answer = [float(word) for word in output.split()]
        speed.append(answer[0] / answer[2] / 1e6)
        memory.append(answer[3])
    print(
        f"{path.name}: {answer[0]:,.0f} events, {answer[1]:.0f} images, {np.median(speed):.0f} Mev/s "
        f"({min(speed):.0f} to {max(speed):.0f}), peak memory {max(memory):.0f} MB",
        flush=True,
    )


def long_dat(path: Path, million: int) -> Path:
    """A DAT file of two million generated events, again and again."""
    size: Size = (1280, 720)
    part = Events.concatenate(list(generated(2_000_000, size)))
    rows = np.zeros(len(part), [("t", "<u4"), ("data", "<u4")])
    rows["data"] = part.x.astype("<u4") | part.y.astype("<u4") << 14 | part.p.astype("<u4") << 28
    with path.open("wb") as file:
        file.write(f"% Version 2\n% Width {size[0]}\n% Height {size[1]}\n".encode() + b"\x0c\x08")
        for number in range(million // 2):
            rows["t"] = part.t_us + number * int(len(part) / RATE * 1e6)
            file.write(rows.data)
    return path


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recordings", nargs="*", type=Path)
    parser.add_argument("--only", nargs="+", choices=sorted(MAKERS), default=sorted(MAKERS))
    parser.add_argument("--images", action="store_true")
    parser.add_argument("--million", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    if arguments.images:
        for path in arguments.recordings:
            to_images(path, arguments.rounds)
        with tempfile.TemporaryDirectory(prefix="evplace-bench-") as folder:
            to_images(long_dat(Path(folder) / "generated.dat", arguments.million), arguments.rounds)
        return
    print(f"{SIZE[0]}x{SIZE[1]}; million events a second of CPU time, and how many times as fast ours is")
    for name in arguments.only:
        events = Events.concatenate(list(generated(MANY.get(name, EVENTS), SIZE)))
        show(name, *speeds(name, events, arguments.rounds))


if __name__ == "__main__":
    main()
