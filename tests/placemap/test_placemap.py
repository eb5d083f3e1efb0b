"""Maps on disk: what is saved comes back; a changed byte, a missing file, another folder are told."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

from conftest import make_drive, make_traverse
from evplace import scorers
from evplace.core.errors import OutputError, PlaceMapError, SettingsError
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.matchers.bayes import Bayes
from evplace.matchers.local import Local
from evplace.placemap import PlaceMap, calibrate, remembered, train
from evplace.places import PlaceGrid, PlaceRuns


@pytest.mark.parametrize("kind", ["image_map", "network_map"])
def test_a_saved_map_answers_as_before(
    kind: str, request: pytest.FixtureRequest, night: Traverse, tmp_path: Path
) -> None:
    learned: PlaceMap = request.getfixturevalue(kind)
    learned.save(tmp_path / "street.evp")
    loaded = PlaceMap.load(tmp_path / "street.evp")
    assert loaded.settings == learned.settings
    assert loaded.places.to_dict() == learned.places.to_dict()
    np.testing.assert_array_equal(loaded.items.position, learned.items.position)
    wanted = Localizer(learned).rows(night.images)
    np.testing.assert_array_equal(Localizer(loaded).rows(night.images), wanted)


def test_a_map_without_positions(day: Traverse, tmp_path: Path) -> None:
    lost = Traverse(day.images, day.t_us, day.counts, None, day.recipe)
    train(lost, PlaceRuns(len(day), every=10), scorer="sad").save(tmp_path / "map")
    loaded = PlaceMap.load(tmp_path / "map")
    assert loaded.items.place.tolist() == [n // 10 for n in range(len(day))]
    assert np.isnan(loaded.items.position).all()


@pytest.mark.parametrize("name", ["references.npy", "map.json", "items.npy", "SHA256SUMS"])
def test_a_flipped_byte_is_found(image_map: PlaceMap, tmp_path: Path, name: str) -> None:
    image_map.save(tmp_path / "map")
    file = tmp_path / "map" / name
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    with pytest.raises(PlaceMapError, match=r"damaged|SHA256SUMS|lacks"):
        PlaceMap.load(tmp_path / "map")


def test_a_missing_part_is_told(network_map: PlaceMap, tmp_path: Path) -> None:
    network_map.save(tmp_path / "map")
    (tmp_path / "map" / "network.onnx").unlink()
    with pytest.raises(PlaceMapError, match=r"lacks network\.onnx"):
        PlaceMap.load(tmp_path / "map")
    with pytest.raises(PlaceMapError, match="not a map: give"):
        PlaceMap.load(tmp_path)


def test_an_existing_map_is_not_overwritten_unasked(image_map: PlaceMap, tmp_path: Path) -> None:
    image_map.save(tmp_path / "map")
    with pytest.raises(OutputError, match="exists"):
        image_map.save(tmp_path / "map")
    image_map.save(tmp_path / "map", overwrite=True)
    assert [path.name for path in tmp_path.iterdir()] == ["map"]


def test_scorers_and_their_settings_are_checked(day: Traverse, places: PlaceGrid) -> None:
    assert train(day, places, "ncc", sigma=1).scorer == scorers.NCC(sigma=1.0)
    with pytest.raises(SettingsError, match="did you mean 'sigma'"):
        train(day, places, "ncc", sigmas=1)
    with pytest.raises(SettingsError, match="known are cosine, edges, fused, ncc, network"):
        train(day, places, "nearest")
    with pytest.raises(SettingsError, match="put them into the object"):
        train(day, places, scorers.NCC(), sigma=1)


def long_street() -> tuple[Traverse, PlaceGrid]:
    """240 m: long enough to be measured on itself."""
    street = make_traverse(make_drive(windows=120))
    assert street.track is not None
    return street, PlaceGrid.from_track(street.track)


def test_a_map_remembers_its_matcher_and_what_it_learned(tmp_path: Path) -> None:
    street, places = long_street()
    learned = train(street, places, "edges", matcher=Bayes(false_accept=0.05))
    assert learned.learned is not None
    learned.save(tmp_path / "map")
    loaded = PlaceMap.load(tmp_path / "map")
    assert loaded.matcher == Bayes(false_accept=0.05)
    assert loaded.learned is not None
    for name, values in learned.learned.items():
        np.testing.assert_array_equal(loaded.learned[name], values)
    assert learned.items.t_us is not None
    assert loaded.items.t_us is not None
    np.testing.assert_array_equal(loaded.items.t_us, learned.items.t_us)
    night = make_traverse(make_drive(seed=1, windows=120, noise=0.02))
    ours, theirs = (list(Localizer(one).match_traverse(night)) for one in (learned, loaded))
    assert ours == theirs
    assert {match.state for match in ours} >= {"localised"}
    assert remembered(tmp_path / "map") == "bayes"


def test_what_a_matcher_learned_must_fit_the_map(tmp_path: Path) -> None:
    street, places = long_street()
    learned = train(street, places, "edges")
    learned.save(tmp_path / "map")
    for name, wrong in (
        ("matcher-wrong.npy", np.zeros(3)),
        ("matcher-unknown_live.npy", np.array([0.5, 0.1])),
        ("times.npy", np.zeros(4, np.int64)),
    ):
        kept = (tmp_path / "map" / name).read_bytes()
        np.save(tmp_path / "map" / name, wrong)
        sign(tmp_path / "map")
        with pytest.raises(PlaceMapError, match="damaged"):
            Localizer(PlaceMap.load(tmp_path / "map"))
        (tmp_path / "map" / name).write_bytes(kept)


def sign(folder: Path) -> None:
    """Checksums over what lies in the folder now."""
    (folder / "SHA256SUMS").unlink()
    sums = [
        f"{hashlib.sha256(one.read_bytes()).hexdigest()}  {one.name}\n" for one in sorted(folder.iterdir())
    ]
    (folder / "SHA256SUMS").write_text("".join(sums), "ascii")


def test_the_default_is_the_best_and_the_preset_paper_the_papers(day: Traverse, places: PlaceGrid) -> None:
    best = train(day, places)
    assert (best.scorer, best.matcher) == (scorers.Fused(), Bayes())
    assert best.learned is None  # 120 m are too short
    pytest.importorskip("torch", reason="the network needs the extra 'train'")
    paper = train(day, places, preset="paper", steps=1)
    assert (type(paper.scorer), paper.matcher) == (scorers.Network, Local.presets["paper"])
    with pytest.raises(SettingsError, match="there is no preset 'moon'"):
        train(day, places, preset="moon")


def test_a_map_of_places_is_not_measured(network_map: PlaceMap) -> None:
    assert network_map.matcher == Local()
    assert calibrate(network_map, Bayes()).learned is None
    assert list(Localizer(calibrate(network_map, Bayes())).match_traverse(make_traverse(make_drive(1))))


@pytest.mark.parametrize("images", [1, 2])
def test_a_map_of_one_image_or_two(day: Traverse, places: PlaceGrid, images: int) -> None:
    learned = train(day[:images], places)
    assert learned.learned is None
    matches = list(Localizer(learned).match_traverse(day[:10]))
    assert {match.state for match in matches} == {"localised"}
    assert all(np.isnan(match.probability) for match in matches)
