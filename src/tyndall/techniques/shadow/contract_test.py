"""What every shadow technique must get right: its answer against rays cast through the same triangles."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import props
import pytest
from props import WHITE, shoot

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.gpu.params import fields_of
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    Image,
    Instance,
    Light,
    Material,
    Medium,
    PointLight,
    RectLight,
    Scene,
    SpotLight,
    Texture,
)
from tyndall.techniques import FAMILIES, Technique
from tyndall.techniques.contract import Unsupported
from tyndall.techniques.shadow.planes import flatness, planes_of
from tyndall.techniques.volumetric.march import March

FAMILY = FAMILIES["shadow"]
# Members with parameters that put other code in their place.
VARIANTS: dict[str, tuple[str, dict[str, Any]]] = {"shadow_map-compute": ("shadow_map", {"rasterizer": "compute"})}
ALL = (*FAMILY.members, *VARIANTS)
SIZE = (96, 72)
ABOVE = Camera((2.5, 4, 4.5), (0, 0.3, 0), fov=0.8, near=0.05)
# Blurs of a texel or two, so that edges are where rays see them.
MAPS: dict[str, dict[str, Any]] = {
    "shadow_map": {"size": 1024},
    "pcf": {"size": 1024, "radius": 1.0},
    "pcss": {"size": 1024},
    "vsm": {"size": 512, "radius": 1.0},
    "esm": {"size": 512, "radius": 1.0},
    "evsm": {"size": 512, "radius": 1.0},
    "blurred": {"radius": 1, "sigma": 0.5, "depth_aware": True},
}
BLUR = {"blurred": 1}  # pixels by which an edge is spread on the screen
BIG = {
    "directional": {"angular_diameter": 0.2},
    "point": {"radius": 0.2},
    "spot": {"radius": 0.2},
    "rect": {"width": 0.4, "height": 0.3, "rotation": 0.5},
}

LIGHTS: list[Any] = [
    pytest.param(DirectionalLight((0.5, -1.0, -0.35), 3.0), id="directional"),
    pytest.param(DirectionalLight((1.0, -0.35, 0.2), 3.0), id="low sun"),
    pytest.param(DirectionalLight((0, -1, 0), 3.0), id="zenith"),
    pytest.param(PointLight((-1.2, 2.2, 0.9), 20.0), id="point"),
    pytest.param(SpotLight((-1.5, 3.0, 0.5), (0.5, -1, -0.15), 40.0, (1, 1, 1), 0.5, 0.7), id="spot"),
    pytest.param(RectLight((-1.2, 2.2, 0.9), (0.5, -1, -0.3), 20.0, width=1e-3, height=1e-3), id="rect"),
]


def make(name: str, **changes: Any) -> Technique:
    member, variant = VARIANTS.get(name, (name, {}))
    return FAMILY.make(member, changes={**MAPS.get(member, {}), **variant, **changes})


def served(scene: Scene, technique: Technique, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Where a technique says that it shades: everywhere, or on points of the planes that it chose."""
    if technique.receivers == "all":
        return np.ones(points.shape[:-1], bool)
    near = 2 * flatness(scene)
    found = np.zeros(points.shape[:-1], bool)
    for plane in planes_of(scene, technique.planes, technique.share):  # type: ignore[attr-defined]
        found |= (np.abs(points @ plane.normal + plane.offset) <= near) & (np.abs(normals @ plane.normal) > 0.9)
    return found


def off_edges(name: str, truth: np.ndarray) -> np.ndarray:
    """Where the truth is the same as far as a technique spreads edges over the screen."""
    reach = range(-BLUR.get(name, 0), BLUR.get(name, 0) + 1)
    return np.all([np.roll(truth, (i, j), (0, 1)) == truth for i in reach for j in reach], axis=0)


