"""The matcher of commands that localise: the one that a map remembers, unless a flag names another."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

from evplace.cli._settings import Pairs, Part, SettingsFlags, a_part_of, a_preset_of
from evplace.core.errors import EvplaceError
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap, remembered

NOT_MEASURED = (
    "the map could not be measured on itself (it is shorter than 150 m, without positions 15 s, or has fewer "
    "than 50 images): matches have no probability, and none is rejected"
)
"""Said of a map whose matcher is calibrated where that can be."""


def _of_map(args: Any) -> str:
    """The name of the matcher that `args.map` remembers; of a map that cannot be read, the usual one."""
    try:
        return remembered(Path(args.map))
    except EvplaceError:
        return "bayes"


@dataclass(frozen=True, kw_only=True)
class MatcherFlags(SettingsFlags):
    """How score rows become answers."""

    PARTS: ClassVar[tuple[Part, ...]] = (Part.of("matchers", "matcher", preset="preset", usual=_of_map),)

    matcher: Annotated[str | None, a_part_of("matchers")] = None
    """How score rows become answers; `evplace list matchers` says what each does. Default: as the map
    remembers."""
    preset: Annotated[str | None, a_preset_of("matchers")] = None
    """A preset of the matcher."""
    false_accept: float | None = None
    """For bayes: the share of the images of places never seen that may be accepted. (0.01)"""
    lag_s: float | None = None
    """For bayes: seconds that an answer waits for what comes next; it is better then. (0)"""
    set: Pairs = ()
    """A setting of the matcher, as name=value: K=5, tau1=0.99, tau2=0.01 for local."""

    def matcher_settings(self) -> dict[str, Any]:
        """The settings that flags give, those with flags of their own among them."""
        own = {"false_accept": self.false_accept, "lag_s": self.lag_s}
        return dict(self.set) | {name: value for name, value in own.items() if value is not None}


def is_measured(place_map: PlaceMap) -> bool:
    """Whether the map tells known from unknown, as far as its matcher is one that learns that."""
    learns = hasattr(place_map.matcher, "learn")
    return not learns or place_map.learned is not None


def matches_noted(where: Localizer, matches: int, accepted: int) -> list[str]:
    """What a user would wonder at: that no match has a probability, or none was accepted."""
    notes = [] if is_measured(where.map) else [NOT_MEASURED]
    if matches and not accepted:
        notes.append(
            f"none of the {matches} matches was accepted: the drive may be of another road or sensor than "
            f"the map, or the matcher '{where.settings['name']}' asks for too much; --matcher best accepts "
            "all, --false-accept 0.1 more"
        )
    return notes
