"""The bundled scenes: exact counts, the same bits for a seed, closed solids, and sunlight that really comes in."""

from __future__ import annotations

import hashlib
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from solids import face_normals, manifold, open_edges, volume

from tyndall.gpu.params import ParameterError
from tyndall.scene.bundled import SCENES, TRIANGLES, blinds, box, courtyard, fence, foliage, interior, named, shadows
from tyndall.scene.bundled.box import FRONT, HEIGHT, OCULUS, OCULUS_RADIUS, SUN
from tyndall.scene.bundled.fence import BAR, PITCH, SUN_DIAMETER
from tyndall.scene.bundled.fence import SUN as LATE_SUN
from tyndall.scene.bundled.fence import ground as dunes
from tyndall.scene.bundled.interior import BULB, BULB_RADIUS
from tyndall.scene.bundled.shadows import CENTRE, ILLUMINANCE
from tyndall.scene.model import DirectionalLight, Mesh, PointLight, Scene, SpotLight, box_corners

Floats = NDArray[np.floating[Any]]

# Surfaces without thickness, by scene: painted planes, foliage, water's jets excepted.
OPEN = {
    "box": set(),
    "blinds": {"blackboard"},
    "courtyard": {"cobbles", "foliage", "shrub", "fern", "bougainvillea", "fallen leaves", "grass"},
    "shadows": {"floor", "left wall", "right wall"},
    "foliage": {"tree leaves", "vine leaves", "bough leaves"},
    "interior": {"lampshade"},
    "fence": set(),
}
AIRY = ("box", "blinds", "courtyard")  # those of S1, with a medium


