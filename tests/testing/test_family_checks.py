"""Each check finds the part that breaks it: small parts, each with one fault."""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from evplace.core.errors import DamagedRecordingError, RecordingError
from evplace.core.events import Events
from evplace.drives.datasets import Drive
from evplace.matchers import Answer, Answers, RowCheck, Rows, Sweep
from evplace.matchers import Path as Answered
from evplace.scorers import Learned, keep_images, references_of
from evplace.sources.readers import Block, Source
from evplace.testing import (
    check_dataset,
    check_descriptor,
    check_matcher,
    check_reader,
    check_representation,
    check_scorer,
)

# A matcher: the best item, in pieces that a fault can replace.


class Matching:
    settings: Any

    def __init__(self, settings: Any) -> None:
        self.settings, self.check, self.answers, self.seen = settings, RowCheck(), Answers(), 0

    def step(self, row: Rows) -> Answer | None:
        self.extend(row[None])
        item, score, accepted = (column[-1] for column in self.answers.path())
        return Answer(len(self.answers) - 1, int(item), float(score), bool(accepted))

    def extend(self, rows: Rows) -> None:
        table = self.check(rows)
        item = table.argmax(1)
        score = table[np.arange(len(table)), item].astype(np.float64)
        self.answers.extend(item, score, score > self.settings.threshold)

    def path(self) -> Answered:
        return self.answers.path()


def matcher(made: type[Matching] = Matching, frozen: bool = True, **changed: Any) -> Any:
    def start(self: Any, distances: bool = False) -> Matching:
        return made(self)

    def sweep(self: Any, parameter: str | None = None) -> Sweep:
        return Sweep(parameter or "threshold", self, lambda score, value: score > value)

    members = {"start": start, "sweep": sweep, "causal": True, "presets": {}} | changed
    fields = [("threshold", float, dataclasses.field(default=-10.0))]
    return dataclasses.make_dataclass("Own", fields, namespace=members, frozen=frozen)()


class Forgetful(Matching):
    def extend(self, rows: Rows) -> None:
        super().extend(rows)
        if len(rows) > 5:
            self.answers.extend(*(column[:0] for column in self.answers.path()))
            item, score, accepted = self.answers.path()
            self.answers = Answers()
            self.answers.extend(np.zeros_like(item), score, accepted)


class Different(Matching):
    def step(self, row: Rows) -> Answer | None:
        answer = super().step(-row)
        assert answer is not None
        return answer


class Ahead(Matching):
    def step(self, row: Rows) -> Answer | None:
        answer = super().step(row)
        assert answer is not None
        return answer._replace(query=answer.query + 1)


class Trusting(Matching):
    def extend(self, rows: Rows) -> None:
        super().extend(np.nan_to_num(rows))


class Shapeless(Matching):
    def extend(self, rows: Rows) -> None:
        super().extend(rows if rows.shape[-1] else np.zeros((len(rows), 1)))


class Stretching(Matching):
    def extend(self, rows: Rows) -> None:
        self.check = RowCheck()
        super().extend(rows)


class Beyond(Matching):
    def path(self) -> Answered:
        return super().path()._replace(item=super().path().item + 1)


class Short(Matching):
    def path(self) -> Answered:
        return Answered(*(column[:-1] for column in super().path()))


class Whole(Matching):
    def path(self) -> Answered:
        return super().path()._replace(accepted=super().path().accepted.astype(int))


class Greedy(Matching):
    def path(self) -> Answered:
        path = super().path()
        return path._replace(item=np.full_like(path.item, -1))


class Changing(Matching):
    def extend(self, rows: Rows) -> None:
        super().extend(rows)
        rows *= 0.5


class Random(Matching):
    def path(self) -> Answered:
        path = super().path()
        return path._replace(score=np.random.default_rng().random(len(path.score)))


class Hindsight(Matching):
    def path(self) -> Answered:
        path = super().path()
        return path._replace(item=np.minimum.accumulate(path.item[::-1])[::-1])


@dataclass(frozen=True)
class NoDefault:
    threshold: float
    causal: ClassVar[bool] = True


