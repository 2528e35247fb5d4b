"""Shadows by rays: exactly lit, exactly dark, closed forms between, and means that forget what they should."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import props
import pytest
from props import WHITE, shoot

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.scene.bundled import primitives
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    Instance,
    Light,
    Medium,
    Mesh,
    PointLight,
    RectLight,
    Scene,
    SpotLight,
)
from tyndall.techniques.contract import Technique
from tyndall.techniques.shadow.ray_traced import RayTraced
from tyndall.techniques.shadow.shadow_map import ShadowMap
from tyndall.techniques.volumetric.march import March

SIZE = (64, 48)
ABOVE = Camera((2.5, 4, 4.5), (0, 0.3, 0), fov=0.8, near=0.05)
CUBE = props.box((-0.5, 0.4, -0.5), (0.5, 1.4, 0.5))
SUN = DirectionalLight((0.5, -1.0, -0.35), 3.0)


@contextmanager
def renderer(
    gpu: Gpu, scene: Scene, technique: RayTraced | None = None, size: tuple[int, int] = SIZE, **others: Any
) -> Iterator[Renderer]:
    chosen = {"volumetric": "off", "antialiasing": "none", "tonemap": "none", **others}
    with Renderer(scene, size, gpu=gpu, shadow=technique or RayTraced(), **chosen) as made:
        yield made


def answers(renderer: Renderer, frames: int, light: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Visibility (H, W) after that many frames, and of how many frames it is the mean."""
    held = {resource.label: resource for resource in renderer._views["shadow"].resources()}
    means = [held[label] for label in sorted(held) if ".means" in label]  # one where all lights are hard
    texture = means[(frames - 1) % len(means)]
    bits = renderer.gpu.read_texture(texture, layer=light)[..., 0]  # type: ignore[arg-type]
    return (bits >> 11) / 2**20, bits & 2047


def visible(gpu: Gpu, scene: Scene, technique: RayTraced | None = None, frames: int = 1, light: int = 0) -> np.ndarray:
    with renderer(gpu, scene, technique) as made:
        for _ in range(frames):
            made.draw()
        return answers(made, frames, light)[0]


def seen_points(scene: Scene, size: tuple[int, int] = SIZE) -> tuple[np.ndarray, props.Hit]:
    rays = props.rays(scene.camera, size)
    hit = props.cast(scene, rays.origin, rays.directions)
    return rays.at(np.where(np.isfinite(hit.distance), hit.distance, 0)), hit