@pytest.fixture(scope="module", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("TYNDALL_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module", params=list(SCENES))
def scene(request: pytest.FixtureRequest) -> Scene:
    return SCENES[request.param]()


@pytest.fixture(scope="module", params=AIRY)
def airy(request: pytest.FixtureRequest) -> Scene:
    return SCENES[request.param]()


def _meshes(scene: Scene) -> list[Mesh]:
    return list({id(i.mesh): i.mesh for i in scene.instances}.values())


def _digest(scene: Scene) -> str:
    digest = hashlib.sha256(repr((scene.camera, scene.lights, scene.medium, scene.looks)).encode())
    for instance in scene.instances:
        digest.update(repr(instance.transform).encode())
    for mesh in _meshes(scene):
        for array in (mesh.positions, mesh.normals, mesh.uvs, mesh.indices):
            assert array is not None
            digest.update(np.ascontiguousarray(array).data)
        if mesh.material.base_color_texture is not None:
            digest.update(mesh.material.base_color_texture.image.pixels.tobytes())
    return digest.hexdigest()


def test_triangle_count_is_exact(scene: Scene) -> None:
    expected = {
        "box": 4_968, "blinds": 607_402, "courtyard": 5_608_441,
        "shadows": 1_000, "foliage": 22_334, "interior": 23_396, "fence": 49_894,
    }  # fmt: skip
    assert expected == TRIANGLES
    assert scene.triangle_count == expected[scene.name]


@pytest.mark.parametrize(
    ("name", "seed"),
    [("box", 1), ("box", 2**32 - 1), ("blinds", 1), ("blinds", 2), ("blinds", 3)]
    + [(name, seed) for name in ("shadows", "foliage", "interior", "fence") for seed in (1, 2**32 - 1)],
)
def test_every_seed_has_the_exact_count(name: str, seed: int) -> None:
    assert SCENES[name](seed=seed).triangle_count == TRIANGLES[name]


def test_same_bits_for_a_seed(scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TYNDALL_CACHE", str(tmp_path))  # so that the courtyard, too, is modelled again
    assert _digest(SCENES[scene.name]()) == _digest(scene)


def test_seeds_differ() -> None:
    for make in (box, blinds, shadows, foliage, interior, fence):
        assert _digest(make(seed=1)) != _digest(make(seed=0))


def test_normals_are_unit_and_textures_finite(scene: Scene) -> None:
    for mesh in _meshes(scene):
        assert mesh.normals is not None
        assert mesh.uvs is not None
        length = np.sqrt(np.einsum("ij,ij->i", mesh.normals, mesh.normals))
        assert abs(length - 1).max() < 1e-3, mesh.name
        assert np.isfinite(mesh.uvs).all(), mesh.name


def test_solids_are_closed_and_wound_outwards(scene: Scene) -> None:
    for mesh in _meshes(scene):
        if mesh.name not in OPEN[scene.name]:
            assert open_edges(mesh.positions, mesh.indices) == 0, mesh.name
            assert volume(mesh.positions, mesh.indices) > 0, mesh.name


def test_normals_agree_with_the_winding(scene: Scene) -> None:
    # A few corners may face away: creases of the fox that are narrower than a cell of its net, tight bends of tubes.
    for mesh in _meshes(scene):
        assert mesh.normals is not None
        some = mesh.indices[:: max(1, mesh.triangle_count // 20_000)]
        facing = np.einsum("tj,tcj->tc", face_normals(mesh.positions, some), mesh.normals[some])
        assert np.mean(facing < 0) < 0.006, mesh.name


def test_instances_are_turned_not_mirrored(scene: Scene) -> None:
    assert all(np.linalg.det(np.asarray(i.transform)[:3, :3]) > 0 for i in scene.instances)


def test_medium_encloses_the_scene_and_the_camera(airy: Scene) -> None:
    scene = airy
    assert scene.medium.bounds is not None
    low, high = np.asarray(scene.medium.bounds)
    assert (low <= scene.bounds[0] + 1e-5).all()
    assert (high >= scene.bounds[1] - 1e-5).all()
    assert (low < scene.camera.position).all()
    assert (high > scene.camera.position).all()
    assert min(scene.medium.scattering) > 0


def test_looks_carry_s1s_parameters(airy: Scene) -> None:
    assert {technique: set(look) for technique, look in airy.looks.items()} == {
        "screen_space": {"exposure", "decay", "weight"},
        "polygonal": {"g", "tau"},
        "froxel": {"g", "z_limit", "density", "c_s"},
    }


# --- lights -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "count"), [("box", 1), ("box", 2), ("box", 3), ("box", 32), ("blinds", 32)])
def test_lights_share_the_illuminance_of_one(name: str, count: int) -> None:
    lights = SCENES[name](lights=count).lights
    assert len(lights) == count
    assert sum(light.intensity for light in lights) == pytest.approx(SCENES[name]().lights[0].intensity)
    assert len({light.color for light in lights}) == count
    for light in lights:
        assert isinstance(light, DirectionalLight)
        assert light.direction[1] < 0


def test_lights_come_from_all_around() -> None:
    azimuths = []
    for light in box(lights=32).lights:
        assert isinstance(light, DirectionalLight)
        azimuths.append(math.atan2(light.direction[2], light.direction[0]))
    gaps = np.diff(np.sort([*azimuths, min(azimuths) + 2 * math.pi]))
    assert gaps.max() < 2 * (2 * math.pi / 32)


def test_lights_of_blinds_shine_through_the_windows() -> None:
    for light in blinds(lights=32).lights:
        assert isinstance(light, DirectionalLight)
        assert light.direction[0] > 0.1


def test_more_lights_change_nothing_else() -> None:
    one, many = box(), box(lights=7)
    assert _digest(many.with_(lights=one.lights)) == _digest(one)


@pytest.mark.parametrize("name", list(SCENES))
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"lights": 0}, "lights: 0 is outside 1 … 32"),
        ({"lights": 33}, "lights: 33 is outside 1 … 32"),
        ({"lights": 1.5}, "lights: 1.5 is not a whole number"),
        ({"seed": -1}, "seed: -1 is outside 0 … "),
    ],
)
def test_wrong_options_get_one_clear_line(name: str, options: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError) as caught:
        SCENES[name](**options)
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


# --- light ---------------------------------------------------------------------------------------------------------


def _world(scene: Scene, *names: str) -> Floats:
    """(T, 3, 3) triangles of the named instances (all if none) in the world."""
    parts = []
    for instance in scene.instances:
        if not names or instance.name in names:
            matrix = np.asarray(instance.transform)
            world = instance.mesh.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
            parts.append(world[instance.mesh.indices])
    return np.concatenate(parts)


