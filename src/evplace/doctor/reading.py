"""What the reader met: where the file broke off, what it left out, what it had to guess, and the clock."""

from __future__ import annotations

from evplace.core.errors import DoubtfulRecordingError, UnsupportedError
from evplace.doctor._outcome import Finding, Outcome, State, counted
from evplace.doctor._subject import AtTheEnd, Subject

OF = ("events", "frames")

CLOCKS_BITS = (16, 24, 28, 30, 31, 32, 34)
"""Widths of clocks that cameras and files have, in bits of microseconds."""


class Check(AtTheEnd):
    """Asks the recording itself, once all of it was read."""

    def outcome(self) -> Outcome:
        """Findings: reading; for a recording also remarks, the reasons for drops, clock."""
        recording = self._subject.recording
        if recording is None:
            return Outcome([_read(self._subject)])
        dropped = recording.dropped
        total = self._subject.parts + sum(dropped.values())
        return Outcome(
            [
                _read(self._subject),
                _remarks(recording.notes),
                _dropped(
                    "events outside the sensor", dropped["out_of_range"], total,
                    "lie outside the sensor",
                    "give the sensor's true size with `size`",
                ),
                _dropped(
                    "order of time", dropped["backwards"], total,
                    "are earlier than one before them",
                    "sort the file by time (a merge of two recordings?), or record it anew",
                ),
                _dropped(
                    "leaps of the clock", dropped["jump"] + dropped["untimed"], total,
                    "came while the clock leapt away, or before it was known",
                    "nothing, if they are few; else check the camera's link and record anew",
                ),
                _clock(recording.wraps, recording.back_us, dropped["backwards"], total),
                *self._turns(recording.turn_us),
            ]
        )  # fmt: skip

    def _turns(self, turn_us: int) -> list[Finding]:
        """Silences that may have been a turn of the file's clock longer, where that has one."""
        starts, ends = self._subject.gaps()
        if not turn_us or not len(starts):
            return []
        longest, turn_s = float((ends - starts).max()) / 1e6, turn_us / 1e6
        return [
            Finding(
                "turns of the clock", "look", longest, "s",
                f"The file's clock starts anew every {turn_s:,.1f} s, and the whole sensor is silent "
                f"{counted(len(starts), 'time', 'times')}, for up to {longest:.3f} s: each silence may have "
                "lasted any number of turns longer, which the file does not tell.",
                "hold the recording's length against a watch, or against its track",
            )
        ]  # fmt: skip


def _read(subject: Subject) -> Finding:
    fault = subject.fault
    if fault is None:
        return Finding("reading", "good", None, "", "It was read to its end.")
    if isinstance(subject.cause, DoubtfulRecordingError):
        return Finding(
            "reading", "bad", None, "",
            f"It was read to its end, but it can hardly be a recording: {fault}.",
            "do as it says, and use no result of it before",
        )  # fmt: skip
    if isinstance(subject.cause, UnsupportedError):
        return Finding(
            "reading", "bad", None, "",
            f"What comes then is whole, but not read: {fault}. The part before it was examined.",
            "record it in one encoding that is read, or convert it with the program that wrote it",
        )  # fmt: skip
    return Finding(
        "reading", "bad", None, "",
        f"It breaks off: {fault}. Its good part was examined.",
        "copy it from the camera again; every command works with the good part and then exits with 3",
    )  # fmt: skip


def _remarks(notes: list[str]) -> Finding:
    if not notes:
        return Finding("remarks", "good", 0, "", "The file states all that reading it takes.")
    return Finding(
        "remarks", "look", len(notes), "",
        f"The reader remarks: {'; '.join(notes)}.",
        "where that is wrong, give `size`, `time_unit`, `stream` or `columns`",
    )  # fmt: skip


def _dropped(name: str, number: int, total: int, what: str, advice: str) -> Finding:
    share = 100 * number / max(total, 1)
    state: State = "good" if not number else "look" if share < 0.1 else "bad"
    if not number:
        return Finding(name, state, 0.0, "%", f"No events {what}.")
    return Finding(
        name, state, share, "%", f"{number:,} of {total:,} events {what}: they were left out.", advice
    )


def _clock(wraps: int, back_us: int, backwards: int, total: int) -> Finding:
    """A file whose clock starts anew, unseen by its reader, loses all events until it catches up."""
    turn = next((bits for bits in CLOCKS_BITS if 0.9 * (1 << bits) < back_us <= 1 << bits), None)
    if turn is not None and backwards > 0.01 * total:
        return Finding(
            "clock", "bad", back_us / 1e6, "s",
            f"Times step back by {back_us / 1e6:.3f} s, a whole turn of a {turn}-bit clock: the file's clock "
            f"started anew, and {100 * backwards / total:.0f} % of the events were left out since.",
            f"add {1 << turn} us to all times after each turn, in the program that wrote the file",
        )  # fmt: skip
    if wraps:
        sentence = f"The file's clock started anew {wraps} times; the reader counted on."
    else:
        sentence = "The file's clock did not start anew."
    return Finding("clock", "good", wraps, "wraps", sentence)