MATCHERS: dict[str, Any] = {
    "must have a default": NoDefault(1.0),
    "answers .* otherwise in blocks": matcher(Forgetful),
    "otherwise by 'step' than by 'extend'": matcher(Different),
    "must answer one of the 1 queries so far": matcher(Ahead),
    "must refuse rows with nan": matcher(Trusting),
    r"must refuse rows of shape \(3, 0\)": matcher(Shapeless),
    "of another length than those before": matcher(Stretching),
    "with an item beyond the": matcher(Beyond),
    r"the item of the path .* must be int64 \(1,\)": matcher(Short),
    "the accepted of the path .* must be bool": matcher(Whole),
    "accepts the answer that there is no item": matcher(Greedy),
    "changes the rows": matcher(Changing),
    "anew each time": matcher(Random),
    "says that it is causal, but": matcher(Hindsight),
    "says that it is not causal, but": matcher(causal=False),
    "must say whether it is 'causal'": matcher(causal=None),
    "must be frozen": matcher(frozen=False),
    "presets .* must be objects of its class": matcher(presets={"paper": 3}),
    "sweeps 'colour', which is none": matcher(sweep=lambda self, _=None: Sweep("colour", self)),
    "is swept to another answer": matcher(
        sweep=lambda self, _=None: Sweep("threshold", self, lambda s, v: s <= v)
    ),
    "must be a Sweep": matcher(sweep=lambda self, _=None: None),
}


def test_a_good_matcher_passes() -> None:
    check_matcher(matcher())
    check_matcher(matcher(Hindsight, causal=False))


@pytest.mark.parametrize("words", MATCHERS)
def test_a_matchers_fault_is_found(words: str) -> None:
    with pytest.raises(AssertionError, match=words):
        check_matcher(MATCHERS[words])


# A descriptor and a scorer.


@dataclass(frozen=True)
class Pixels:
    gain: float = 1.0

    def describe(self, images: np.ndarray) -> np.ndarray:
        flat = images.reshape(len(images), -1).astype(np.float32) - 127
        return flat * np.float32(self.gain / max(flat.shape[1], 1))


def described(change: Callable[[Any, np.ndarray], Any]) -> Any:
    class Own(Pixels):
        def describe(self, images: np.ndarray) -> Any:
            return change(super().describe(images), images)

    return Own()


def darker(vectors: np.ndarray, images: np.ndarray) -> np.ndarray:
    images //= 2
    return vectors


def alike(vectors: np.ndarray) -> np.ndarray:
    return np.concatenate([np.ones((len(vectors), 1)), 0 * vectors[:, :1]], axis=1).astype(np.float32)


DESCRIPTORS: dict[str, Any] = {
    r"must give \(24, dimensions\) vectors": described(lambda vectors, _: vectors[:-1]),
    "must give float32": described(lambda vectors, _: vectors.astype(float)),
    "NaN or infinity for images without contrast": described(
        lambda vectors, _: vectors / np.ptp(vectors, axis=1, keepdims=True) if len(vectors) else vectors
    ),
    "changes the images": described(darker),
    "describes images anew": described(
        lambda vectors, _: vectors * np.float32(np.random.default_rng().random())
    ),
    "otherwise among others": described(lambda vectors, _: vectors - vectors.mean(axis=0)),
    "vectors of several lengths": described(lambda v, _: v[:, :3] if len(v) == 2 else v),
    "less like itself": described(lambda vectors, _: alike(vectors)),
}


def test_a_good_descriptor_passes() -> None:
    check_descriptor(Pixels())


@pytest.mark.filterwarnings("ignore:.*divide:RuntimeWarning")
@pytest.mark.parametrize("words", DESCRIPTORS)
def test_a_descriptors_fault_is_found(words: str) -> None:
    with pytest.raises(AssertionError, match=words):
        check_descriptor(DESCRIPTORS[words])


class Opened:
    distances: Any = True

    def __init__(self, references: np.ndarray) -> None:
        self.references = references.reshape(len(references), -1).astype(np.float32)

    def rows(self, images: np.ndarray) -> np.ndarray:
        flat = images.reshape(len(images), -1).astype(np.float32)
        return -np.abs(flat[:, None] - self.references).mean(axis=2)


def scorer(opened: type[Opened] = Opened, learn: Any = None) -> Any:
    @dataclass(frozen=True)
    class Own:
        def learn(self, reference: Any, places: Any, _: Any) -> Any:
            return keep_images(reference, places) if learn is None else learn(reference, places)

        def open(self, content: Any) -> Opened:
            return opened(references_of(content))

    return Own()


class Positive(Opened):
    def rows(self, images: np.ndarray) -> np.ndarray:
        return -super().rows(images)


class Similar(Positive):
    distances = False


class Undecided(Opened):
    distances = 1


class Ranked(Opened):
    def rows(self, images: np.ndarray) -> np.ndarray:
        return super().rows(images) - np.arange(len(images), dtype=np.float32)[:, None]


class Batched(Opened):
    def rows(self, images: np.ndarray) -> np.ndarray:
        rows = super().rows(images)
        return rows if len(rows) == 1 else rows - 1