def _in_shadow(points: Floats, travel: Floats, triangles: Floats) -> NDArray[np.bool_]:
    """Whether a triangle lies between each point and a directional light: an exact test in the light's own plane."""
    forward = np.asarray(travel, np.float64) / np.linalg.norm(travel)
    across = np.cross(forward, (0.0, 1.0, 0.0))
    across /= np.linalg.norm(across)
    frame = np.stack([across, np.cross(across, forward), forward])
    corners = triangles @ frame.T
    low, high = corners.min(axis=1), corners.max(axis=1)
    shadow = np.zeros(len(points), bool)
    for k, point in enumerate(points @ frame.T):
        near = np.flatnonzero(
            (low[:, 0] <= point[0]) & (high[:, 0] >= point[0]) & (low[:, 1] <= point[1]) & (high[:, 1] >= point[1])
            & (low[:, 2] < point[2] - 1e-4)
        )  # fmt: skip
        a, b, c = (corners[near, i] - point for i in range(3))
        weights = np.stack([u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] for u, v in ((b, c), (c, a), (a, b))], 1)
        inside = (weights >= 0).all(axis=1) | (weights <= 0).all(axis=1)
        total = weights.sum(axis=1)
        hit = inside & (total != 0)
        depth = np.einsum("ij,ij->i", weights[hit], np.stack([a, b, c], 1)[hit, :, 2]) / total[hit]
        shadow[k] = bool((depth < -1e-4).any())
    return shadow