def seen_visibility(
    gpu: Gpu, scene: Scene, technique: Technique, size: tuple[int, int] = SIZE
) -> tuple[np.ndarray, np.ndarray, np.ndarray, props.Hit]:
    """(visibility, where it can be told, points, hit): drawn light over the closed form of the unshadowed surface."""
    (light,) = scene.lights
    seen = props.rays(scene.camera, size)
    hit = props.cast(scene, seen.origin, seen.directions)
    distance = np.where(np.isfinite(hit.distance), hit.distance, 1)
    full = props.surface_light(scene, size, hit.normal, distance)[..., 0]
    base = shoot(gpu, scene, size, shadow=technique).base[..., 0]
    # Not where the light grazes, nor at a silhouette, where the pixel's centre may be rasterised either way.
    depth = shoot(gpu, scene, size).depth * seen.stretch
    onto = np.isfinite(hit.distance) & np.isfinite(depth)
    sure = onto & (np.abs(np.where(onto, depth, 0) - distance) < 1e-3 * distance)
    _, travels = props.arriving(light, 0.0, seen.at(distance))
    cosine = -(travels * hit.normal).sum(-1)
    assert not base[sure & (cosine < -0.05)].any(), "what faces away from the light is dark"
    sure &= (full > 0.02 * full.max()) & (cosine > 0.05)
    sure &= served(scene, technique, seen.at(distance), hit.normal)
    return np.where(sure, base / np.where(sure, full, 1), 0), sure, seen.at(distance), hit


CUBE = props.box((-0.5, 0.4, -0.5), (0.5, 1.4, 0.5))


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("light", LIGHTS)
def test_a_cube_over_a_plane_as_rays_see_it(gpu: Gpu, name: str, light: Light) -> None:
    scene = Scene([props.floor(0, 4), CUBE], [light], ABOVE)
    visible, sure, points, _ = seen_visibility(gpu, scene, make(name))
    truth = props.lit(scene, light, points)
    sure &= off_edges(name, truth)
    assert (truth & sure).sum() > 500
    assert (~truth & sure).sum() > (20 if name in BLUR else 50)
    agree = (visible > 0.5) == truth
    assert agree[sure].mean() >= 0.99
    # A few texels away from an edge every pixel agrees: no acne, no leak.
    technique = make(name)
    texel = (10 if light.kind == "directional" else 6) / getattr(technique, "size", 1024)
    reach = (4 + 4 * getattr(technique, "radius", getattr(technique, "min_radius", 0))) * texel
    firm = sure.copy()
    for axis in range(3):
        for step in (-reach, reach):
            moved = points + step * np.eye(3)[axis]
            moved[..., 1] = np.maximum(moved[..., 1], 0)
            firm &= props.lit(scene, light, moved) == truth
    floor = firm & (points[..., 1] < 1e-3)
    assert floor.sum() > 500
    assert agree[floor].all()
    assert np.abs(visible - truth)[floor].max() < (0.1 if name in BLUR else 0.02)


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("elevation", [85, 60, 45, 30, 15, 6])
@pytest.mark.parametrize("azimuth", [0.0, 0.7])
def test_no_acne_on_a_plane(gpu: Gpu, name: str, elevation: float, azimuth: float) -> None:
    e = math.radians(elevation)
    light = DirectionalLight((math.cos(e) * math.cos(azimuth), -math.sin(e), math.cos(e) * math.sin(azimuth)), 5.0)
    scene = Scene([props.floor(0, 4), props.box((-4, -2, -4), (4, -1, 4))], [light], ABOVE)
    visible, sure, _, _ = seen_visibility(gpu, scene, make(name))
    assert sure.mean() > 0.6
    assert visible[sure].mean() >= 0.999
    assert visible[sure].min() >= 0.98


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("elevation", [60, 7, 1])
@pytest.mark.parametrize("boards", [False, True])
def test_no_acne_on_a_plane_that_lies_askew(gpu: Gpu, name: str, scale: float, elevation: float, boards: bool) -> None:
    """No box around its triangles hides what they do themselves; boards are a thousand times as long as wide."""
    turn = props.turned(0.35, 0.4)
    shape = props.boards(1000 * scale, scale, 8) if boards else props.floor(0, 20 * scale)
    e = math.radians(elevation)
    sun = DirectionalLight(turn.point(-math.cos(e) * 0.83, -math.sin(e), -math.cos(e) * 0.557), 3.0)
    camera = Camera(
        turn.point(0.1 * scale, 1.6 * scale, 3.5 * scale), turn.point(0, 0.5 * scale, 0), turn.point(0, 1, 0)
    )
    scene = Scene([turn.place(shape)], [sun], replace(camera, fov=0.9, near=0.05 * scale))
    lit = []
    for casters in (True, False):
        with Renderer(scene, SIZE, gpu=gpu, volumetric="off", antialiasing="none", shadow=make(name)) as renderer:
            renderer.draw(casters=casters)
            lit.append(renderer.base()[..., 0].astype(float))
    onto = lit[1] > 0
    assert onto.mean() > 0.4
    assert (lit[0] == lit[1])[onto].mean() > 0.9995


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("position", [(0, 2.0, 0), (1.5, 1.0, -1.0)])
def test_the_faces_of_a_point_light_meet_without_a_seam(
    gpu: Gpu, name: str, position: tuple[float, float, float]
) -> None:
    """A light in an empty room lights all of it, edges and corners of its cube map included."""
    room = props.box((-3, 0, -3), (3, 4, 3), replace(WHITE, double_sided=True))
    corner = Camera((-2.5, 3.5, -2.4), (2.0, 0.8, 2.1), fov=1.9, near=0.05)
    scene = Scene([room], [PointLight(position, 20.0)], corner)
    visible, sure, points, hit = seen_visibility(gpu, scene, make(name))
    assert sure.mean() > 0.8
    assert visible[sure].mean() >= 0.999
    # An exponential map is dim where a wall beside the place is blurred into it.
    assert visible[sure].min() >= (0.8 if name == "esm" else 0.95)
    way = points - np.array(position)
    largest = np.sort(np.abs(way), axis=-1)
    on_seam = sure & (largest[..., 2] - largest[..., 1] < 0.05)
    assert on_seam.sum() > 20, "the picture must show seams"
    assert len(np.unique(hit.normal.reshape(-1, 3).round(), axis=0)) >= 3


