"""The matcher of commands that localise: the one that a map remembers, unless a flag names another."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from evplace.core.errors import EvplaceError
from evplace.placemap import remembered


def of_map(args: Any) -> str:
    """The name of the matcher that `args.map` remembers; of a map that cannot be read, the usual one."""
    try:
        return remembered(Path(args.map))
    except EvplaceError:
        return "bayes"


def settings_of_matcher(args: Any) -> dict[str, object]:
    """The settings that flags give, those with flags of their own among them."""
    own = {name: getattr(args, name) for name in ("false_accept", "lag_s")}
    return dict(args.set) | {name: value for name, value in own.items() if value is not None}