class Narrow(Opened):
    def rows(self, images: np.ndarray) -> np.ndarray:
        return super().rows(images)[:, 1:]


class Nan(Opened):
    def rows(self, images: np.ndarray) -> np.ndarray:
        return super().rows(images) * np.nan


SCORERS: dict[str, Any] = {
    "these enter negated": scorer(Positive),
    "less like itself": scorer(Similar),
    "must say whether its scores are 'distances'": scorer(Undecided),
    "in a batch with others": scorer(Batched),
    "otherwise in": scorer(Ranked),
    r"must give finite scores \(24, 22\)": scorer(Narrow),
    "with NaN or infinity": scorer(Nan),
    "its items are not some of the 24 images": scorer(learn=lambda *_: Learned({}, np.array([99]))),
    "must learn arrays and bytes.*it gave NoneType": scorer(learn=lambda *_: types.NoneType()),
    "its content holds list": scorer(learn=lambda *_: Learned({"a": [1]})),
}


def test_a_good_scorer_passes() -> None:
    check_scorer(scorer())


@pytest.mark.parametrize("words", SCORERS)
def test_a_scorers_fault_is_found(words: str) -> None:
    with pytest.raises(AssertionError, match=words):
        check_scorer(SCORERS[words])


# A representation.


class Grid:
    used: ClassVar[Any] = ()

    def __init__(self, size: tuple[int, int]) -> None:
        self.grid = np.zeros((1, size[1], size[0]), np.int8)

    def add(self, events: Events) -> None:
        if np.any(events.x >= self.grid.shape[2]) or np.any(events.y >= self.grid.shape[1]):
            raise RecordingError("outside")
        self.grid[0, events.y, events.x] = -1

    def channels(self, t_us: int) -> np.ndarray:
        return self.grid

    def clear(self) -> None:
        self.grid.fill(0)


def grid(**changed: Any) -> type[Grid]:
    return type("Own", (Grid,), changed)


def last_packet(self: Any, events: Events) -> None:
    if len(events):
        self.grid.fill(0)
    Grid.add(self, events)


def only_inside(self: Any, events: Events) -> None:
    inside = (events.x < self.grid.shape[2]) & (events.y < self.grid.shape[1])
    self.grid[0, events.y[inside], events.x[inside]] = -1


REPRESENTATIONS: dict[str, Any] = {
    "in a tuple, 'used'": grid(used=["bins"]),
    "not all are settings of images": grid(used=("colour",)),
    r"must give \(C, 23, 37\)": grid(channels=lambda self, t_us: self.grid.transpose(0, 2, 1)),
    "not 0 or -1": grid(channels=lambda self, t_us: -self.grid),
    "must give int8 or float32": grid(channels=lambda self, t_us: self.grid.astype(float)),
    "beyond 0 to 1": grid(channels=lambda self, t_us: self.grid.astype(np.float32)),
    "does not show the events": grid(channels=lambda self, t_us: self.grid * np.int8(0)),
    "depends on the packets": grid(add=last_packet),
    "outside the sensor": grid(add=only_inside),
}


def test_a_good_representation_passes() -> None:
    check_representation(Grid)


@pytest.mark.parametrize("words", REPRESENTATIONS)
def test_a_representations_fault_is_found(words: str) -> None:
    with pytest.raises(AssertionError, match=words):
        check_representation(REPRESENTATIONS[words])


# A reader: 15 bytes an event.

MARK, ROW = b"OWNEVENT", np.dtype([("t", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "?"), ("end", "<u2")])


def write(folder: Path, events: Events) -> Path:
    rows = np.zeros(len(events), ROW)
    rows["t"], rows["x"], rows["y"], rows["p"] = events.t_us, events.x, events.y, events.p
    (folder / "made.own").write_bytes(MARK + rows.tobytes())
    return folder / "made.own"


def blocks_of(path: Path) -> Any:
    data = path.read_bytes()[len(MARK) :]
    whole = len(data) // ROW.itemsize
    rows = np.frombuffer(data[: whole * ROW.itemsize], ROW)
    signs = rows["p"].view(np.uint8).astype(bool)
    yield Block(rows["t"].astype(np.int64), rows["x"].astype(np.uint16), rows["y"].astype(np.uint16), signs)
    if len(data) % ROW.itemsize:
        raise DamagedRecordingError(f"{path} is cut off")


def reader(blocks: Any = blocks_of, size: Any = (240, 180), **changed: Any) -> types.ModuleType:
    module = types.ModuleType("someone.own")
    module.__dict__.update(
        ABOUT="Own.",
        matches=lambda path, head: head.startswith(MARK),
        read=lambda path, hints: Source(size, lambda: blocks(path)),
    )
    module.__dict__.update(changed)
    return module


