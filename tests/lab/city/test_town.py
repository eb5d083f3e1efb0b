from __future__ import annotations

import hashlib

import numpy as np
import pytest
from made_town import made_town

from evplace.core.errors import SettingsError
from evplace_lab.city import build_town
from evplace_lab.city.conditions import CONDITIONS, condition
from evplace_lab.city.culling import group, seen
from evplace_lab.city.lightmaps import height_map, light_maps
from evplace_lab.city.materials import ROAD
from evplace_lab.city.mesh import Mesh
from evplace_lab.city.raster import View
from evplace_lab.city.routes import lay_route, nodes_of
from evplace_lab.city.terrain import Terrain
from evplace_lab.city.texture import band, hash01, noise, pulse
from evplace_lab.city.town import Town


@pytest.fixture(scope="module")
def town() -> Town:
    return made_town()


def test_a_seed_gives_one_town(town: Town) -> None:
    again, other = build_town(0), build_town(1)
    for a, b in zip(town.scene, again.scene, strict=True):
        np.testing.assert_array_equal(a, b)
    assert town.scene.frame.shape != other.scene.frame.shape
    assert 700 < len(town.houses) < 1300
    assert len(town.lamps) > 300
    assert len(town.trees) > 300


def test_ground_tiles_meet_without_cracks() -> None:
    terrain = Terrain.of(np.random.default_rng(3))
    x, y = np.meshgrid([10.0, 18.0], [40.0, 51.0])
    (a, b), (c, d) = terrain.world(x, y)
    np.testing.assert_allclose(b - a, d - c, atol=1e-9)


def test_roads_bend_and_climb(town: Town) -> None:
    tiles = town.scene.frame[town.scene.material == ROAD]
    directions = np.degrees(np.arctan2(tiles[:, 4], tiles[:, 3]))
    slopes = np.hypot(tiles[:, 5] / tiles[:, 3], tiles[:, 8] / tiles[:, 7])
    assert np.ptp(directions) > 12
    assert 0.02 < slopes.max() < 0.12


def test_part_of_the_route_lies_in_the_sun(town: Town) -> None:
    """A height map filled wrongly puts the whole town in the shade, and nothing else tells."""
    maps = light_maps(town, condition("day").light(), len(town.scene.shape))
    route = lay_route(1, town.streets, town.terrain, 0, None).position
    cells = (route[:, :2] - maps.origin).astype(int)
    lit = route[:, 2] > maps.shadow[cells[:, 1], cells[:, 0]]
    assert 0.3 < lit.mean() < 0.9


def test_shadows_equal_a_plain_walk_towards_the_sun(town: Town) -> None:
    light = condition("lowsun").light()
    maps = light_maps(town, light, len(town.scene.shape))
    heights = height_map(town, np.array(maps.origin), *maps.shadow.shape)
    sun = np.array(light.towards_sun)
    ahead, rise = sun[:2] / np.hypot(*sun[:2]), sun[2] / np.hypot(*sun[:2])
    rng = np.random.default_rng(0)
    for y, x in rng.integers(200, 500, (50, 2)):
        d = np.arange(1, 240) * 0.7
        i, j = (x + 0.5 + ahead[0] * d).astype(int), (y + 0.5 + ahead[1] * d).astype(int)
        best = (heights[j, i] - d * rise).max()
        assert maps.shadow[y, x] == pytest.approx(max(best, -1000.0), abs=1e-3)


def test_lamps_light_the_road_at_night_only(town: Town) -> None:
    night, day = (
        light_maps(town, condition(name).light(), len(town.scene.shape)) for name in ("night", "day")
    )
    assert night.lamplight.max() > 0.01
    assert (night.near_lamps >= 0).any()
    assert day.lamplight.max() == 0.0


def test_paths_are_known_or_drawn_by_seed(town: Town) -> None:
    for path in (1, 2, 3, 4):
        nodes = nodes_of(path, town.streets, 0)
        steps = np.abs(np.diff(nodes, axis=0))
        assert np.all(steps.min(1) == 0)
        assert np.all(steps.max(1) > 0)
    assert nodes_of(3, town.streets, 0) == nodes_of(3, town.streets, 0)
    assert nodes_of(3, town.streets, 0) != nodes_of(3, town.streets, 1)
    with pytest.raises(SettingsError, match="unknown path 0"):
        nodes_of(0, town.streets, 0)


def test_routes_have_even_steps_and_the_length_asked_for(town: Town) -> None:
    whole = lay_route(1, town.streets, town.terrain, 0, None)
    part = lay_route(1, town.streets, town.terrain, 0, 300.0)
    assert 1900 < whole.length_m < 2300
    assert part.length_m == pytest.approx(300.0)
    steps = np.hypot(*np.diff(whole.position[:, :2], axis=0).T)
    np.testing.assert_allclose(steps, 0.1, atol=0.02)
    assert len(whole.halts) > 15


def test_unknown_conditions_are_refused() -> None:
    with pytest.raises(SettingsError, match="unknown condition 'hail': known are day, night"):
        condition("hail")
    assert len(CONDITIONS) == 7


def test_pulses_are_means_over_the_footprint() -> None:
    for x, footprint, start, width in ((0.3, 0.5, 0.1, 0.4), (7.77, 3.2, 0.0, 0.5), (-2.2, 0.05, 0.6, 0.3)):
        fine = np.linspace(x - footprint / 2, x + footprint / 2, 200_001)
        inside = (fine - np.floor(fine) >= start) & (fine - np.floor(fine) < start + width)
        assert pulse(x, footprint, start, width) == pytest.approx(inside.mean(), abs=1e-3)
        covered = (fine >= 0.2) & (fine <= 7.0)
        assert band(x, footprint, 0.2, 7.0) == pytest.approx(covered.mean(), abs=1e-3)


def test_noise_is_smooth_and_the_same_everywhere() -> None:
    values = [hash01(x, y, s) for x in range(-5, 5) for y in range(-5, 5) for s in range(9)]
    assert min(values) >= 0
    assert max(values) < 1
    assert np.mean(values) == pytest.approx(0.5, abs=0.05)
    digest = hashlib.sha256(np.array(values).tobytes()).hexdigest()
    assert digest[:16] == "12f29f1633c79258"
    near = [abs(noise(x + 1e-4, 0.7, 3) - noise(x, 0.7, 3)) for x in np.arange(-3, 3, 0.1)]
    assert max(near) < 1e-3


def test_what_is_in_sight_is_not_left_out() -> None:
    mesh, rng = Mesh(), np.random.default_rng(0)
    spots = rng.uniform(-100, 100, (500, 2))
    for x, y in spots:
        mesh.quad((x, y, 0), (1, 0, 0), (0, 0, 1), 3, (0.5, 0.5, 0.5))
    view = View((0.0, 0.0, 1.5), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), 95.0, 160, 120)
    groups = group(mesh.primitives())
    found = {int(q) for g in seen(groups, view) for q in groups.members[slice(*groups.start[g : g + 2])]}
    ahead = (spots[:, 0] > 1) & (np.abs(spots[:, 1]) < spots[:, 0] * 80 / 95)
    assert set(np.flatnonzero(ahead)) <= found
    assert len(found) < 400