def test_shaft_of_box_meets_the_fox_and_its_shadow_is_in_the_air() -> None:
    scene = box()
    fox = _world(scene, "fox")
    centres = fox.mean(axis=1)
    normal = np.cross(fox[:, 1] - fox[:, 0], fox[:, 2] - fox[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    facing = (normal @ SUN) < -0.3
    lit = ~_in_shadow((centres + 0.01 * normal)[facing][::5], np.array(SUN), _world(scene))
    assert 0.3 < lit.mean() < 0.98  # the shaft's rim crosses the figure
    behind = centres[facing][::5] + np.array(SUN)
    room = _world(scene, "walls", "floor")
    in_beam = ~_in_shadow(behind, np.array(SUN), room)
    assert in_beam.mean() > 0.2
    assert _in_shadow(behind[in_beam], np.array(SUN), fox).all()


def test_each_of_32_lights_enters_the_box() -> None:
    scene = box(lights=32)
    triangles = _world(scene)
    below = np.array([OCULUS[0], HEIGHT, OCULUS[1]])
    for light in scene.lights:
        assert isinstance(light, DirectionalLight)
        travel = np.array(light.direction) / np.linalg.norm(light.direction)
        entered = below + 0.5 * travel
        assert entered[1] < HEIGHT - 0.2
        assert not _in_shadow(entered[None], travel, triangles)[0]


def test_box_is_dark_but_for_its_openings() -> None:
    """Where the line to the sun crosses no opening, no gap between walls, floor and ceiling lets light in."""
    rng = np.random.default_rng(0)
    scene = box()
    walls = _world(scene, "walls", "floor")
    low, high = np.array([-2.999, 0.001, -3.299]), np.array([2.999, HEIGHT - 0.001, FRONT - 0.001])
    points = rng.uniform(low, high, (600, 3))
    side = rng.integers(0, 3, 600)  # push half of them into walls' faces and corners, where leaks would be
    points[np.arange(300), side[:300]] = np.where(rng.random(300) < 0.5, low[side[:300]], high[side[:300]])
    travel = np.array(SUN) / np.linalg.norm(SUN)
    up = points - travel * ((points[:, 1] - HEIGHT) / travel[1])[:, None]
    through_oculus = np.hypot(up[:, 0] - OCULUS[0], up[:, 2] - OCULUS[1]) < OCULUS_RADIUS
    left = points - travel * ((points[:, 0] + 3.0) / travel[0])[:, None]
    length = FRONT + 0.3 - left[:, 2]
    through_slit = (left[:, 1] > 1.35) & (left[:, 1] < 3.45) & np.any(
        [(length > z) & (length < z + 0.3) for z in (2.35, 3.2, 4.05)], axis=0
    )  # fmt: skip
    lit = ~_in_shadow(points, travel, walls)
    assert 10 < lit.sum() < 200
    assert not (lit & ~through_oculus & ~through_slit).any()


def test_blinds_cut_the_sun_into_sheets() -> None:
    scene = blinds()
    light = scene.lights[0]
    assert isinstance(light, DirectionalLight)
    blockers = _world(scene, "walls", "ceiling", "blind", "window frame")
    line = np.stack([np.full(240, 0.3), np.linspace(0.6, 2.6, 240), np.full(240, 1.2)], 1)
    lit = ~_in_shadow(line, np.array(light.direction), blockers)
    assert 0.2 < lit.mean() < 0.75
    assert np.count_nonzero(np.diff(lit.astype(int)) > 0) >= 15  # one sheet between each two slats
    rng = np.random.default_rng(0)
    away = rng.uniform((5.0, 2.4, 0.2), (6.9, 3.1, 7.3), (100, 3))
    assert _in_shadow(away, np.array(light.direction), blockers).all()


def test_courtyard_is_dappled() -> None:
    scene = courtyard()
    light = scene.lights[0]
    assert isinstance(light, DirectionalLight)
    rng = np.random.default_rng(0)
    points = rng.uniform((-4.5, 1.5, -4.5), (4.5, 1.6, 4.5), (30, 3))
    shade = _in_shadow(points, np.array(light.direction), _world(scene, "foliage", "arcade", "timber"))
    assert 0.15 < shade.mean() < 0.9


def test_courtyard_has_a_mesh_larger_than_a_storage_binding() -> None:
    largest = max(len(mesh.positions) for mesh in _meshes(courtyard()))
    assert largest * 32 > 128 * 2**20  # position, normal and texture coordinate: 32 bytes a vertex


def test_courtyard_is_read_from_its_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    courtyard()
    monkeypatch.setattr(sys.modules["tyndall.scene.bundled.courtyard"], "_model", None)
    foliage = next(i.mesh for i in courtyard().instances if i.name == "foliage")
    assert isinstance(foliage.positions.base, np.memmap) or isinstance(foliage.positions, np.memmap)


# --- scenes for shadows -------------------------------------------------------------------------------------------

SIZES = (10, 11, 12, 13, 14, 22, 37, 58, 99, 100, 149, 373, 374, 375, 1_000, 2_001, 10_000, 100_000)


@pytest.mark.parametrize("triangles", SIZES)
def test_shadows_has_as_many_triangles_as_asked_for_on_closed_sculptures(triangles: int) -> None:
    scene = shadows(triangles=triangles)
    assert scene.triangle_count == triangles
    planes = [i.mesh for i in scene.instances if i.name in OPEN["shadows"]]
    sculptures = [i.mesh for i in scene.instances if i.name not in OPEN["shadows"]]
    assert [plane.triangle_count for plane in planes] == [2 + triangles % 2, 2, 2]
    assert 1 <= len(sculptures) <= 8
    for mesh in sculptures:
        assert manifold(mesh.positions, mesh.indices), mesh.name
        assert volume(mesh.positions, mesh.indices) > 0, mesh.name
        assert mesh.bounds[0][1] > 0, mesh.name  # above the floor
        corners = mesh.positions[mesh.indices].astype(np.float64)
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        assert (area > 0).all(), mesh.name


def test_shadows_keeps_its_forms_as_it_grows() -> None:
    """More triangles are nearer to the same forms, not other ones: their volumes converge, from below or above."""
    volumes = []
    for triangles in (1_000, 10_000, 100_000, 400_000):
        sculptures = [i.mesh for i in shadows(triangles=triangles).instances if i.name not in OPEN["shadows"]]
        volumes.append([volume(mesh.positions, mesh.indices) for mesh in sculptures])
    coarse, middle, fine, finest = np.array(volumes)
    assert (abs(coarse / finest - 1) < 0.55).all()
    assert (abs(middle / finest - 1) < 0.08).all()
    assert (abs(fine / finest - 1) < 0.008).all()


def test_smooth_sculptures_share_their_vertices() -> None:
    for instance in shadows(triangles=100_000).instances:
        if instance.name not in OPEN["shadows"]:
            mesh = instance.mesh
            assert len(np.unique(mesh.positions, axis=0)) == len(mesh.positions)
            assert len(mesh.positions) in (mesh.triangle_count // 2, mesh.triangle_count // 2 + 2)  # Euler: torus, ball


@pytest.mark.parametrize("count", [1, 2, 5, 32])
def test_lights_of_shadows_are_spots_and_suns_that_share_one_illuminance(count: int) -> None:
    scene = shadows(lights=count)
    assert [type(light) for light in scene.lights] == [(SpotLight, DirectionalLight)[k % 2] for k in range(count)]
    total = 0.0
    for light in scene.lights:
        if isinstance(light, SpotLight):
            away = CENTRE - light.position
            distance = float(np.linalg.norm(away))
            assert away @ light.direction == pytest.approx(distance)  # its axis meets the middle
            assert min(light.position[0], light.position[2]) > 0  # before both walls
            total += light.intensity / distance**2
        else:
            assert isinstance(light, DirectionalLight)
            assert light.direction[1] < 0
            total += light.intensity
    assert total == pytest.approx(ILLUMINANCE)
    assert len({light.color for light in scene.lights}) == count


def test_each_light_of_shadows_casts_the_sculptures_on_the_room() -> None:
    scene = shadows(triangles=400, lights=5)
    sculptures = _world(scene, *(i.name for i in scene.instances if i.name not in OPEN["shadows"]))
    rng = np.random.default_rng(0)
    floor = rng.uniform((0.5, 0.001, 0.5), (7.0, 0.001, 7.0), (200, 3))
    walls = rng.uniform((0.001, 0.2, 0.3), (0.001, 4.5, 7.0), (200, 3))
    points = np.concatenate([floor, walls, walls[:, ::-1] * (1, 0, 1) + walls * (0, 1, 0)])
    planes = _world(scene, *OPEN["shadows"])
    for light in scene.lights:
        if isinstance(light, DirectionalLight):
            ends = points - 30 * np.array(light.direction)
        else:
            assert isinstance(light, SpotLight)
            ends = np.broadcast_to(light.position, points.shape)
        assert 0.05 < _blocked(points, ends, sculptures).mean() < 0.6
        assert not _blocked(points, ends, planes).any()  # no wall stands before a light


@pytest.mark.parametrize("triangles", [-1, 0, 9, 10.5, 10_000_001])
def test_a_wrong_number_of_triangles_is_one_line(triangles: Any) -> None:
    with pytest.raises(ParameterError, match=r"^triangles: .*(outside 10 … 10000000|not a whole number)") as caught:
        shadows(triangles=triangles)
    assert "\n" not in str(caught.value)


def test_a_name_may_hold_a_number_of_triangles() -> None:
    make = named("shadows:12345")
    assert make is not None
    scene = make(lights=2, seed=3)
    assert (scene.triangle_count, len(scene.lights)) == (12_345, 2)
    assert _digest(scene) == _digest(shadows(triangles=12_345, lights=2, seed=3))
    assert named("shadows") is shadows
    assert named("shade:100") is None


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("shadows:", "triangles: '' is no number of them"),
        ("shadows:many", "triangles: 'many' is no number of them"),
        ("shadows:-5", "triangles: '-5' is no number of them"),
        ("shadows:" + "9" * 5000, "triangles: '999"),
        ("shadows:9", "triangles: 9 is outside 10 …"),
        ("box:100", "triangles: box has 4,968; only shadows"),
    ],
)
def test_a_wrong_number_in_a_name_is_one_line(name: str, message: str) -> None:
    make = named(name)
    assert make is not None
    with pytest.raises(ParameterError) as caught:
        make()
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["foliage", "interior", "fence"])
@pytest.mark.parametrize("count", [1, 2, 7, 32])
def test_hard_scenes_have_as_many_lights_as_asked_for(name: str, count: int) -> None:
    one, many = SCENES[name](), SCENES[name](lights=count)
    assert len(many.lights) == count
    assert len({light.color for light in many.lights}) == (count if name != "interior" else min(count, 3))
    assert all(light.extent > 0 for light in many.lights)  # each has a size
    assert _digest(many.with_(lights=one.lights)) == _digest(one)