def once(read: list[Path] = []) -> Any:  # noqa: B006 - it shall remember
    def blocks(path: Path) -> Any:
        for block in blocks_of(path):
            yield block if path not in read else Block(*(column[:9] for column in block[:4]))
        read.append(path)

    return blocks


def changed_blocks(change: Callable[[Block], Block]) -> Any:
    def blocks(path: Path) -> Any:
        for block in blocks_of(path):
            yield change(block)

    return blocks


def nothing_when_cut(path: Path) -> Any:
    if (path.stat().st_size - len(MARK)) // ROW.itemsize not in (50, 500, 3000):
        raise DamagedRecordingError("cut off")
    yield from blocks_of(path)


def key_error(path: Path) -> Any:
    yield from blocks_of(path)
    raise KeyError("end")


READERS: dict[str, Any] = {
    "in one line of text, 'ABOUT'": reader(ABOUT=""),
    "knows? its own content|does not know its own": reader(matches=lambda path, head: path.suffix == ".own"),
    "takes b'GIF89a junk' for its own": reader(matches=lambda path, head: bool(head)),
    "takes an empty folder": reader(matches=lambda path, head: head.startswith(MARK) or not head),
    "does not give the events": reader(changed_blocks(lambda block: block._replace(x=block.y))),
    "for a sensor of": reader(size=(300, 200)),
    "when it is read again": reader(once()),
    "and counts 0 as dropped": reader(
        changed_blocks(lambda block: Block(*(column[block.x < 120] for column in block[:4])))
    ),
    "must give blocks of t_us": reader(changed_blocks(lambda block: block._replace(p=block.p[1:]))),
    "gives at most .* of a file that was cut": reader(nothing_when_cut),
    r"the reader 'own' of the package someone failed: KeyError: 'end'": reader(key_error),
    "must open a Source": reader(read=lambda path, hints: None),
}


def test_a_good_reader_passes() -> None:
    check_reader(reader(), write)


@pytest.mark.parametrize("words", READERS)
def test_a_readers_fault_is_found(words: str) -> None:
    if "dropped" in words:
        small = READERS[words]
        small.read = lambda path, hints: Source(
            (240, 180), lambda: (blocks_of if hints.size in (None, (240, 180)) else lost)(path)
        )
    with pytest.raises(AssertionError, match=words):
        check_reader(READERS[words], write)


lost = changed_blocks(lambda block: Block(*(column[block.x < 120] for column in block[:4])))


# A data set.


def make_set(folder: Path) -> None:
    for name in ("day", "night"):
        (folder / f"{name}.owndrive").write_text("")


def dataset(**changed: Any) -> types.ModuleType:
    module = types.ModuleType("someone.own")
    film = types.SimpleNamespace(size=(4, 3))
    module.__dict__.update(
        NEEDS="NAME.owndrive",
        recognises=lambda folder: any(folder.glob("*.owndrive")),
        drives=lambda folder: sorted(file.stem for file in folder.glob("*.owndrive")),
        open_drive=lambda folder, name: Drive(film),  # type: ignore[arg-type]
    )
    module.__dict__.update(changed)
    return module


def with_log(folder: Path) -> None:
    """As the set "own" has it: a recording and a log of its name."""
    import made_sets

    made_sets.write_own(folder)
    make_set(folder)


DATASETS: dict[str, Any] = {
    "in one line of text, 'NEEDS'": dataset(NEEDS="a\nb"),
    "takes an empty folder": dataset(recognises=lambda folder: True),
    "takes a folder of something else": dataset(recognises=lambda folder: any(folder.iterdir())),
    "names drives in a folder of something else": dataset(drives=lambda folder: ["day"]),
    "does not recognise its own layout": dataset(recognises=lambda folder: False),
    "must list the names": dataset(drives=lambda folder: None),
    "names a drive twice": dataset(drives=lambda folder: ["day"] * 2 * any(folder.glob("*.owndrive"))),
    "must open a Drive": dataset(open_drive=lambda folder, name: name),
}


def test_a_good_data_set_passes() -> None:
    check_dataset(dataset(), make_set)


@pytest.mark.parametrize("words", DATASETS)
def test_a_data_sets_fault_is_found(words: str) -> None:
    with pytest.raises(AssertionError, match=words):
        check_dataset(DATASETS[words], make_set)


def test_a_layout_that_another_set_knows_is_found() -> None:
    with pytest.raises(AssertionError, match="'own' takes the dataset 'own' of the package someone"):
        check_dataset(dataset(), with_log)
