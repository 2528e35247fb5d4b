"""Shadows from the field: hard where rays say so, closed forms behind straight edges, and meshes beside."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import props
import pytest

from tyndall.gpu.device import Gpu
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    Implicit,
    Light,
    Medium,
    PointLight,
    RectLight,
    Scene,
    SpotLight,
)
from tyndall.sdf import box, sphere
from tyndall.techniques.shadow.field import FieldShadows
from tyndall.techniques.shadow.shadow_map import ShadowMap
from tyndall.techniques.volumetric.march import March

SIZE = (96, 72)
ABOVE = Camera((2.5, 4, 4.5), (0, 0.3, 0), fov=0.8, near=0.05)
BEHIND = (0, 0, -3.5)
FIELD = props.fields(Implicit(box(1).at(0, 0.9, 0)))
AS_MESH = props.box((-0.5, 0.4, -0.5), (0.5, 1.4, 0.5))


LARGER = props.box((-0.54, 0.36, -0.54), (0.54, 1.44, 0.54))


def on_floor(size: tuple[int, int] = SIZE) -> np.ndarray:
    """(H, W): which pixels show the floor beside the box, not its silhouette."""
    seen = props.rays(ABOVE, size)
    return np.isinf(props.cast(Scene([LARGER]), seen.origin, seen.directions).distance)


def received(gpu: Gpu, scene: Scene, **changes: Any) -> np.ndarray:
    return props.shade(gpu, scene, FieldShadows(**changes), SIZE)


def floor_points(camera: Camera, size: tuple[int, int] = SIZE) -> np.ndarray:
    """Where the floor y = 0 is behind each pixel, (H, W, 3)."""
    seen = props.rays(camera, size)
    return seen.at(-seen.origin[1] / seen.directions[..., 1])


LIGHTS: list[Any] = [
    pytest.param(DirectionalLight((0.5, -1.0, -0.35), 3.0), id="directional"),
    pytest.param(PointLight((-1.2, 2.2, 0.9), 20.0), id="point"),
    pytest.param(SpotLight((-1.5, 3.0, 0.5), (0.5, -1, -0.15), 40.0, (1, 1, 1), 0.5, 0.7), id="spot"),
    pytest.param(RectLight((-1.2, 2.2, 0.9), (0.5, -1, -0.3), 20.0, width=1e-5, height=1e-5), id="rect"),
]


@pytest.mark.parametrize("light", LIGHTS)
def test_hard_shadows_are_the_rays_answers(gpu: Gpu, light: Light) -> None:
    scene = Scene([props.floor(0, 4)], [light], ABOVE, implicits=FIELD)
    got = received(gpu, scene)
    meshes = Scene([AS_MESH], [light])
    points = floor_points(ABOVE)
    onto = (np.abs(points[..., [0, 2]]).max(-1) < 3.9) & on_floor()
    truth = props.lit(meshes, light, points)
    sure = onto.copy()
    for shift in 2e-2 * np.concatenate([np.eye(3)[[0, 2]], -np.eye(3)[[0, 2]]]):
        sure &= props.lit(meshes, light, points + shift) == truth
    assert (sure & truth).sum() > 500
    assert (sure & ~truth).sum() > 20
    np.testing.assert_allclose(got[sure], truth[sure], atol=0.01)


@pytest.mark.parametrize("thickness", [2.0, 0.01])
@pytest.mark.parametrize("height", [0.5, 2.0])
@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_a_straight_edge_leaves_its_part_of_the_light(gpu: Gpu, height: float, thickness: float, turn: float) -> None:
    """A sheet before a wall, thin or thick: the penumbra is the part of a disk beside a line, on both sides of it."""
    camera = Camera((0, 0, 0.9 * height - 3), (0, 0, -3), fov=0.4, near=0.02)
    light = DirectionalLight((0, 0, -1), 1.0, angular_diameter=0.2)
    sheet = box((8, 16, thickness)).at(-4, 0, height - 3 + 0.5 * thickness).rotate(turn)
    got = received(
        gpu, Scene([props.wall(-3, 4)], [light], camera, implicits=props.fields(Implicit(sheet), specks=BEHIND))
    )
    seen = props.rays(camera, SIZE)
    points = seen.at((-3 - seen.origin[2]) / seen.directions[..., 2])
    across = points[..., 0] * math.cos(turn) + points[..., 1] * math.sin(turn)
    edge = np.where(across < 0, height, height + thickness)  # of a thick sheet, which one cuts the light
    want = props.disk_part(across / (edge * math.tan(0.1)))
    off = got - want
    assert np.abs(off).max() < 0.1
    assert np.abs(off[want > 0.15]).max() < 0.065
    assert abs(off.mean()) < 0.012


BIG: list[Any] = [
    pytest.param(DirectionalLight((0.5, -1.0, -0.35), 3.0, angular_diameter=0.3), id="directional"),
    pytest.param(PointLight((-1.2, 2.9, 0.9), 20.0, radius=0.3), id="point"),
    pytest.param(SpotLight((-1.5, 3.0, 0.5), (0.5, -1, -0.15), 40.0, (1, 1, 1), 0.5, 0.7, radius=0.3), id="spot"),
    pytest.param(RectLight((-1.2, 2.9, 0.9), (0.5, -1, -0.3), 20.0, width=0.5, height=0.4), id="rect"),
]


def seen_parts(light: Light, points: np.ndarray, count: int = 128) -> np.ndarray:
    """The part of a light's points that no triangle of the box hides from points."""
    place = np.arange(count) + 0.5
    radius, angle = np.sqrt(place / count), place * 2.399963
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    seen = np.zeros(points.shape[:-1])
    scene = Scene([AS_MESH])
    for i in range(count):
        if isinstance(light, DirectionalLight):
            axis = -np.array(light.direction) / np.linalg.norm(light.direction)
            across = np.cross(axis, (0, 0, 1.0))
            across /= np.linalg.norm(across)
            along = np.cross(axis, across)
            tilt = math.tan(light.angular_diameter / 2) * (x[i] * across + y[i] * along)
            way = np.broadcast_to(axis + tilt, points.shape)
        elif isinstance(light, RectLight):
            across, along = light.axes
            u, v = 2 * (i + 0.5) / count - 1, 2 * (i * 0.61803398875 % 1) - 1
            way = light.position + u * across + v * along - points
        else:
            axis = light.position - points
            axis = axis / np.linalg.norm(axis, axis=-1, keepdims=True)
            across = np.cross(axis, (0, 0, 1.0))
            across /= np.linalg.norm(across, axis=-1, keepdims=True)
            along = np.cross(axis, across)
            way = light.position + light.radius * (x[i] * across + y[i] * along) - points
        length = np.linalg.norm(way, axis=-1, keepdims=True)
        hit = props.cast(scene, points, way / length).distance
        seen += hit > (np.inf if isinstance(light, DirectionalLight) else length[..., 0])
        if isinstance(light, DirectionalLight):
            seen += np.isinf(hit)
    return seen / count


