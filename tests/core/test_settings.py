"""Settings: unknown keys, types, pairs and files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pytest

from evplace.core import families, settings
from evplace.core.errors import SettingsError


@dataclass(frozen=True)
class Some:
    K: int = 5
    tau: float = 0.5
    kind: Literal["a", "b"] = "a"
    wrap: bool = False
    origin: tuple[float, float] = (0.0, 0.0)
    name: str | None = None


def test_values_go_over_the_base() -> None:
    base = Some(K=7, tau=0.1)
    assert settings.make(Some, {"tau": 1, "origin": [1, 2]}, base) == Some(K=7, tau=1.0, origin=(1, 2))
    assert settings.make(Some, {"name": "x", "kind": "b"}) == Some(name="x", kind="b")


@pytest.mark.parametrize(
    "wrong",
    [
        {"K": 1.5},
        {"K": True},
        {"tau": "much"},
        {"kind": "c"},
        {"wrap": 1},
        {"name": 3},
        {"tau": float("nan")},
    ],
)
def test_a_value_of_the_wrong_type_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(SettingsError, match="cannot be"):
        settings.make(Some, wrong)


def test_an_unknown_key_lists_the_known() -> None:
    with pytest.raises(SettingsError, match=r"did you mean 'tau'.*known are K, kind, name"):
        settings.make(Some, {"taus": 1})


def test_dictionaries() -> None:
    assert settings.make(Some, settings.to_dict(Some(K=2))) == Some(K=2)


def test_files(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("K = 3\n")
    assert settings.from_toml(tmp_path / "a.toml") == {"K": 3}
    (tmp_path / "a.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(SettingsError, match="is not TOML"):
        settings.from_toml(tmp_path / "a.toml")
    with pytest.raises(SettingsError, match="cannot read"):
        settings.from_toml(tmp_path / "b.toml")


def test_families_are_their_folders() -> None:
    assert {"cosine", "ncc", "network", "notebook", "sad", "seqslam"} <= set(families.names("scorers"))
    assert families.load("scorers", "ncc").__name__ == "NCC"
    assert families.load("tracks", "csv").__name__ == "evplace.sources.tracks.csv"
    with pytest.raises(SettingsError, match="known are cosine"):
        families.load("scorers", "_ncc")


def test_a_preset_is_looked_up() -> None:
    presets = {"paper": Some(K=7), "plain": Some()}
    assert settings.preset_of("the part", presets, "paper") == Some(K=7)
    assert settings.preset_of("the part", presets, None) is None
    with pytest.raises(SettingsError, match="the part has no preset 'papers': known are paper, plain"):
        settings.preset_of("the part", presets, "papers")
    assert settings.changed(Some(K=7, tau=0.5)) == ["K"]