@pytest.mark.parametrize("name", ALL)
def test_a_shadow_across_the_faces_of_a_point_light(gpu: Gpu, name: str) -> None:
    """A bar that stands over a seam of the cube map throws one shadow."""
    light = PointLight((0, 2, 0), 20.0)
    bar = props.box((0.9, 0.9, -0.2), (1.2, 1.2, 1.6))  # direction (1, −1, ·): between +X and −Y
    scene = Scene([props.floor(0, 4), bar], [light], ABOVE)
    visible, sure, points, _ = seen_visibility(gpu, scene, make(name))
    truth = props.lit(scene, light, points)
    sure &= off_edges(name, truth)
    assert (~truth & sure).sum() > 50
    assert ((visible > 0.5) == truth)[sure].mean() >= 0.99


@pytest.mark.parametrize("name", ALL)
def test_a_spot_light_fades_at_its_cone(gpu: Gpu, name: str) -> None:
    """The map's border does not show: inside the cone everything is lit, outside all is dark by the falloff alone."""
    light = SpotLight((0.3, 3.0, 0.2), (0.1, -1, 0.05), 30.0, (1, 1, 1), 0.35, 0.6)
    scene = Scene([props.floor(0, 4)], [light], ABOVE)
    visible, sure, _, _ = seen_visibility(gpu, scene, make(name))
    assert 200 < sure.sum() < 0.8 * sure.size
    assert visible[sure].min() >= 0.98
    seen = props.rays(ABOVE, SIZE)
    hit = props.cast(scene, seen.origin, seen.directions)
    onto = np.isfinite(hit.distance)
    expected = props.surface_light(scene, SIZE, hit.normal, np.where(onto, hit.distance, 1))[..., 0]
    base = shoot(gpu, scene, SIZE, shadow=make(name)).base[..., 0]
    np.testing.assert_allclose(base[onto], expected[onto], atol=0.01 * expected.max())
    assert (base[onto] == 0).any()


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("light", LIGHTS)
def test_a_light_with_a_radius_is_hidden_whole_or_not_at_all(gpu: Gpu, name: str, light: Light) -> None:
    """Whatever a technique makes of the penumbra: what all points of the light reach is lit, what none does is dark."""
    big = replace(light, **BIG[light.kind])
    scene = Scene([props.floor(0, 4), CUBE], [big], ABOVE)
    visible, sure, points, hit = seen_visibility(gpu, scene, make(name))
    floor = sure & (hit.instance == 0)
    parts = [props.lit(scene, part, points) for part in _parts(big)]
    all_of_it, none_of_it = np.all(parts, axis=0), ~np.any(parts, axis=0)
    all_of_it &= off_edges(name, all_of_it) & floor
    none_of_it &= off_edges(name, none_of_it) & floor
    assert all_of_it.sum() > 500
    assert none_of_it.sum() > (5 if name in BLUR else 20)
    # The parts are the rim and beyond; the map's texels are left to the other tests.
    assert (visible[all_of_it] > 0.97).mean() > 0.995
    if name == "pcss":
        # The map shows the top of the cube alone, whose penumbra is wider than the bottom's, where the umbra ends.
        assert visible[none_of_it].mean() < 0.12
    else:
        assert (visible[none_of_it] < 0.03).mean() > 0.98


