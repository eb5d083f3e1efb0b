"""Case: one cell of a table or one curve, as the plain values that decide what comes out."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import evplace
from evplace.core import families, settings
from evplace.matchers import Matcher
from evplace.scorers import Descriptor, Scorer

Values = dict[str, Any]


@dataclass(frozen=True)
class Input:
    """What a method sees of a drive."""

    sensor: str
    """As tables name it: ideal, from-8bit, weak or camera."""
    part: str
    """The traverse of each drive that holds it."""
    tone: str = "plain"
    """What is done to camera images: see `evplace.imaging.tones`."""
    exposure: str = "fixed"
    """Of the camera: fixed, or auto."""
    train: Values = field(default_factory=dict)
    """Settings of the training over those of the method."""
    windows: Values | None = None
    """Settings of windows, where the images are made anew from the drives' events."""
    images: Values | None = None
    """Settings of images, likewise."""
    paper: str | None = None
    """Column of the paper's tables beside it: events or colour."""


@dataclass(frozen=True)
class Method:
    """How places are found."""

    scorer: str
    """A scorer's name."""
    matcher: str
    """A matcher's name."""
    preset: str | None = None
    """A preset of the matcher."""
    settings: Values = field(default_factory=dict)
    """Settings of the matcher over those of the preset."""
    scorer_settings: Values = field(default_factory=dict)
    """Settings of the scorer over those of its preset."""
    every: int = 1
    """Use each, every second ... image of map and query."""
    scorer_preset: str | None = None
    """A preset of the scorer; where none is named and the scorer has one, the paper's."""
    for_camera: bool = True
    """Whether it is for camera images, too."""


@dataclass(frozen=True)
class Case:
    """One map, one query, one method, one seed; all settings resolved."""

    database: str
    """The drive that is learned: day-1."""
    query: str
    """The drive that is looked for: night-1."""
    part: str
    tone: str
    exposure: str
    windows: Values | None
    images: Values | None
    """See Input."""
    scorer: str
    scorer_settings: Values
    matcher: str
    matcher_settings: Values
    every: int
    """See Method; settings resolved."""
    train: Values | None
    """All settings of the training with its seed; None where nothing is trained."""
    origin: tuple[float, float] = (0.0, 0.0)
    """Corner of the grid of places, metres."""
    swept: bool = False
    """Whether the curve over the matcher's parameter is wanted, not its answers."""
    keep: str = ""
    """Name under which the whole result is kept; "" for none."""

    @classmethod
    def of(cls, database: str, query: str, seen: Input, method: Method, train: Values | None = None) -> Case:
        """The first seed of a method on an input; `train` goes over the input's own settings of the training.

        Raises SettingsError for an unknown name or setting.
        """
        matcher = families.make("matchers", method.matcher, method.preset, method.settings)
        scorer = _scorer_of(method)
        kept, trained = _settings_of(scorer, {**seen.train, **(train or {}), "seed": 0})
        return cls(
            database=database,
            query=query,
            part=seen.part,
            tone=seen.tone,
            exposure=seen.exposure,
            windows=seen.windows,
            images=seen.images,
            scorer=method.scorer,
            scorer_settings=kept,
            matcher=method.matcher,
            matcher_settings=settings.to_dict(matcher),
            every=method.every,
            train=trained,
        )

    @classmethod
    def from_dict(cls, values: Values) -> Case:
        """The case that `to_dict` wrote."""
        return cls(**{**values, "origin": tuple(values["origin"])})

    @property
    def scorer_part(self) -> Scorer | Descriptor:
        """The scorer, with its settings and those of the training."""
        values = dict(self.scorer_settings)
        if self.train is not None:
            nested = _NETWORK in {one.name for one in fields(families.load("scorers", self.scorer))}
            values |= {_NETWORK: self.train} if nested else self.train
        part: Scorer | Descriptor = families.make("scorers", self.scorer, None, values)
        return part

    @property
    def matcher_part(self) -> Matcher:
        """The matcher, with its settings."""
        part: Matcher = families.make("matchers", self.matcher, None, self.matcher_settings)
        return part

    def with_seeds(self, seeds: int) -> list[Case]:
        """The same with each of the seeds 0, 1, ...; alone where nothing is trained."""
        if self.train is None:
            return [self]
        return [replace(self, train={**self.train, "seed": seed}) for seed in range(seeds)]

    def to_dict(self) -> Values:
        """As plain values, for JSON."""
        return asdict(self)

    def key(self, source: Values) -> str:
        """What two runs of the same case have in common: a checksum of its settings and of the drives'."""
        return checksum({**replace(self, keep="").to_dict(), "city": source})

    def map_key(self, source: Values) -> str:
        """The same of its map alone: a network does not depend on the query, nor on who reads it."""
        of_map = self.to_dict() | {"city": source}
        beside = {"query", "matcher", "matcher_settings", "swept", "keep"}
        if self.train is not None:
            beside |= {"scorer", "scorer_settings"}
        return checksum({name: value for name, value in of_map.items() if name not in beside})


_NETWORK = "network"
"""The field of a scorer that says how its network is trained."""


def _scorer_of(method: Method) -> Scorer | Descriptor:
    """The scorer with its settings."""
    presets = families.settings_of("scorers", method.scorer)[1]
    preset = method.scorer_preset or ("paper" if "paper" in presets else None)
    part: Scorer | Descriptor = families.make("scorers", method.scorer, preset, method.scorer_settings)
    return part


def _settings_of(scorer: Any, changed: Values) -> tuple[Values, Values | None]:
    """A scorer's own settings, and with `changed` those of its training, where it has a seed.

    A network within a scorer is trained as the paper says.
    """
    trained = getattr(scorer, _NETWORK, scorer)
    if not hasattr(trained, "seed"):
        return settings.to_dict(scorer), None
    if trained is scorer:
        return {}, settings.to_dict(settings.make(type(trained), changed, trained))
    own = settings.to_dict(scorer)
    own.pop(_NETWORK)
    return own, settings.to_dict(settings.make(type(trained), changed, trained.presets["paper"]))


def checksum(values: Values) -> str:
    """A name for these values and this version."""
    text = json.dumps({**values, "evplace": evplace.__version__}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:20]