def facing(light: Light, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Cosine between the normals and the direction to the light."""
    return -(props.arriving(light, 0.0, points)[1] * normals).sum(-1)


# --- hard shadows -------------------------------------------------------------------------------------------------

LIGHTS: list[Any] = [
    pytest.param(SUN, id="directional"),
    pytest.param(PointLight((-1.2, 2.2, 0.9), 20.0), id="point"),
    pytest.param(SpotLight((-1.5, 3.0, 0.5), (0.5, -1, -0.15), 40.0, (1, 1, 1), 0.5, 0.7), id="spot"),
]


@pytest.mark.parametrize("light", LIGHTS)
def test_hard_shadows_are_the_rays_answers(gpu: Gpu, light: Light) -> None:
    """0 or 1, and every pixel's the right one but for those within a hundredth of a pixel's width of an edge."""
    scene = Scene([props.floor(0, 4), CUBE], [light], ABOVE)
    got = visible(gpu, scene)
    points, hit = seen_points(scene)
    sure = np.isfinite(hit.distance) & (facing(light, points, hit.normal) > 0.05)
    if isinstance(light, SpotLight):
        sure &= props.arriving(light, 0.0, points)[0][..., 0] > 0
    truth = props.lit(scene, light, points + 1e-4 * hit.normal)
    for shift in 2e-3 * np.concatenate([np.eye(3), -np.eye(3)]):
        sure &= props.lit(scene, light, points + 3e-3 * hit.normal + shift) == truth
    assert set(np.unique(got)) == {0.0, 1.0}
    assert (truth & sure).sum() > 500
    assert (~truth & sure).sum() > 20
    assert (got == truth)[sure].all()


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("elevation", [85, 30, 3, 0.5])
@pytest.mark.parametrize("radius", [0.0, 0.004])
def test_what_nothing_shades_is_lit_at_any_scale(gpu: Gpu, scale: float, elevation: float, radius: float) -> None:
    """Exactly 1, from a scene of a millimetre to one of a kilometre, and where the light grazes."""
    e = math.radians(elevation)
    light = DirectionalLight((math.cos(e) * 0.8, -math.sin(e), math.cos(e) * 0.6), 5.0, angular_diameter=2 * radius)
    camera = Camera(tuple(scale * x for x in (2.5, 1.0, 4.5)), (0, 0, 0), fov=0.8, near=0.05 * scale)
    got = visible(gpu, Scene([props.floor(0, 4 * scale)], [light], camera), frames=2)
    onto = np.isfinite(seen_points(Scene([props.floor(0, 4 * scale)], camera=camera))[1].distance)
    assert onto.mean() > 0.3
    assert (got[onto] == 1).mean() > 0.995  # not at the silhouette, which the rasteriser may put a pixel further


@pytest.mark.parametrize("distance", [0.0, 2000.0])
def test_what_is_wholly_shaded_is_dark(gpu: Gpu, distance: float) -> None:
    """Exactly 0 under a roof, and for surfaces that touch their caster; also far away from the origin."""
    at = np.array([distance, 0, distance])
    move = np.eye(4)
    move[:3, 3] = at
    parts = [
        props.floor(0, 4),
        props.box((-4, 2.0, -4), (4, 2.2, 4)),
        props.box((-0.5, 0, -0.5), (0.5, 1.0, 0.5)),
    ]
    moved = [Instance(part.mesh, move) for part in parts]  # type: ignore[arg-type]
    camera = Camera(tuple(at + (1.8, 1.6, 2.6)), tuple(at + (0, 0.3, 0)), fov=0.9, near=0.05)
    for light in (DirectionalLight((0.1, -1, 0.05), 3.0), DirectionalLight((0.1, -1, 0.05), 3.0, (1, 1, 1), 0.02)):
        scene = Scene(moved, [light], camera)
        got = visible(gpu, scene, frames=2)
        points, hit = seen_points(scene)
        under = (
            np.isfinite(hit.distance) & (facing(light, points, hit.normal) > 0.05) & (np.abs(points - at).max(-1) < 1.5)
        )
        assert under.mean() > 0.25
        assert (got[under] == 0).all()


def test_a_convex_solid_is_lit_where_its_facets_face_the_light(gpu: Gpu) -> None:
    """A coarse ball with smooth normals: the facets decide, without acne before the terminator or leaks behind it."""
    part = primitives.ball(1.0, 8, 5)
    ball = Instance(Mesh(part.positions, part.indices, part.normals, material=WHITE))
    light = DirectionalLight((-0.8, -0.4, -0.3), 3.0)
    scene = Scene([ball], [light], Camera((-0.3, 1.0, 2.9), (0, 0, 0), fov=0.7, near=0.05))
    got = visible(gpu, scene)
    points, hit = seen_points(scene)
    cosine = facing(light, points, hit.normal)
    # Shading normals that face away receive nothing, and no ray is spent on them.
    smooth = facing(light, points, points / np.maximum(np.linalg.norm(points, axis=-1, keepdims=True), 1e-9))
    inner = np.isfinite(hit.distance) & (smooth > 0.1)
    for axis in (0, 1):  # not at an edge between facets, nor at the silhouette
        for step in (-1, 1):
            inner &= np.abs(np.roll(hit.normal, step, axis) - hit.normal).max(-1) < 1e-6
    assert (inner & (cosine > 1e-3)).sum() > 300
    assert (inner & (cosine < -1e-3)).sum() > 5
    assert (got[inner & (cosine > 1e-3)] == 1).all()
    assert (got[inner & (cosine < -1e-3)] == 0).all()


# --- soft shadows -------------------------------------------------------------------------------------------------


def disk_above_line(d: np.ndarray) -> np.ndarray:
    """The part of a unit disk on one side of a line at signed distance d from its centre: 1 for d ≥ 1."""
    d = np.clip(d, -1, 1)
    return 0.5 + (np.arcsin(d) + d * np.sqrt(1 - d * d)) / np.pi


def roof(height: float) -> Instance:
    """A level half plane at a height, over all x < 0."""
    return props.quad((-30, height, 30), (0, height, 30), (0, height, -30), (-30, height, -30))


def penumbra(light: Light, height: float, points: np.ndarray) -> np.ndarray:
    """The part of a small light that floor points see past the edge at x = 0, height up."""
    if isinstance(light, DirectionalLight):
        return disk_above_line(points[..., 0] / height / math.tan(light.angular_diameter / 2))
    # The edge as seen from a point, projected onto the light's height: a line across the light's disk.
    x, lamp = points[..., 0], np.array(light.position)
    line = x + (0 - x) * lamp[1] / height
    if isinstance(light, RectLight):
        return np.clip(0.5 + (lamp[0] - line) / light.width, 0, 1)
    return disk_above_line((lamp[0] - line) / light.radius)


@pytest.mark.parametrize(
    "light",
    [
        pytest.param(DirectionalLight((0, -1, 0), 3.0, angular_diameter=0.2), id="sun"),
        pytest.param(PointLight((0.2, 6.0, 0.0), 100.0, radius=0.3), id="lamp"),
        pytest.param(RectLight((0.2, 6.0, 0.0), (0, -1, 0), 100.0, width=0.5, height=0.3), id="panel"),
    ],
)
def test_the_penumbra_of_an_edge_is_the_closed_form(gpu: Gpu, light: Light) -> None:
    camera = Camera((0.4, 1.4, 0.2), (0.1, 0, 0), fov=0.7, near=0.05)
    scene = Scene([props.floor(0, 30), roof(2.0)], [light], camera)
    rays, frames = 16, 8
    got = visible(gpu, scene, RayTraced(samples=rays, fresh=1), frames=frames)
    points, hit = seen_points(scene)
    floor = hit.instance == 0
    expected = penumbra(light, 2.0, points)
    assert ((expected > 0.02) & (expected < 0.98) & floor).sum() > 400
    error = np.where(floor, got - expected, 0)
    deviation = np.sqrt(expected * (1 - expected) / (rays * frames))
    graded = floor & (expected > 0.05) & (expected < 0.95)
    z = error[graded] / deviation[graded]
    assert np.abs(z).max() < 4
    assert z.std() < 0.7, "the points must be more even than random ones"
    # The closed form takes the light for a flat disk across the mean direction: good to some thousandths.
    assert abs(error[graded].mean()) < 4e-3
    assert (got[floor & (expected == 0)] == 0).all()
    assert (got[floor & (expected == 1)] == 1).all()


def test_a_shrinking_light_ends_as_a_hard_one(gpu: Gpu) -> None:
    lamp = PointLight((-1.2, 2.2, 0.9), 20.0)
    shapes = [props.floor(0, 4), CUBE]
    hard = visible(gpu, Scene(shapes, [lamp], ABOVE))
    differs = []
    for radius in (0.4, 0.1, 0.025, 1e-4):
        scene = Scene(shapes, [replace(lamp, radius=radius)], ABOVE)
        differs.append(np.abs(visible(gpu, scene, RayTraced(samples=16, fresh=1)) - hard).mean())
    assert differs[0] > 0.02
    assert differs[0] > 2 * differs[1] > 4 * differs[2]
    assert differs[3] < 1e-3


def share(scene: Scene, light: RectLight, points: np.ndarray, normals: np.ndarray, count: int) -> np.ndarray:
    """The part of a rectangle's irradiance that reaches points, by count² points of it, and what all of it is."""
    across, along = light.axes
    towards = np.array(light.direction) / np.linalg.norm(light.direction)
    arrives, all_of_it = np.zeros(points.shape[:-1]), np.zeros(points.shape[:-1])
    for u, v in np.ndindex(count, count):
        at = light.position + (2 * (u + 0.5) / count - 1) * across + (2 * (v + 0.5) / count - 1) * along
        way = at - points
        r = np.linalg.norm(way, axis=-1)
        each = np.maximum((way * normals).sum(-1), 0) * np.maximum(-(way @ towards), 0) / r**4
        all_of_it += each
        arrives += each * props.lit(scene, PointLight(tuple(at)), points + 1e-4 * normals)
    return np.where(all_of_it > 0, arrives / np.maximum(all_of_it, 1e-30), 0)


@pytest.mark.parametrize(
    "panel",
    [
        pytest.param(
            RectLight((-1.2, 2.2, 0.9), (0.5, -1, -0.3), 20.0, width=1.2, height=0.4, rotation=0.6), id="aside"
        ),
        pytest.param(RectLight((0.1, 1.9, 0.3), (0, -1, 0.2), 20.0, width=2.5, height=1.5, rotation=0.6), id="close"),
        pytest.param(RectLight((-0.9, 0.3, 0.2), (1, 0.1, -0.4), 9.0, width=1.0, height=1.4, rotation=0.3), id="sunk"),
    ],
)
def test_a_panels_shadow_is_the_sum_over_its_points(gpu: Gpu, panel: RectLight) -> None:
    """Also close over the cube, whose own sides see the panel cut by their horizon, and half under the floor."""
    scene = Scene([props.floor(0, 4), CUBE], [panel], ABOVE)
    rays, frames, count = 32, 4, 20
    got = visible(gpu, scene, RayTraced(samples=rays, fresh=1), frames=frames)
    points, hit = seen_points(scene)
    points = points + 1e-5 * hit.normal
    expected = share(scene, panel, points, hit.normal, count)
    seen = np.isfinite(hit.distance)
    for axis in (0, 1):  # not at the silhouette, where the pixel's centre may be rasterised either way
        for step in (-1, 1):
            seen &= np.abs(np.roll(hit.normal, step, axis) - hit.normal).max(-1) < 1e-6
    graded = seen & (expected > 0.03) & (expected < 0.97)
    assert graded.sum() > 200
    error = (got - expected)[graded]
    assert np.sqrt(np.mean(error**2)) < 1.5 / math.sqrt(rays * frames) * 0.5
    assert abs(error.mean()) < 4e-3
    # An edge may lie between the sum's points.
    assert (got[seen & (expected == 1)] > 0.97).mean() > 0.99
    assert (got[seen & (expected == 1)] == 1).mean() > 0.9
    assert (got[seen & (expected == 0)] < 0.03).mean() > 0.99


def test_a_hard_light_stays_hard_beside_a_soft_one(gpu: Gpu) -> None:
    lights = [PointLight((-1.2, 2.2, 0.9), 20.0, radius=0.2), SUN, PointLight((1.0, 3.0, 0.0), 9.0)]
    shapes = [props.floor(0, 4), CUBE]
    for index in (1, 2):
        together = visible(gpu, Scene(shapes, lights, ABOVE), frames=2, light=index)
        alone = visible(gpu, Scene(shapes, [lights[index]], ABOVE))
        assert np.array_equal(together, alone)


def test_a_light_that_the_point_is_inside_of_fills_a_half_space(gpu: Gpu) -> None:
    scene = Scene([props.floor(0, 4)], [PointLight((0, 0.5, 0), 9.0, radius=2.0)], ABOVE)
    got = visible(gpu, scene, RayTraced(samples=16, fresh=1))
    assert np.isfinite(got).all()
    assert got.max() == 1


@pytest.mark.parametrize("height", [90, 30, 15, 10, 5, 0, -5, -10, -14])
@pytest.mark.parametrize("wall", [False, True])
def test_a_light_sets_over_its_whole_width(gpu: Gpu, height: float, wall: bool) -> None:
    """The irradiance of a matte floor by a wide sun at an angle over the horizon, open or behind a wall that hides one
    half of the sky and so of the sun, against a sum over the sun's directions.
    """
    half, zenith = 0.25, math.radians(90 - height)
    sun = DirectionalLight((-math.sin(zenith), -math.cos(zenith), 0), 3.0, angular_diameter=2 * half)
    camera = Camera((0.4, 0.5, 0.6), (0.3, 0, 0.2), fov=0.7, near=0.05)
    aside = props.quad(
        (900, -900, 0), (-900, -900, 0), (-900, 900, 0), (900, 900, 0), replace(WHITE, double_sided=True)
    )
    shapes = [props.floor(0, 400), *([aside] if wall else [])]
    got = shoot(gpu, Scene(shapes, [sun], camera), SIZE, shadow=RayTraced(samples=64, fresh=1), frames=4).base[..., 0]
    straight = Scene(shapes[:1], [DirectionalLight((0, -1, 0), 3.0)], camera)
    full = shoot(gpu, straight, SIZE).base[..., 0]
    cosine = 1 - (1 - math.cos(half)) * (np.arange(400)[:, None] + 0.5) / 400
    turn = 2 * math.pi * (np.arange(400) + 0.5) / 400
    up = cosine * math.cos(zenith) + np.sqrt(1 - cosine**2) * np.cos(turn) * math.sin(zenith)
    exact = np.maximum(up, 0).mean() * 2 / (1 + math.cos(half)) * (0.5 if wall else 1)
    points, hit = seen_points(Scene(shapes, camera=camera))
    floor = (hit.instance == 0) & (points[..., 2] > 0.02)
    assert floor.sum() > 1000
    # Beside the irradiance, the last bits of gloss of the roughest surface are seen.
    assert np.mean((got / full)[floor]) == pytest.approx(exact, rel=0.02, abs=5e-4)


# --- means over frames --------------------------------------------------------------------------------------------

SOFT = Scene([props.floor(0, 4), CUBE], [DirectionalLight((0.5, -1.0, -0.35), 3.0, angular_diameter=0.3)], ABOVE)


def test_a_still_picture_is_the_mean_of_all_its_frames(gpu: Gpu) -> None:
    """Frames of one sample each are the same samples as one frame of many: equal but for 20 bits of rounding."""
    with renderer(gpu, SOFT, RayTraced(samples=1, fresh=1)) as one:
        for _ in range(40):
            one.draw()
        gathered, frames = answers(one, 40)
    at_once = visible(gpu, SOFT, RayTraced(samples=40, fresh=1))
    begun = visible(gpu, SOFT, RayTraced(samples=1, fresh=15), frames=26)
    lit = frames > 0
    assert lit.mean() > 0.5
    assert (frames[lit] == 40).all()
    np.testing.assert_allclose(gathered, at_once, atol=40 * 2.0**-20)
    np.testing.assert_allclose(begun, at_once, atol=40 * 2.0**-20)


def test_the_error_falls_faster_than_at_random(gpu: Gpu) -> None:
    truth = visible(gpu, SOFT, RayTraced(samples=256, fresh=1), frames=4)
    errors = {}
    with renderer(gpu, SOFT, RayTraced(fresh=1)) as made:
        for frame in range(1, 65):
            made.draw()
            if frame in (1, 4, 16, 64):
                errors[frame] = math.sqrt(np.mean((answers(made, frame)[0] - truth) ** 2))
    assert errors[1] > 0.05
    assert errors[4] < 0.5 * errors[1]
    assert errors[16] < 0.25 * errors[1]
    assert errors[64] < 0.125 * errors[1]


def test_seeds_differ_and_repeat(gpu: Gpu) -> None:
    first, again, other = (shoot(gpu, SOFT, SIZE, shadow=RayTraced(), frames=2, seed=seed).base for seed in (3, 3, 4))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_restart_forgets(gpu: Gpu) -> None:
    with renderer(gpu, SOFT) as made:
        made.draw()
        first = answers(made, 1)
        for _ in range(4):
            made.draw()
        made.restart()
        made.draw()
        again = answers(made, 1)
    assert np.array_equal(first[0], again[0])
    assert again[1].max() == RayTraced().fresh


def moved(step: int) -> Camera:
    return replace(ABOVE, position=(2.5 + 0.04 * step, 4, 4.5 - 0.03 * step), target=(0.02 * step, 0.3, 0))


def test_a_moving_camera_takes_its_shadows_along(gpu: Gpu) -> None:
    """Most pixels keep their mean; it is better than one frame's, and not dragged to one side."""
    end = SOFT.with_(camera=moved(24))
    truth = visible(gpu, end, RayTraced(samples=256, fresh=1), frames=2)
    single = visible(gpu, end, RayTraced(fresh=1))
    with renderer(gpu, SOFT, RayTraced(fresh=1, history=16)) as made:
        for step in range(25):
            made.draw(moved(step))
        got, frames = answers(made, 25)
    shown = frames > 0
    assert frames.max() == 17  # those remembered and this one
    assert np.median(frames[shown]) >= 12
    assert np.sqrt(np.mean((got - truth) ** 2)) < 0.45 * np.sqrt(np.mean((single - truth) ** 2))
    assert abs((got - truth)[shown].mean()) < 0.01


def test_a_stop_soon_forgets_the_motion(gpu: Gpu) -> None:
    """What was gathered between pixels is blurred; it must neither stay in the mean for long nor go with a flicker."""
    end = SOFT.with_(camera=moved(24))
    truth = visible(gpu, end, RayTraced(samples=256, fresh=1), frames=2)
    errors = []
    with renderer(gpu, SOFT, RayTraced(fresh=1)) as made:
        for step in range(24 + 64):
            made.draw(moved(min(step, 24)))
            if step >= 24:
                got, frames = answers(made, step + 1)
                errors.append(math.sqrt(np.mean((got - truth) ** 2)))
    assert frames.max() == 4 + 61
    assert max(errors[:8]) < 1.1 * errors[0]
    assert errors[32] < 0.35 * errors[0]
    assert errors[63] < 0.25 * errors[0]


def test_jerky_motion_keeps_its_means(gpu: Gpu) -> None:
    """A camera that moves in every third frame alone is in motion."""
    with renderer(gpu, SOFT, RayTraced(fresh=1)) as made:
        for step in range(30):
            made.draw(moved(step // 3))
        _, frames = answers(made, 30)
    assert np.median(frames[frames > 0]) > 20


def test_what_comes_into_view_starts_anew(gpu: Gpu) -> None:
    """The floor that a post had hidden has no mean to begin with, nor takes it the post's."""
    post = props.box((-0.3, 0, 0.9), (0.3, 2.5, 1.1))
    scene = SOFT.with_(instances=(props.floor(0, 4), post))
    near = Camera((0, 1.5, 3.5), (0, 0.5, 0), fov=0.9, near=0.05)
    aside = replace(near, position=(0.5, 1.5, 3.5), target=(0.5, 0.5, 0))
    with renderer(gpu, scene, RayTraced(fresh=2)) as made:
        for _ in range(9):
            made.draw(near)
        made.draw(aside)
        _, frames = answers(made, 10)
    before = props.cast(scene, near.position, seen_points(scene.with_(camera=aside))[0] - near.position)
    points, hit = seen_points(scene.with_(camera=aside))
    hidden = (hit.instance == 0) & (before.distance < 0.97) & (frames > 0)
    uncovered = hidden & np.roll(hidden, 1, 1) & np.roll(hidden, -1, 1)  # not at the border
    kept = (hit.instance == 0) & (before.distance > 0.999) & (np.abs(points[..., 0]) < 1.5) & (frames > 0)
    assert uncovered.sum() > 20
    assert (frames[uncovered] == 2).mean() > 0.95
    assert np.median(frames[kept]) > 5


# --- the air ------------------------------------------------------------------------------------------------------

FOG = Medium(0.08, 0.02, bounds=((-6, -6, -12), (6, 6, 4)))


def shafts(lights: Sequence[Light]) -> Scene:
    shapes = [*props.slits(-3, 3, 0.5, 4), props.floor(-1.5, 12)]
    return Scene(shapes, lights, Camera((0.4, 0.3, 1.5), (0, 0, -4), fov=0.9, near=0.05), FOG)


def scattered(gpu: Gpu, scene: Scene, shadow: Technique, size: tuple[int, int] = (48, 36)) -> np.ndarray:
    return shoot(gpu, scene, size, volumetric=March(steps=32), shadow=shadow).inscattered


@pytest.mark.parametrize(
    "light",
    [DirectionalLight((0.3, -0.1, 1.0), 5.0), PointLight((0.5, 0.4, -7), 60.0)],
)
def test_rays_in_the_air_are_what_finer_and_finer_maps_approach(gpu: Gpu, light: Light) -> None:
    scene = shafts([light])
    rays = scattered(gpu, scene, RayTraced())
    differs = [props.difference(scattered(gpu, scene, ShadowMap(size=size)), rays) for size in (128, 512, 2048)]
    assert differs[1] < 0.6 * differs[0]
    assert differs[2] < 0.6 * differs[1]
    assert differs[2] < 0.03


def test_a_lights_radius_softens_its_shafts(gpu: Gpu) -> None:
    """The mean over frames is the mean of the shafts of suns that stand evenly over the light's disk."""
    sun = DirectionalLight((0.2, -0.1, 1.0), 5.0, angular_diameter=0.3)
    travel = np.array(sun.direction) / np.linalg.norm(sun.direction)
    across = np.cross(travel, (0, 1, 0)) / np.linalg.norm(np.cross(travel, (0, 1, 0)))
    size, count = (24, 18), 16
    with renderer(gpu, shafts([sun]), size=size, volumetric=March(steps=32)) as made:
        soft = np.zeros((18, 24, 3))
        for _ in range(count):
            made.draw()
            soft += made.inscattered() / count
    mean = np.zeros_like(soft)
    for i in range(count):
        r, angle = math.tan(0.15) * math.sqrt((i + 0.5) / count), i * math.pi * (3 - math.sqrt(5))
        tilted = travel + r * (math.cos(angle) * across + math.sin(angle) * np.cross(across, travel))
        mean += scattered(gpu, shafts([DirectionalLight(tuple(tilted), 5.0)]), RayTraced(), size) / count
    hard = scattered(gpu, shafts([replace(sun, angular_diameter=0.0)]), RayTraced(), size)
    assert props.difference(soft, mean) < 0.4 * props.difference(hard, mean)


def test_the_map_may_answer_for_the_air(gpu: Gpu) -> None:
    scene = shafts([PointLight((0.5, 0.4, -7), 60.0)])
    ours = shoot(gpu, scene, (32, 24), volumetric=March(steps=32), shadow=RayTraced(air="map", map_size=256))
    mapped = shoot(gpu, scene, (32, 24), volumetric=March(steps=32), shadow=ShadowMap(size=256))
    assert np.array_equal(ours.inscattered, mapped.inscattered)
    assert not np.array_equal(ours.base, mapped.base)


def test_a_technique_that_reads_maps_gets_them(gpu: Gpu) -> None:
    scene = shafts([DirectionalLight((0.3, -0.1, 1.0), 5.0)])
    ours = shoot(gpu, scene, (32, 24), volumetric="polygonal", shadow=RayTraced(map_size=256))
    mapped = shoot(gpu, scene, (32, 24), volumetric="polygonal", shadow=ShadowMap(size=256))
    assert np.array_equal(ours.inscattered, mapped.inscattered)
    assert ours.memory["shadow.ray_traced.shadow_map"] > 256 * 256 * 4


def test_maps_are_drawn_for_none_but_those(gpu: Gpu) -> None:
    scene = shafts([DirectionalLight((0.3, -0.1, 1.0), 5.0)])
    with renderer(gpu, scene, volumetric=March(steps=8)) as made:
        made.draw()
        assert "shadow.ray_traced.shadow_map" not in made.memory()
        hard = made.memory()["shadow.ray_traced"]
        assert hard < 1.01 * SIZE[0] * SIZE[1] * 4 + 100
        if times := made.timings():
            assert {name for name in times if name.startswith("shadow")} == {"shadow.ray_traced.hard"}


def test_what_casters_are_left_out_lets_all_light_through(gpu: Gpu) -> None:
    scene = shafts([DirectionalLight((0.3, -0.1, 1.0), 5.0)])
    with renderer(gpu, scene, size=(32, 24), volumetric=March(steps=32)) as made:
        made.draw(casters=False)
        ours = made.inscattered()
    with Renderer(scene, (32, 24), gpu=gpu, volumetric=March(steps=32), antialiasing="none") as other:
        other.draw(casters=False)
        np.testing.assert_allclose(ours, other.inscattered(), rtol=1e-5)
    assert ours.min() > 0