@pytest.mark.parametrize("light", BIG)
def test_soft_shadows_of_all_kinds_of_light_are_near_the_truth(gpu: Gpu, light: Light) -> None:
    """And nearer than percentage-closer soft shadows of the same box as a mesh."""
    got = received(gpu, Scene([props.floor(0, 4)], [light], ABOVE, implicits=FIELD))[::2, ::2]
    pcss = props.shade(gpu, Scene([props.floor(0, 4), AS_MESH], [light], ABOVE), "pcss", SIZE)[::2, ::2]
    points = floor_points(ABOVE)[::2, ::2]
    sure = (np.abs(points[..., [0, 2]]).max(-1) < 3.5) & on_floor()[::2, ::2]
    truth = seen_parts(light, points[sure])
    assert ((truth > 0) & (truth < 1)).mean() > 0.02
    assert abs((got[sure] - truth).mean()) < 1.5e-3
    assert np.abs(got[sure] - truth).mean() < min(4e-3, np.abs(pcss[sure] - truth).mean())


@pytest.mark.parametrize("light", LIGHTS)
def test_one_ray_is_as_hard_as_many(gpu: Gpu, light: Light) -> None:
    """But for pixels at the edge, which a part of their width may move."""
    scene = Scene([props.floor(0, 4)], [light], ABOVE, implicits=FIELD)
    off = np.abs(received(gpu, scene, cones=1) - received(gpu, scene))[on_floor()]
    assert (off > 0.01).mean() < 0.005


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_one_ray_tells_a_thick_straight_edge(gpu: Gpu, turn: float) -> None:
    """On both sides of it. Of a thin sheet's penumbra only the lighter half, and darkness behind."""
    camera = Camera((0, 0, -1.2), (0, 0, -3), fov=0.4, near=0.02)
    light = DirectionalLight((0, 0, -1), 1.0, angular_diameter=0.2)
    for thickness in (2.0, 0.01):
        sheet = box((8, 16, thickness)).at(-4, 0, -1 + 0.5 * thickness).rotate(turn)
        fields = props.fields(Implicit(sheet), specks=BEHIND)
        got = received(gpu, Scene([props.wall(-3, 4)], [light], camera, implicits=fields), cones=1)
        seen = props.rays(camera, SIZE)
        points = seen.at((-3 - seen.origin[2]) / seen.directions[..., 2])
        across = points[..., 0] * math.cos(turn) + points[..., 1] * math.sin(turn)
        edge = np.where(across < 0, 2.0, 2.0 + thickness)
        want = props.disk_part(across / (edge * math.tan(0.1)))
        off = got - want
        sure = across > -0.2 if thickness > 1 else across > 0.01
        assert np.abs(off[sure]).max() < 0.1
        assert got[across < -0.22].max() < 0.01


