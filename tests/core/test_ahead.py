"""Parts that a thread makes ahead: the same, with the same errors, not too many, and nothing left running."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from evplace.core.ahead import ahead


def running() -> bool:
    return any(thread.name == "ahead" for thread in threading.enumerate())


class Parts:
    """Gives numbers, then perhaps an error, and notes what was made and whether it was closed."""

    def __init__(self, count: int, error: BaseException | None = None) -> None:
        self.count, self.error = count, error
        self.made, self.closed = 0, threading.Event()
        self.full = threading.Event()

    def __call__(self) -> Iterator[int]:
        try:
            for number in range(self.count):
                self.made += 1
                if self.made == 4:
                    self.full.set()
                yield number
            if self.error is not None:
                raise self.error
        finally:
            self.closed.set()


@pytest.mark.parametrize("count", [0, 1, 100])
def test_all_parts_in_their_order_and_no_thread_after_them(count: int) -> None:
    assert list(ahead(Parts(count), 3)) == list(range(count))
    assert not running()


@pytest.mark.parametrize("error", [ValueError("bad"), KeyboardInterrupt()])
def test_an_error_comes_after_the_parts_before_it(error: BaseException) -> None:
    seen = []
    with pytest.raises(type(error)) as raised:
        for part in ahead(Parts(9, error), 3):
            seen.append(part)
    assert raised.value is error
    assert seen == list(range(9))
    assert not running()


def test_no_more_are_made_than_there_is_room_for() -> None:
    parts = Parts(100)
    given = ahead(parts, 3)
    assert next(given) == 0
    assert parts.full.wait(60)
    for number in range(1, 50):
        assert next(given) == number
        assert parts.made <= number + 1 + 3
    given.close()  # type: ignore[attr-defined]


def test_whoever_stops_early_leaves_nothing_running() -> None:
    parts = Parts(100)
    given = ahead(parts, 3)
    assert [next(given) for _ in range(6)] == list(range(6))
    given.close()  # type: ignore[attr-defined]
    assert not running()
    assert parts.closed.is_set()
    assert parts.made <= 10