def _parts(light: Light) -> list[Light]:
    """Points on and a little outside of the rim of a light, and its centre."""
    rng = np.random.default_rng(2)
    found: list[Light] = [light]
    if isinstance(light, RectLight):
        across, along = light.axes
        corners = [1.1 * (u * across + v * along) for u in (-1, 0, 1) for v in (-1, 0, 1)]
        return [replace(light, position=tuple(np.array(light.position) + corner)) for corner in corners]
    for offset in rng.normal(size=(24, 3)):
        offset /= np.linalg.norm(offset)
        if isinstance(light, DirectionalLight):
            travel = np.array(light.direction) / np.linalg.norm(light.direction)
            across = np.cross(travel, offset)
            across *= 1.1 * math.tan(light.angular_diameter / 2) / np.linalg.norm(across)
            found.append(replace(light, direction=tuple(travel + across)))
        else:
            found.append(replace(light, position=tuple(np.array(light.position) + 1.1 * light.radius * offset)))
    return found


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize(
    "light",
    [
        pytest.param(DirectionalLight((0.3, -0.1, 1.0), 5.0), id="directional"),
        pytest.param(PointLight((1.5, 4.5, -6.0), 60.0), id="point"),
        pytest.param(SpotLight((0.5, 5.0, -6.5), (0.0, -1.2, 1.0), 90.0, (1, 1, 1), 0.4, 0.6), id="spot"),
        pytest.param(RectLight((0.5, 5.0, -6.5), (0.0, -1.2, 1.0), 60.0, width=1e-3, height=1e-3), id="rect"),
    ],
)
def test_the_air_is_shaded_as_rays_see_it(gpu: Gpu, name: str, light: Light) -> None:
    """Shafts through slits: the march's sum against the same sum over rays cast from the air."""
    medium = Medium(0.05, 0.01, bounds=((-6, -6, -8), (6, 6, 3)))
    camera = Camera((0.4, 0.3, 1.5), (0, 0, -4), fov=0.9, near=0.05)
    scene = Scene([*props.slits(-3, 3, 0.5, 3), props.floor(-1.5, 9)], [light], camera, medium)
    size, steps = (16, 12), 128
    # A blur moves the edges of shafts: moments bound what is lit from above.
    sharp = {"size": 1024, "radius": 0.0} if "radius" in {f.name for f in fields_of(type(make(name)))} else {}
    shot = shoot(gpu, scene, size, volumetric=March(steps=256, jitter=0), shadow=make(name, **sharp))
    got = shot.inscattered[..., 0]
    seen = props.rays(camera, size)
    begin, end = props.hit_box(seen.origin, seen.directions, *medium.bounds)  # type: ignore[misc]
    begin = np.maximum(begin, 0)
    end = np.minimum(end, shot.depth * seen.stretch)
    sigma = np.array(medium.extinction)
    total, shaded = np.zeros_like(got), 0.0
    for step in range(steps):
        t = begin + (end - begin) * (step + 0.5) / steps
        points = seen.at(t)
        irradiance, travels = props.arriving(light, sigma * (not isinstance(light, DirectionalLight)), points)
        p = props.phase(medium.phase, -(travels * seen.directions).sum(-1))
        lit = props.lit(scene, light, points)
        part = irradiance[..., 0] * p * lit * np.exp(-sigma[0] * (t - begin)) * (end - begin) / steps
        total += medium.scattering[0] * part
        shaded += (~lit).mean() / steps
    assert 0.1 < shaded < 0.9
    # Variances and exponentials bound what is lit from above, and texels at an edge are lit.
    assert props.difference(got, total) < (0.08 if name in ("vsm", "esm") else 0.03)