@pytest.mark.parametrize("light", BIG)
def test_one_ray_is_not_far_from_the_truth(gpu: Gpu, light: Light) -> None:
    got = received(gpu, Scene([props.floor(0, 4)], [light], ABOVE, implicits=FIELD), cones=1)[::2, ::2]
    points = floor_points(ABOVE)[::2, ::2]
    sure = (np.abs(points[..., [0, 2]]).max(-1) < 3.5) & on_floor()[::2, ::2]
    truth = seen_parts(light, points[sure])
    assert np.abs(got[sure] - truth).mean() < 0.02


def test_what_is_smaller_than_the_light_hides_its_part_of_it(gpu: Gpu) -> None:
    """Of a ball in the middle of the light, the part of the disk that it covers, and no dark ring around that."""
    light = DirectionalLight((0, 0, -1), 1.0, angular_diameter=0.4)
    camera = Camera((0, 0, -1.3), (0, 0, -3), fov=0.5, near=0.02)
    for radius in (0.1, 0.2):
        ball = Implicit(sphere(radius).at(0, 0, -1))
        got = received(gpu, Scene([props.wall(-3, 4)], [light], camera, implicits=props.fields(ball, specks=BEHIND)))
        want = 1 - (radius / (2 * math.tan(0.2))) ** 2
        assert got[34:38, 46:50].mean() == pytest.approx(want, abs=0.08)
        assert got.min() > want - 0.12


def test_meshes_cast_beside_the_field(gpu: Gpu) -> None:
    """A scene of both is darkened by both; what a mesh hides is as dark as the map says."""
    light = DirectionalLight((0.5, -1.0, -0.35), 3.0)
    block = props.box((1.0, 0.2, 0.6), (1.6, 0.8, 1.2))
    both = received(gpu, Scene([props.floor(0, 4), block], [light], ABOVE, implicits=FIELD))
    field = received(gpu, Scene([props.floor(0, 4)], [light], ABOVE, implicits=FIELD))
    mesh = props.shade(gpu, Scene([props.floor(0, 4), block], [light], ABOVE), "shadow_map", SIZE)
    seen = props.rays(ABOVE, SIZE)
    floor = np.isinf(props.cast(Scene([block]), seen.origin, seen.directions).distance)
    assert (both < 0.5).sum() > (field < 0.5).sum() + 30
    off = np.abs(both - field * mesh)[floor]  # the maps of two scenes have other texels at their edges
    assert (off > 0.02).mean() < 0.003
    assert off.max() < 0.6


