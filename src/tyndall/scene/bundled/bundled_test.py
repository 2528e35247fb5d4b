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
from solids import face_normals, open_edges, volume

from tyndall.gpu.params import ParameterError
from tyndall.scene.bundled import SCENES, TRIANGLES, blinds, box, courtyard
from tyndall.scene.bundled.box import FRONT, HEIGHT, OCULUS, OCULUS_RADIUS, SUN
from tyndall.scene.model import DirectionalLight, Mesh, Scene

Floats = NDArray[np.floating[Any]]

# Surfaces without thickness: painted planes, foliage, water's jets excepted.
OPEN = {
    "blackboard", "cobbles", "foliage", "shrub", "fern", "bougainvillea", "fallen leaves", "grass",
}  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("TYNDALL_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module", params=list(SCENES))
def scene(request: pytest.FixtureRequest) -> Scene:
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
    expected = {"box": 4_968, "blinds": 607_402, "courtyard": 5_608_441}
    assert expected == TRIANGLES
    assert scene.triangle_count == expected[scene.name]


@pytest.mark.parametrize(
    ("name", "seed"), [("box", 1), ("box", 2**32 - 1), ("blinds", 1), ("blinds", 2), ("blinds", 3)]
)
def test_every_seed_has_the_exact_count(name: str, seed: int) -> None:
    assert SCENES[name](seed=seed).triangle_count == TRIANGLES[name]


def test_same_bits_for_a_seed(scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TYNDALL_CACHE", str(tmp_path))  # so that the courtyard, too, is modelled again
    assert _digest(SCENES[scene.name]()) == _digest(scene)


def test_seeds_differ() -> None:
    for make in (box, blinds):
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
        if mesh.name not in OPEN:
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


def test_medium_encloses_the_scene_and_the_camera(scene: Scene) -> None:
    assert scene.medium.bounds is not None
    low, high = np.asarray(scene.medium.bounds)
    assert (low <= scene.bounds[0] + 1e-5).all()
    assert (high >= scene.bounds[1] - 1e-5).all()
    assert (low < scene.camera.position).all()
    assert (high > scene.camera.position).all()
    assert min(scene.medium.scattering) > 0


def test_looks_carry_s1s_parameters(scene: Scene) -> None:
    assert {technique: set(look) for technique, look in scene.looks.items()} == {
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