def test_bars_of_the_fence_are_thinner_than_a_texel_and_stand_in_grazing_light() -> None:
    scene = fence()
    forward = np.array(LATE_SUN) / np.linalg.norm(LATE_SUN)
    assert math.radians(5) < math.asin(-forward[1]) < math.radians(15)
    across = np.cross(forward, (0, 1, 0))
    across /= np.linalg.norm(across)
    seen = box_corners(*scene.bounds) @ np.stack([across, np.cross(across, forward)], 1)
    texel = float(np.ptp(seen, axis=0).max()) / 1024
    assert 0.7 * texel > 2 * BAR
    (light,) = scene.lights
    assert isinstance(light, DirectionalLight)
    assert light.angular_diameter == SUN_DIAMETER == pytest.approx(2 * 696e6 / 149.6e9, rel=0.01)


def test_each_bar_of_the_fence_draws_its_shadow() -> None:
    """Along a line on the ground beside the fence, shadow and light take turns as often as there are bars."""
    scene = fence()
    x = np.linspace(-0.6, 0.9, 1500)
    z = np.full_like(x, 0.5)
    points = np.stack([x, dunes(x, z) + 0.02, z], 1)
    shade = _in_shadow(points, np.array(LATE_SUN), _world(scene, "bars"))
    shadows_seen = np.count_nonzero(np.diff(shade.astype(int)) > 0)
    assert 0.04 < shade.mean() < 0.4
    assert shadows_seen >= 0.7 * 1.5 / PITCH * abs(LATE_SUN[2]) / math.hypot(LATE_SUN[0], LATE_SUN[2])