@pytest.mark.parametrize("name", ALL)
def test_a_scene_without_lights_or_shapes_is_drawn(gpu: Gpu, name: str) -> None:
    dark = shoot(gpu, Scene([props.floor(0, 4)], [], ABOVE, ambient=(0.5, 0.5, 0.5)), SIZE, shadow=make(name))
    assert dark.base[-1].min() == pytest.approx(0.5, rel=2e-3)
    light = DirectionalLight((0.3, -0.1, 1.0), 5.0)
    empty = Scene([], [light], ABOVE, Medium(0.05, bounds=((-1, -1, -1), (1, 1, 1))))
    if make(name).receivers == "planes":
        with pytest.raises(Unsupported, match=f"^{name}: shadows fall on planes only"):
            make(name).supports(empty)
        return
    got = shoot(gpu, empty, SIZE, volumetric="march", shadow=make(name)).inscattered
    seen = props.rays(ABOVE, SIZE)
    begin, end = props.hit_box(seen.origin, seen.directions, (-1, -1, -1), (1, 1, 1))
    expected = props.lit_slab(empty, SIZE, np.where(end > begin, begin, 0), np.where(end > begin, end, 0), begin)
    np.testing.assert_allclose(got[..., 0], np.where(end > begin, expected[..., 0], 0), rtol=1e-3, atol=1e-5)


def extremes() -> list[Any]:
    found = []
    for name, cls in FAMILY.members.items():
        for f in fields_of(cls):
            for value in (f.param.low, f.param.high):
                small = "size" not in f.name or value == f.param.low  # the largest map is a gigabyte
                # Of a small map, since a software adapter takes a minute for the widest blur of seven large ones.
                size = {"size": 128} if "size" in {g.name for g in fields_of(cls)} else {}
                if isinstance(value, (int, float)) and small:
                    changes = {**size, f.name: f.type(value)}
                    found.append(pytest.param(name, changes, id=f"{name}.{f.name}={value:g}"))
    return found


@pytest.mark.parametrize(("name", "changes"), extremes())
def test_the_ends_of_every_range_draw_something(gpu: Gpu, name: str, changes: dict[str, Any]) -> None:
    lights = [DirectionalLight((0.5, -1.0, -0.35), 3.0), PointLight((-1.2, 2.2, 0.9), 20.0, radius=0.1)]
    scene = Scene([props.floor(0, 4), CUBE], lights, ABOVE)
    technique = make(name, **changes)
    try:
        technique.supports(scene)
    except Unsupported as refusal:
        pytest.skip(str(refusal))
    base = shoot(gpu, scene, (24, 18), shadow=technique, frames=2).base
    assert np.isfinite(base).all()
    assert base.mean() > 0.1


CULLING = [("none", 0.99), ("back", 0.99), ("front", 0.985)]


@pytest.mark.parametrize(("cull", "share"), CULLING)
def test_any_culling_is_right_for_a_closed_caster(gpu: Gpu, cull: str, share: float) -> None:
    light = DirectionalLight((0.5, -1.0, -0.35), 3.0)
    scene = Scene([props.floor(0, 4), CUBE], [light], ABOVE)
    visible, sure, points, _ = seen_visibility(gpu, scene, make("shadow_map", cull=cull))
    assert ((visible > 0.5) == props.lit(scene, light, points))[sure].mean() >= share


