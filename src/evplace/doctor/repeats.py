"""Events that a pixel gives twice: the same one again, and others too soon after."""

from __future__ import annotations

from evplace.doctor._outcome import Finding, Outcome, State
from evplace.doctor._subject import SOON_US, AtTheEnd

OF = ("events",)

MANY = 0.5
"""Share of repeats above which they are the greater part of the data."""


class Check(AtTheEnd):
    """Asks the subject."""

    def outcome(self) -> Outcome:
        """Findings: duplicates, quick repeats."""
        total = max(self._subject.parts, 1)
        return Outcome([_twice(self._subject.twice, total), _soon(self._subject.soon, total)])


def _twice(number: int, total: int) -> Finding:
    if not number:
        return Finding("duplicates", "good", 0.0, "%", "No event comes twice.")
    share = 100 * number / total
    state: State = "good" if share < 0.1 else "look" if share < 5 else "bad"
    return Finding(
        "duplicates", state, share, "%",
        f"{number:,} of {total:,} events equal the one before them of their pixel: time, place and sign.",
        "" if state == "good" else "`refractory_us=1` drops them; look for packets that were written twice",
    )  # fmt: skip


def _soon(number: int, total: int) -> Finding:
    share = number / total
    sentence = f"{100 * share:.1f} % of the events follow one of their pixel within {SOON_US / 1000:g} ms."
    if share < MANY:
        return Finding("quick repeats", "good", 100 * share, "%", sentence)
    return Finding("quick repeats", "look", 100 * share, "%", sentence, f"`refractory_us={SOON_US}`")