def test_leaves_are_cut_out_of_their_cards_and_shade_the_wall() -> None:
    scene = foliage()
    leaves = [i.mesh for i in scene.instances if i.name in OPEN["foliage"]]
    for mesh in leaves:
        assert mesh.material.alpha_mode == "mask"
        assert mesh.material.double_sided
        assert mesh.material.base_color_texture is not None
        alpha = mesh.material.base_color_texture.image.pixels[..., 3]
        assert 0.1 < np.mean(alpha > 127) < 0.6
        assert set(np.unique(alpha)) == {0, 255}
        assert mesh.uvs is not None
        assert np.ptp(mesh.uvs, axis=0) == pytest.approx((1, 1))
    light = scene.lights[0]
    assert isinstance(light, DirectionalLight)
    wall = np.random.default_rng(0).uniform((-1.5, 0.5, 0.001), (2.0, 2.5, 0.001), (300, 3))
    assert 0.1 < _in_shadow(wall, np.array(light.direction), _world(scene, *OPEN["foliage"])).mean() < 0.8


def test_camera_of_interior_is_inside_the_shadow_of_a_closed_solid() -> None:
    """No point of the bulb is seen from the camera or from its near plane: the table top hides it."""
    scene = interior()
    (light,) = scene.lights
    assert isinstance(light, PointLight)
    assert (light.position, light.radius) == (BULB, BULB_RADIUS)
    table = _world(scene, "table")
    ends = np.array(BULB) + np.concatenate([np.zeros((1, 3)), BULB_RADIUS * np.eye(3), -BULB_RADIUS * np.eye(3)])
    for start in scene.camera.position + 0.02 * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)]):
        assert _blocked(np.broadcast_to(start, ends.shape), ends, table).all()
    # The volume counts: from the lit middle of the room to the camera a ray enters it once more than it leaves it.
    lit = np.array((0.3, 0.3, 0.3))
    assert not _blocked(lit[None], np.array(BULB)[None], _world(scene)).any()


def test_interior_is_closed_and_its_lampshade_is_open() -> None:
    scene = interior()
    walls = _world(scene, "walls", "floor")
    rng = np.random.default_rng(0)
    out = rng.normal(size=(2000, 3))
    out *= 20 / np.linalg.norm(out, axis=1, keepdims=True)
    start = np.broadcast_to((0.0, 1.2, 0.0), out.shape)
    assert _blocked(start, start + out, walls).all()
    shade = next(i.mesh for i in scene.instances if i.name == "lampshade")
    assert open_edges(shade.positions, shade.indices) == 2 * 72  # the rims above and below
    assert shade.material.double_sided
    bulb = np.broadcast_to(BULB, out.shape)
    escapes = ~_blocked(bulb, bulb + out, _world(scene, "lampshade"))
    assert 0.1 < escapes.mean() < 0.8
    assert escapes[out[:, 1] > 19].all()
    assert escapes[out[:, 1] < -19].all()


def test_curves_of_interior_shade_themselves() -> None:
    scene = interior()
    for name in ("knot", "ribbon"):
        part = _world(scene, name)
        centres = part.mean(axis=1)
        normal = np.cross(part[:, 1] - part[:, 0], part[:, 2] - part[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        facing = np.einsum("ij,ij->i", normal, np.array(BULB) - centres) > 0.1
        start = (centres + 0.004 * normal)[facing][::7]
        assert 0.02 < _blocked(start, np.broadcast_to(BULB, start.shape), part).mean() < 0.7, name


def _blocked(starts: Floats, ends: Floats, triangles: Floats) -> NDArray[np.bool_]:
    """Whether a triangle crosses each segment (Möller and Trumbore 1997)."""
    a, edge1, edge2 = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    blocked = np.zeros(len(starts), bool)
    for k, (start, end) in enumerate(zip(starts, ends, strict=True)):
        way = np.asarray(end - start, np.float64)
        p = np.cross(way, edge2)
        determinant = np.einsum("ij,ij->i", edge1, p)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = start - a
            u = np.einsum("ij,ij->i", s, p) / determinant
            q = np.cross(s, edge1)
            v = q @ way / determinant
            t = np.einsum("ij,ij->i", edge2, q) / determinant
            blocked[k] = bool(((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-6) & (t < 1)).any())
    return blocked
