"""Maps on disk: what is saved comes back; a changed byte, a missing file, another folder are told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evplace import scorers
from evplace.core.errors import OutputError, PlaceMapError, SettingsError
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap, train
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
    with pytest.raises(PlaceMapError, match="is no map"):
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
