"""A long evaluation that was stopped goes on, to the same result."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from evplace.core import families
from evplace.evaluation import Result, _checkpoint
from evplace.evaluation._evaluate import evaluate
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.matchers import _kept, _traces
from evplace.placemap import PlaceMap

MATCHERS = [name for name, _ in families.loadable("matchers")]


class StoppedError(Exception):
    pass


def stop_at(query: int) -> object:
    def progress(done: int, total: int, remark: str) -> None:
        assert total >= done
        if done == query:
            raise StoppedError

    return progress


def assert_same(one: Result, other: Result) -> None:
    assert one.figures == other.figures
    for name in ("item", "score", "accepted"):
        np.testing.assert_array_equal(getattr(one.answers, name), getattr(other.answers, name))
    np.testing.assert_array_equal(one.scores, other.scores)


@pytest.fixture
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    """A state is kept after each image."""
    monkeypatch.setattr(_checkpoint, "EVERY_S", 0.0)


@pytest.mark.usefixtures("often")
@pytest.mark.parametrize("matcher", MATCHERS)
def test_a_stopped_call_goes_on_to_the_same_result(
    matcher: str, image_map: PlaceMap, night: Traverse, tmp_path: Path
) -> None:
    counts = night.counts.copy()
    counts[3:5] = 0
    drive, file = dataclasses.replace(night, counts=counts), tmp_path / "kept"
    wanted = evaluate(Localizer(image_map, matcher), drive)
    with pytest.raises(StoppedError):
        evaluate(Localizer(image_map, matcher), drive, checkpoint=file, progress=stop_at(30))
    seen: list[int] = []
    again = evaluate(
        Localizer(image_map, matcher), drive, checkpoint=file, progress=lambda done, *_: seen.append(done)
    )
    assert seen[0] == 30  # the image at which it was stopped was not yet kept
    assert_same(again, wanted)
    assert not file.exists()


@pytest.mark.usefixtures("often")
def test_a_state_of_something_else_is_not_taken(
    image_map: PlaceMap, day: Traverse, night: Traverse, tmp_path: Path
) -> None:
    file = tmp_path / "kept"
    with pytest.raises(StoppedError):
        evaluate(Localizer(image_map, "best"), night, checkpoint=file, progress=stop_at(30))
    data = file.read_bytes()
    for others in ((Localizer(image_map, "local"), night), (Localizer(image_map, "best"), day)):
        file.write_bytes(data)
        assert_same(evaluate(*others, checkpoint=file), evaluate(*others))
    for damaged in (data[:100], b"", b"dear reader"):
        file.write_bytes(damaged)
        found = evaluate(Localizer(image_map, "best"), night, checkpoint=file)
        assert_same(found, evaluate(Localizer(image_map, "best"), night))


@pytest.mark.usefixtures("often")
def test_a_matcher_that_cannot_be_kept_is_told_once(
    image_map: PlaceMap, night: Traverse, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    where = Localizer(image_map, "best")
    where.reset()
    make = Localizer.reset

    def with_a_lock(self: Localizer) -> None:
        make(self)
        self._following.lock = lambda: None  # type: ignore[attr-defined]

    monkeypatch.setattr(Localizer, "reset", with_a_lock)
    with pytest.warns(UserWarning, match="'best' cannot be kept .*: a stopped call begins anew") as told:
        evaluate(where, night, checkpoint=tmp_path / "kept")
    assert len(told) == 1
    assert not (tmp_path / "kept").exists()


@pytest.mark.parametrize("answers", ["live", "hindsight"])
def test_rows_that_are_not_kept_give_the_same_figures(
    image_map: PlaceMap, night: Traverse, answers: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = evaluate(Localizer(image_map, "bayes"), night, answers=answers)  # type: ignore[arg-type]
    monkeypatch.setattr(_kept, "MEMORY_BYTES", 0)
    monkeypatch.setattr(_traces, "BLOCK", 8)
    for matcher in ("hmm", "bayes"):
        kept = evaluate(Localizer(image_map, matcher), night, answers=answers, keep_scores=True)  # type: ignore[arg-type]
        flat = evaluate(Localizer(image_map, matcher), night, answers=answers, keep_scores=False)  # type: ignore[arg-type]
        assert flat.scores is None
        assert kept.scores is not None
        assert flat.figures == kept.figures
    assert flat.figures == before.figures