def test_the_terminator_fades_over_the_whole_light(gpu: Gpu) -> None:
    """A floor whose horizon cuts the light gets the part above it: the irradiance of rays, and no shade of its own."""
    for elevation in (0.3, 0.1, 0.02, -0.05):
        light = DirectionalLight((math.cos(elevation), -math.sin(elevation), 0), 3.0, angular_diameter=0.3)
        base = []
        far = props.fields(Implicit(sphere(0.1).at(0, 50, 0)))
        for shadow, implicits in (("ray_traced", ()), (FieldShadows(), far), (FieldShadows(cones=1), far)):
            scene = Scene([props.floor(0, 40)], [light], ABOVE, implicits=implicits)
            base.append(props.shoot(gpu, scene, (32, 24), shadow=shadow).base[..., 0])
        for one in base[1:]:
            np.testing.assert_allclose(one, base[0], rtol=0.02, atol=1e-3)


@pytest.mark.parametrize("elevation", [1.2, 0.3, 0.06])
def test_an_open_plane_shades_itself_by_one_ray_no_more_than_by_many(gpu: Gpu, elevation: float) -> None:
    own = props.fields(Implicit(box((40, 2, 40)).at(0, -1, 0)))
    for size in (0.0, 0.02):
        light = DirectionalLight((math.cos(elevation), -math.sin(elevation), 0), 3.0, angular_diameter=size)
        got = received(gpu, Scene([], [light], ABOVE, implicits=own), cones=1)
        assert got.min() > 0.98


def test_the_air_is_asked_too(gpu: Gpu) -> None:
    """Shafts of light through the field's shadow are those through the same mesh's."""
    light = DirectionalLight((0.5, -1.0, -0.35), 3.0)
    air = Medium(0.05)
    march = March(steps=32)
    of_mesh = Scene([props.floor(0, 4), AS_MESH], [light], ABOVE, air)
    of_field = Scene([props.floor(0, 4)], [light], ABOVE, air, implicits=FIELD)
    want = props.shoot(gpu, of_mesh, (48, 36), shadow="ray_traced", volumetric=march).inscattered
    got = props.shoot(gpu, of_field, (48, 36), shadow=FieldShadows(), volumetric=march).inscattered
    lit = props.shoot(gpu, of_mesh.with_(instances=of_mesh.instances[:1]), (48, 36), volumetric=march).inscattered
    floor = on_floor((48, 36))
    assert (want[floor] < 0.95 * lit[floor]).sum() > 50
    assert props.difference(got[floor], want[floor]) < 0.05


@pytest.mark.parametrize("beside", [False, True])
def test_who_walks_through_maps_gets_those_of_everything(gpu: Gpu, beside: bool) -> None:
    """The same light in the air as over plain shadow maps, with meshes that cast and without."""
    shapes = [props.floor(0, 4), props.box((1.0, 0.2, 0.6), (1.6, 0.8, 1.2))] if beside else []
    scene = Scene(shapes, [DirectionalLight((0.5, -1.0, -0.35), 3.0)], ABOVE, Medium(0.05), implicits=FIELD)
    shots = [
        props.shoot(gpu, scene, (32, 24), shadow=shadow, volumetric="polygonal").inscattered
        for shadow in (FieldShadows(map_size=512), ShadowMap(size=512))
    ]
    np.testing.assert_allclose(shots[0], shots[1], rtol=1e-3, atol=1e-5)


def test_without_implicit_surfaces_it_is_the_shadow_map(gpu: Gpu) -> None:
    scene = Scene([props.floor(0, 4), AS_MESH], [DirectionalLight((0.5, -1.0, -0.35), 3.0)], ABOVE)
    assert np.array_equal(received(gpu, scene), props.shade(gpu, scene, "shadow_map", SIZE))