@pytest.mark.parametrize("cull", ["back", "front"])
def test_a_mirrored_caster_is_culled_by_its_outside(gpu: Gpu, cull: str) -> None:
    """Mirroring turns the winding round; the shadow must not notice."""
    light = DirectionalLight((0.5, -1.0, -0.35), 3.0)
    mirror = ((-1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
    technique = make("shadow_map", cull=cull)
    plain = shoot(gpu, Scene([props.floor(0, 4), CUBE], [light], ABOVE), SIZE, shadow=technique)
    turned = Scene([props.floor(0, 4), Instance(CUBE.mesh, mirror)], [light], ABOVE)
    np.testing.assert_allclose(shoot(gpu, turned, SIZE, shadow=technique).base, plain.base, atol=1e-3)


def test_culling_back_faces_of_an_open_sheet_leaves_it_out(gpu: Gpu) -> None:
    """A sheet that turns its back to the light is drawn with 'none', left out with 'back', drawn with 'front'."""
    light = DirectionalLight((0, -1, 0), 3.0)
    sheet = props.quad((-1, 1, -1), (1, 1, -1), (1, 1, 1), (-1, 1, 1))  # faces down
    scene = Scene([props.floor(0, 4), sheet], [light], ABOVE)
    floor = props.cast(scene, ABOVE.position, props.rays(ABOVE, SIZE).directions).instance == 0
    dark = {}
    for cull in ("none", "back", "front"):
        base = shoot(gpu, scene, SIZE, shadow=make("shadow_map", cull=cull)).base[..., 0]
        dark[cull] = int((base < 0.1)[floor].sum())
    assert dark["none"] == dark["front"] > 300
    assert dark["back"] == 0


@pytest.mark.parametrize("name", ALL)
def test_holes_of_a_masked_caster_let_the_light_through(gpu: Gpu, name: str) -> None:
    pixels = np.full((4, 4, 4), 255, np.uint8)
    pixels[::2, ::2, 3] = pixels[1::2, 1::2, 3] = 0
    mask = Material(
        "mask", (1, 1, 1, 1), alpha_mode="mask", base_color_texture=Texture(Image(pixels), filter="nearest")
    )
    sheet = props.quad((-1, 1, 1), (1, 1, 1), (1, 1, -1), (-1, 1, -1), mask)
    light = DirectionalLight((0.2, -1.0, -0.1), 3.0)
    scene = Scene([props.floor(0, 4), sheet], [light], ABOVE)
    visible, sure, points, hit = seen_visibility(gpu, scene, make(name))
    floor = sure & (hit.instance == 0)
    truth = props.lit(scene, light, points)
    floor &= off_edges(name, truth)
    assert ((visible > 0.5) == truth)[floor].mean() >= 0.985
    under = floor & (np.abs(points[..., [0, 2]]) < 0.8).all(-1)
    assert 0.3 < truth[under].mean() < 0.7


def test_filters_differ_at_edges_only(gpu: Gpu) -> None:
    light = DirectionalLight((0.5, -1.0, -0.35), 3.0)
    scene = Scene([props.floor(0, 4), CUBE], [light], ABOVE)
    coarse = {"size": 128}
    hard, sure, _, _ = seen_visibility(gpu, scene, make("shadow_map", filtering="nearest", **coarse))
    soft, _, _, _ = seen_visibility(gpu, scene, make("shadow_map", filtering="linear", **coarse))
    between = (hard > 0.02) & (hard < 0.98) & sure
    assert not between.any(), "one texel's answer is yes or no"
    graded = (soft > 0.02) & (soft < 0.98) & sure
    assert 20 < graded.sum() < 0.2 * sure.sum()
    assert np.abs(hard - soft)[sure & ~graded].max() < 0.02


def test_the_edge_sharpens_with_the_map(gpu: Gpu) -> None:
    light = DirectionalLight((0.5, -1.0, -0.35), 3.0)
    scene = Scene([props.floor(0, 4), CUBE], [light], ABOVE)
    wrong = []
    for size in (64, 256, 1024):
        visible, sure, points, _ = seen_visibility(gpu, scene, make("shadow_map", size=size))
        wrong.append(np.abs(visible - props.lit(scene, light, points))[sure].mean())
    assert wrong[1] < 0.5 * wrong[0]
    assert wrong[2] < 0.5 * wrong[1]


def test_what_the_map_does_not_show_is_lit(gpu: Gpu) -> None:
    """A spot light's map covers its cone; the air and surfaces beside it are not shaded by the map's border."""
    light = SpotLight((0, 3, 0), (0, -1, 0), 30.0, (1, 1, 1), 0.2, 0.4)
    beside = props.box((1.8, 0.2, -0.4), (2.4, 0.8, 0.4))
    scene = Scene([props.floor(0, 4), beside], [light], ABOVE)
    empty = Scene([props.floor(0, 4)], [light], ABOVE)
    hit = props.cast(scene, ABOVE.position, props.rays(ABOVE, SIZE).directions)
    same = hit.instance != 1
    with_box, without = (shoot(gpu, s, SIZE, shadow=make("shadow_map")).base for s in (scene, empty))
    np.testing.assert_allclose(with_box[same], without[same], atol=2e-3 * without.max())
