"""Traced light is that of closed forms and of brute force in float64, and its error is what it says."""

from __future__ import annotations

import dataclasses
import math
import os
from pathlib import Path

import numpy as np
import props
import pytest

from tyndall.gpu.device import Gpu, GpuError
from tyndall.gpu.params import ParameterError
from tyndall.lab import truth as module
from tyndall.lab.truth import BATCHES, Truth, TruthSettings, trace
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    HenyeyGreenstein,
    Instance,
    Isotropic,
    Light,
    Material,
    Medium,
    Mesh,
    PointLight,
    Rayleigh,
    RectLight,
    Scene,
    SpotLight,
)
from tyndall.techniques.shadow.ray_traced import RayTraced
from tyndall.techniques.shadow.shadow_map import ShadowMap
from tyndall.techniques.volumetric.march import March

SIZE = (16, 12)
SUN = DirectionalLight((0.3, -0.4, -1.0), 2.0, (1.0, 0.8, 0.5))
BULB = PointLight((0.4, 0.3, -2.0), 3.0, (0.5, 1.0, 0.8))
BEAM = SpotLight((0.6, 0.9, -1.5), (-0.3, -0.5, -0.6), 5.0, inner_angle=0.2, outer_angle=0.5)
FOG = Medium((0.3, 0.2, 0.1), (0.02, 0.05, 0.3), HenyeyGreenstein(0.4))
THICK = Medium((2.0, 0.5, 0.0), (0.0, 0.5, 4.0), Rayleigh())
QUICK = TruthSettings(target=0.0, samples=1024)
ROUGH = Material("rough", base_color=(0.8, 0.7, 0.6, 1), roughness=1.0)
BLACK = Material("black", base_color=(0, 0, 0, 1), roughness=1.0)


def traced(gpu: Gpu, scene: Scene, settings: TruthSettings = QUICK, size: tuple[int, int] = SIZE) -> Truth:
    """Without the disk, and with nothing left on the device."""
    before = gpu.ledger.by_owner()
    found = trace(scene, size, settings, gpu=gpu, cache=False)
    left = {k: v for k, v in gpu.ledger.by_owner().items() if k != "constants"}
    assert left == {k: v for k, v in before.items() if k != "constants"}
    assert all(np.isfinite(x).all() for x in (found.radiance, found.radiance_error, found.inscattered_error))
    return found


def assert_light(found: np.ndarray, error: np.ndarray, expected: np.ndarray, tolerance: float = 2e-4) -> None:
    """Equal to a few parts in ten thousand of the mean, beyond six of the standard errors; and those are small."""
    scale = float(np.mean(expected))
    off = np.abs(found - expected)
    worst = (off - 6 * error).max()
    assert worst <= tolerance * scale, (worst / scale, off.max() / scale)
    assert np.sqrt(np.mean(error**2)) < 0.02 * scale


def summed(scene: Scene, light: Light, distance: np.ndarray, steps: int = 6000) -> np.ndarray:
    """Unshadowed single scattering up to a distance, by midpoints: enough of them to resolve the edge of a cone."""
    medium, seen = scene.medium, props.rays(scene.camera, SIZE)
    total = np.zeros((*distance.shape, 3))
    for k in range(steps):
        s = distance * (k + 0.5) / steps
        irradiance, travels = props.arriving(light, medium.extinction, seen.at(s))
        p = props.phase(medium.phase, -(travels * seen.directions).sum(-1))
        total += p[..., None] * irradiance * np.exp(-np.array(medium.extinction) * s[..., None])
    return np.array(medium.scattering) * total * (distance / steps)[..., None]


# --- light without shadows ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("medium", [FOG, THICK, Medium()], ids=["fog", "thick", "vacuum"])
@pytest.mark.parametrize("light", [SUN, BULB, BEAM], ids=["sun", "bulb", "beam"])
def test_unshaded_light_is_that_of_closed_forms(gpu: Gpu, light: Light, medium: Medium) -> None:
    """Surfaces, transmittance, and single scattering before a wall: exact for all channels of a coloured medium."""
    material = Material("paint", base_color=(0.7, 0.4, 0.2, 1), roughness=0.6, emissive=(0.1, 0.0, 0.2))
    scene = Scene([props.wall(-4, material=material)], [light], props.AHEAD, medium, ambient=(0.1, 0.2, 0.3))
    found = traced(gpu, scene)
    distance = 4 * props.rays(scene.camera, SIZE).stretch
    np.testing.assert_allclose(found.depth, 4.0, rtol=1e-5)
    surfaces = props.surface_light(scene, SIZE, (0, 0, 1), distance)
    surfaces *= np.exp(-np.array(medium.extinction) * distance[..., None])
    np.testing.assert_allclose(found.surfaces, surfaces, rtol=1e-3, atol=1e-5)
    if not any(medium.scattering):
        assert not found.inscattered.any()
        return
    air = props.lit_slab(scene, SIZE, 0, distance) if light is SUN else summed(scene, light, distance)
    assert_light(found.inscattered, found.inscattered_error, air, 1e-3 if light is BEAM else 2e-4)
    np.testing.assert_array_equal(found.radiance, found.surfaces + found.inscattered)


def test_air_in_a_box_dims_only_there(gpu: Gpu) -> None:
    """The camera outside the box, the background behind it."""
    low, high = (-1.0, -0.5, -4.0), (0.5, 1.0, -2.0)
    medium = dataclasses.replace(FOG, bounds=(low, high))
    scene = Scene([], [SUN], props.AHEAD, medium, background=(0.2, 0.3, 0.4))
    found = traced(gpu, scene)
    enter, leave = props.hit_box((0, 0, 0), props.rays(scene.camera, SIZE).directions, low, high)
    leave = np.maximum(leave, enter)
    assert 10 < (leave > enter).sum() < SIZE[0] * SIZE[1] - 10
    dimmed = np.exp(-np.array(FOG.extinction) * (leave - enter)[..., None])
    np.testing.assert_allclose(found.surfaces, scene.background * dimmed, rtol=1e-4)
    assert np.isinf(found.depth).all()
    air = props.lit_slab(scene, SIZE, enter, leave, enter)
    assert_light(found.inscattered, found.inscattered_error, air)


def test_nothing_gives_nothing(gpu: Gpu) -> None:
    found = traced(gpu, Scene())
    assert not found.radiance.any()
    assert found.relative_error() == found.relative_error("inscattered") == 0
    assert np.isinf(found.depth).all()


def test_many_lights_are_chosen_from_without_bias(gpu: Gpu) -> None:
    """More lights than a sample asks: their sum, by a stratified choice."""
    rng = np.random.default_rng(5)
    lights = [DirectionalLight((x, y, -1), e) for x, y, e in rng.uniform((-1, -1, 0), (1, 1, 2), (40, 3))]
    scene = Scene([props.wall(-4)], lights, props.AHEAD, FOG)
    found = traced(gpu, scene)
    distance = 4 * props.rays(scene.camera, SIZE).stretch
    air = props.lit_slab(scene, SIZE, 0, distance)
    assert_light(found.inscattered, found.inscattered_error, air, 1e-3)
    surfaces = props.surface_light(scene, SIZE, (0, 0, 1), distance)
    surfaces *= np.exp(-np.array(FOG.extinction) * distance[..., None])
    assert_light(found.radiance, found.radiance_error, surfaces + air, 1e-3)


# --- shadows ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("light", [DirectionalLight((0.5, -1, -0.2), 2.0), PointLight((-1, 2, -5), 5.0)])
def test_shadows_are_where_geometry_says(gpu: Gpu, light: Light) -> None:
    """A box over a floor, pixel by pixel against rays cast in float64."""
    scene = Scene([props.floor(-1), props.box((-1, 0, -6), (0.2, 0.4, -4.5))], [light], props.AHEAD)
    size = (48, 36)
    found = traced(gpu, scene, TruthSettings(target=1, samples=32), size)
    seen = props.rays(scene.camera, size)
    hit = props.cast(scene, seen.origin, seen.directions)
    floor = hit.instance == 0
    points = seen.at(np.where(floor, hit.distance, 1.0))
    lit = props.lit(scene, light, points + 1e-4 * np.array([0, 1, 0]))
    expected = props.surface_light(scene, size, (0, 1, 0), np.where(floor, hit.distance, 1.0)) * lit[..., None]
    wrong = np.abs(found.radiance - expected).max(axis=-1) > 2e-3 * expected.max()
    assert (floor & ~lit).sum() > 15
    assert (wrong & floor).sum() <= 2, "but for a pixel on the very edge"


def test_shafts_are_lit_where_geometry_says(gpu: Gpu) -> None:
    """Air behind a window: the lit part of each ray is known in closed form."""
    sun = DirectionalLight((0.0, -1.0, 0.0), 3.0)
    # A roof with a hole 2 m deep in z, wider than the view: rays are in the light where z is in the hole.
    roof = [props.box((-30, 3, -40), (30, 3.2, -5)), props.box((-30, 3, -3), (30, 3.2, 40))]
    scene = Scene([*roof, props.wall(-8, material=BLACK)], [sun], props.AHEAD, Medium(0.2, 0.05))
    found = traced(gpu, scene, TruthSettings(target=0.002))
    seen = props.rays(scene.camera, SIZE)
    air = props.lit_slab(scene, SIZE, 3 * seen.stretch, 5 * seen.stretch)
    # Even points meet the shaft equally often in most batches, so that a single pixel's error is a coarse number.
    assert_light(found.inscattered, found.inscattered_error, air, 4e-3)
    off = np.sqrt(np.mean((found.inscattered - air) ** 2) / np.mean(found.inscattered_error**2))
    assert 0.7 < off < 1.4
    assert found.relative_error("inscattered") <= 0.002


def test_a_penumbra_is_half_lit_at_its_middle(gpu: Gpu) -> None:
    """A half plane before a ball of light, and before a sun with a size: seen from the edge's shadow, half is covered.
    The light far from the edge is that of the point.
    """
    edge = [props.box((-40, 1, -40), (0, 1.001, 40))]
    floor = props.floor(0, material=props.WHITE)
    above = Camera((0, 0.9, 0), (0, 0, 0), (0, 0, -1), fov=0.12, near=0.01)
    for light, point in (
        (PointLight((0, 2, 0), 4.0, radius=0.25), PointLight((0, 2, 0), 4.0)),
        (DirectionalLight((0, -1, 0), 1.0, angular_diameter=0.25), DirectionalLight((0, -1, 0), 1.0)),
    ):
        size = (41, 3)
        soft = traced(gpu, Scene([floor, *edge], [light], above), TruthSettings(target=0.002), size)
        open_ = traced(gpu, Scene([floor], [point], above), TruthSettings(target=1), size)
        part = (soft.radiance / open_.radiance).mean(axis=-1)[1]
        error = (soft.radiance_error / open_.radiance).max(axis=-1)[1]
        assert part[20] == pytest.approx(0.5, abs=5 * float(error[20]) + 2e-3)
        assert (np.diff(part) > -5 * error.max() - 1e-3).all()
        assert part[0] == 0
        # White paint is not quite Lambert's: the angles of the cone's directions tell a little.
        assert part[-1] == pytest.approx(1, rel=0.02)
        assert 2 <= ((part > 0.01) & (part < 0.99)).sum() < 20


PANEL = RectLight((0.4, 1.6, -2.5), (-0.2, -1.0, -0.3), 6.0, (1.0, 0.6, 0.3), width=1.5, height=0.5, rotation=0.3)


def test_a_rectangle_lights_a_floor_and_air_as_the_closed_forms_say(gpu: Gpu) -> None:
    """Lambert's sum at the floor, but for white paint's last gloss; in the air, isotropic and thin, the solid angle."""
    scene = Scene([props.floor(-1, 20, ROUGH)], [PANEL], props.AHEAD)
    found = traced(gpu, scene, TruthSettings(target=1e-3))
    seen = props.rays(scene.camera, SIZE)
    hit = props.cast(scene, seen.origin, seen.directions)
    onto = np.isfinite(hit.distance) & (found.depth < 8)
    expected = props.surface_light(scene, SIZE, hit.normal, np.where(onto, hit.distance, 1))
    assert onto.sum() > 50
    np.testing.assert_allclose(found.radiance[onto], expected[onto], rtol=0.02, atol=0.01 * expected[onto].max())
    air = Medium(1e-3, 0.0, Isotropic(), ((-9, -9, -9), (9, 9, 9)))
    thin = Scene([props.wall(-6, material=BLACK)], [PANEL], props.AHEAD, air)
    hazy = traced(gpu, thin, TruthSettings(target=2e-3))
    scattered = props.quadrature(thin, PANEL, SIZE, 0, 6 * seen.stretch)
    assert_light(hazy.inscattered, hazy.inscattered_error, scattered, 4e-3)


def test_ray_traced_tends_to_the_truth_of_a_rectangle(gpu: Gpu) -> None:
    """A large panel close over a box, half behind the horizon of its side."""
    panel = RectLight((-0.9, 0.2, -2.6), (0.9, -1.0, -0.2), 4.0, width=1.6, height=1.0, rotation=0.2)
    box = props.box((-0.5, -0.9, -3.4), (0.4, -0.3, -2.6), ROUGH)
    scene = Scene([props.floor(-1, 3, ROUGH), box, props.wall(-4.5, 4, ROUGH)], [panel], props.AHEAD)
    found = traced(gpu, scene, TruthSettings(target=3e-3))
    shot = props.shoot(gpu, scene, SIZE, shadow=RayTraced(samples=64, fresh=1), frames=4)
    hard = props.shoot(gpu, scene, SIZE, shadow=ShadowMap(size=1024))
    assert props.difference(shot.radiance, found.radiance) < 0.02
    assert shot.radiance.mean() == pytest.approx(float(found.radiance.mean()), rel=4e-3)
    assert props.difference(hard.radiance, found.radiance) > 0.1


def test_it_agrees_with_the_march_to_the_shadow_maps_error(gpu: Gpu) -> None:
    sun = DirectionalLight((0.6, -1.0, -0.3), 3.0)
    lamp = SpotLight((0.2, 1.5, -4.5), (0, -0.7, 1), 4.0, inner_angle=0.3, outer_angle=0.7)
    blinds = [props.floor(-1), *props.slits(-3, 2.0, 0.3, 4), props.wall(-6)]
    size = (24, 18)
    for light in (sun, lamp):
        scene = Scene(blinds, [light], props.AHEAD, Medium(0.1, 0.02, HenyeyGreenstein(0.3)))
        found = traced(gpu, scene, TruthSettings(target=0.01), size)
        shot = props.shoot(gpu, scene, size, volumetric=March(steps=256), shadow=ShadowMap(size=2048))
        assert props.difference(shot.inscattered, found.inscattered) < 0.03
        assert np.median(np.abs(shot.radiance - found.radiance)) < 0.01 * found.radiance.mean()
        assert shot.inscattered.mean() == pytest.approx(float(found.inscattered.mean()), rel=0.01)


def test_turning_the_world_turns_the_picture(gpu: Gpu) -> None:
    """A quarter turn about the view: the same light in another place, within the standard errors."""

    def turned(v: tuple[float, float, float]) -> tuple[float, float, float]:
        return -v[1], v[0], v[2]

    size = (16, 16)
    matrix = ((0, -1, 0, 0), (1, 0, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))
    shapes = [props.floor(-1), *props.slits(-3, 2.0, 0.3, 4), props.wall(-6)]
    lamp = SpotLight((0.5, 1.2, -2), (-0.2, -1, -0.4), 4.0, inner_angle=0.3, outer_angle=0.8)
    other = dataclasses.replace(lamp, position=turned(lamp.position), direction=turned(lamp.direction))
    settings = TruthSettings(target=0.01)
    a = traced(gpu, Scene(shapes, [lamp], props.AHEAD, FOG), settings, size)
    b = traced(gpu, Scene([Instance(i.mesh, matrix) for i in shapes], [other], props.AHEAD, FOG), settings, size)
    back = np.rot90(b.inscattered, -1)
    error = np.hypot(a.inscattered_error, np.rot90(b.inscattered_error, -1))
    assert_light(a.inscattered, error, back, 1e-3)


# --- the error ----------------------------------------------------------------------------------------------------


BLINDS = Scene(
    [props.floor(-1), *props.slits(-3, 2.0, 0.3, 6), props.wall(-6)],
    [DirectionalLight((0.6, -1.0, -0.3), 3.0)], props.AHEAD, FOG,
)  # fmt: skip


def runs(gpu: Gpu, samples: int, filter: str) -> tuple[np.ndarray, np.ndarray]:
    """In-scattered light and its standard error, (8 seeds, 9, 12, 3), of shafts through blinds."""
    made = [
        traced(gpu, BLINDS, TruthSettings(target=0, samples=samples, seed=seed, filter=filter), (12, 9))
        for seed in range(8)
    ]
    return np.stack([m.inscattered for m in made]), np.stack([m.inscattered_error for m in made])


@pytest.mark.parametrize("filter", ["centre", "box"])
def test_the_standard_error_is_the_spread_over_seeds(gpu: Gpu, filter: str) -> None:
    """With and without a plan; and the plan moves no mean."""
    even, even_error = runs(gpu, 128, filter)
    planned, planned_error = runs(gpu, 1024, filter)
    for light, error in ((even, even_error), (planned, planned_error)):
        spread = light.var(axis=0, ddof=1)
        # Thousands of samples of a variance, but the channels of a pixel and pixels of a shaft's edge go together.
        assert spread.sum() / np.square(error).mean(axis=0).sum() == pytest.approx(1, abs=0.3)
        z = (light - light.mean(axis=0)) / np.where(error > 1e-4, error, np.inf) * np.sqrt(8 / 7)
        assert 0.8 < z[error > 1e-4].std() < 2.0
    # Student's t of 16 batches has a standard deviation of 1.07.
    assert z[planned_error > 1e-4].std() < 1.3
    assert planned_error.mean() < 0.4 * even_error.mean()
    off = (planned - even).mean(axis=(0, 3))
    error = np.sqrt((np.square(even_error) + np.square(planned_error)).sum(axis=0).mean(axis=-1)) / 8
    assert abs(off.mean()) < 4 * np.sqrt(np.square(error).sum()) / error.size


def test_another_seed_is_another_picture_and_the_same_seed_the_same(gpu: Gpu) -> None:
    a, b, c = (traced(gpu, BLINDS, TruthSettings(target=0, samples=64, seed=seed), (12, 9)) for seed in (1, 1, 2))
    assert np.array_equal(a.inscattered, b.inscattered)
    assert not np.array_equal(a.inscattered, c.inscattered)


@pytest.mark.parametrize("depth", [2, 3])
def test_dim_and_bright_light_are_as_exact(gpu: Gpu, depth: int) -> None:
    """By powers of two, as these leave the same digits; squares of light range beyond float32 on both sides."""
    settings = TruthSettings(target=0, samples=1024, depth=depth)
    glow = Material(emissive=(0.2, 0.1, 0.0))

    def scaled(factor: float) -> Truth:
        bulb = dataclasses.replace(BULB, intensity=BULB.intensity * factor)
        wall = props.wall(-4, material=dataclasses.replace(glow, emissive=tuple(factor * e for e in glow.emissive)))
        scene = Scene((wall,), (bulb,), props.AHEAD, FOG, ambient=3 * (0.1 * factor,), background=3 * (factor,))
        return traced(gpu, scene, settings, (12, 9))

    middle = scaled(1.0)
    assert middle.relative_error("inscattered") > 1e-4
    for power in (-70, 60, 95):
        found = scaled(2.0**power)
        for name in ("radiance", "inscattered", "surfaces", "radiance_error", "inscattered_error"):
            assert getattr(found, name) * 2.0**-power == pytest.approx(getattr(middle, name), rel=1e-5, abs=1e-7)
        for kind in ("radiance", "inscattered"):
            assert found.relative_error(kind) == pytest.approx(middle.relative_error(kind), rel=1e-4)


def test_light_that_no_picture_can_hold_is_said(gpu: Gpu) -> None:
    bulb = dataclasses.replace(BULB, intensity=1e30, color=(0, 1e20, 0))
    with pytest.raises(ParameterError, match="beyond the range"):
        trace(Scene((props.wall(-4),), (bulb,), props.AHEAD, FOG), (12, 9), QUICK, gpu=gpu, cache=False)
    # The light itself is within it, what the wall reflects is not: the lamp is a decimetre off.
    near = PointLight((0, 0, -3.9), 1e30, (1e8, 1e8, 1e8))
    with pytest.raises(ParameterError, match="beyond the range"):
        trace(Scene((props.wall(-4),), (near,), props.AHEAD, FOG), (3, 3), QUICK, gpu=gpu, cache=False)


def test_it_stops_when_it_is_good_enough(gpu: Gpu) -> None:
    heard: list[float] = []
    coarse, fine = (
        trace(BLINDS, (12, 9), TruthSettings(target=t), gpu=gpu, cache=False, progress=heard.append)
        for t in (0.05, 0.01)
    )
    assert max(coarse.relative_error(), coarse.relative_error("inscattered")) <= 0.05
    assert max(fine.relative_error(), fine.relative_error("inscattered")) <= 0.01
    assert coarse.samples < fine.samples < 8192
    assert all(0 < f <= 1 for f in heard)
    assert heard[-1] == 1
    limited = trace(BLINDS, (24, 18), TruthSettings(target=0, samples=100), gpu=gpu, cache=False)
    assert 32 <= limited.samples <= 100
    hasty = trace(BLINDS, (24, 18), TruthSettings(target=0, seconds=0.2, samples=1 << 20), gpu=gpu, cache=False)
    assert hasty.samples < 1 << 18
    assert hasty.relative_error() > 0


# --- longer paths -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "medium",
    [Medium(0.5, phase=HenyeyGreenstein(0.6)), Medium((0.2, 0.7, 1.5)), Medium(0.6, phase=Rayleigh())],
    ids=["hazy", "coloured", "sky"],
)
def test_a_white_cloud_in_white_light_cannot_be_seen(gpu: Gpu, medium: Medium) -> None:
    """Scattering without absorption conserves light: radiance is 1 everywhere."""
    cloud = dataclasses.replace(medium, bounds=((-0.7, -0.5, -2.6), (0.6, 0.8, -1.4)))
    scene = Scene([], [], props.AHEAD, cloud, background=(1, 1, 1))
    found = traced(gpu, scene, TruthSettings(target=0, samples=256, depth=24), (8, 6))
    assert found.inscattered.max() > 0.2
    assert_light(found.radiance, found.radiance_error, np.ones((6, 8, 3)), 1e-3)


def test_orders_of_scattering_add_up(gpu: Gpu) -> None:
    """In endless air under a sun that nothing dims, each order is the albedo times the one before:
    L = p·E·ω·(1 + ω + … + ω^(depth − 2)).
    """
    medium = Medium((0.3, 0.2, 0.1), (0.1, 0.2, 0.3))
    albedo = np.array([0.75, 0.5, 0.25])
    for depth in (2, 3, 6):
        scene = Scene([], [DirectionalLight((0.3, -1, 0.2), 2.0)], props.AHEAD, medium)
        found = traced(gpu, scene, TruthSettings(target=0, samples=1024, depth=depth), (6, 4))
        expected = 2 / (4 * np.pi) * sum(albedo**k for k in range(1, depth))
        assert_light(found.radiance, found.radiance_error, np.broadcast_to(expected, (4, 6, 3)), 1e-3)


@pytest.mark.parametrize(
    "material",
    [
        Material("matte", base_color=(1, 0.5, 0.2, 1), roughness=1.0),
        Material("gloss", base_color=(0.8, 0.5, 0.2, 1), roughness=0.25),
        Material("metal", base_color=(1, 0.8, 0.4, 1), roughness=0.4, metallic=1.0),
    ],
    ids=lambda m: m.name,
)
def test_a_surface_under_an_even_sky_reflects_its_albedo(gpu: Gpu, material: Material) -> None:
    """∫ f cosθ dω for each pixel's direction, by quadrature over the hemisphere."""
    scene = Scene([props.wall(-2, material=material)], [], props.AHEAD, background=(1, 1, 1))
    found = traced(gpu, scene, TruthSettings(target=0, samples=1024, depth=3), (8, 6))
    nodes, weights = np.polynomial.legendre.leggauss(200)
    cosine = (nodes + 1) / 2
    azimuth = (np.arange(400) + 0.5) / 400 * 2 * np.pi
    c, a = np.meshgrid(cosine, azimuth, indexing="ij")
    s = np.sqrt(1 - c * c)
    to_light = np.stack([s * np.cos(a), s * np.sin(a), c], axis=-1)
    to_viewer = -props.rays(scene.camera, (8, 6)).directions
    expected = np.array(
        [
            (props.reflected(material, (0, 0, 1), v, to_light) * (weights[:, None, None] / 2)).sum(axis=(0, 1))
            for v in to_viewer.reshape(-1, 3)
        ]
    ).reshape(6, 8, 3) * (2 * np.pi / 400)  # fmt: skip
    assert_light(found.radiance, found.radiance_error, expected, 2e-3)


def test_a_glowing_wall_lights_the_floor_from_three_edges_on(gpu: Gpu) -> None:
    """The floor's light by quadrature over the wall; at two edges the wall is only seen."""
    glow = Material("glow", base_color=(0, 0, 0, 1), roughness=1.0, emissive=(3, 2, 1))
    paint = Material("paint", base_color=(0.5, 0.5, 0.5, 1), roughness=1.0)
    panel = props.quad((-1, -1, -4), (1, -1, -4), (1, 1, -4), (-1, 1, -4), glow)
    scene = Scene([props.floor(-1, material=paint), panel], [], props.AHEAD)
    dark = traced(gpu, scene, TruthSettings(target=1), (8, 6))
    found = traced(gpu, scene, TruthSettings(target=0, samples=8192, depth=3), (8, 6))
    seen = props.rays(scene.camera, (8, 6))
    hit = props.cast(scene, seen.origin, seen.directions)
    floor = (hit.instance == 0) & (hit.distance < 3.5)
    assert floor.sum() >= 8
    assert not dark.radiance[floor].any()
    np.testing.assert_allclose(
        dark.radiance[hit.instance == 1], np.broadcast_to((3, 2, 1), dark.radiance[hit.instance == 1].shape), rtol=1e-5
    )
    n = 120
    u = (np.arange(n) + 0.5) / n * 2 - 1
    x, y = (a.ravel() for a in np.meshgrid(u, u))
    on_panel = np.stack([x, y, np.full_like(x, -4.0)], axis=-1)
    for p, v, light, error in zip(
        seen.at(np.where(floor, hit.distance, 1.0))[floor], -seen.directions[floor], found.radiance[floor],
        found.radiance_error[floor], strict=True,
    ):  # fmt: skip
        way = on_panel - p
        r2 = (way**2).sum(axis=-1, keepdims=True)
        to_light = way / np.sqrt(r2)
        solid = (2 / n) ** 2 * np.abs(to_light[:, 2:]) / r2
        expected = (props.reflected(paint, (0, 1, 0), v, to_light) * solid * (3, 2, 1)).sum(axis=0)
        assert (np.abs(light - expected) < 5 * error + 0.01 * expected).all()


def test_more_edges_than_there_are_change_nothing(gpu: Gpu) -> None:
    """Black surfaces in air that only absorbs: paths of two edges are all there are."""
    medium = Medium(0.0, (0.1, 0.2, 0.3))
    paint = Material("paint", base_color=(0, 0, 0, 1), roughness=1.0, emissive=(1, 2, 3))
    scene = Scene([props.wall(-4, material=paint)], [], props.AHEAD, medium)
    two, five = (traced(gpu, scene, TruthSettings(target=1, depth=d)) for d in (2, 5))
    np.testing.assert_allclose(two.radiance, five.radiance, rtol=1e-6)


# --- the cache ----------------------------------------------------------------------------------------------------


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TYNDALL_CACHE", str(tmp_path))
    return tmp_path / "truth"


def files(cache: Path) -> list[Path]:
    return sorted(cache.rglob("*.*"))


def test_an_earlier_truth_serves_and_is_gone_on_from(gpu: Gpu, cache: Path) -> None:
    scene = Scene([*props.slits(-3, 2.0, 0.3, 4), props.wall(-6)], [SUN], props.AHEAD, FOG)
    first = trace(scene, SIZE, TruthSettings(target=0.01), gpu=gpu)
    assert len(files(cache)) == 1
    again = trace(scene, SIZE, TruthSettings(target=0.01), gpu=gpu)
    looser = trace(scene, SIZE, TruthSettings(target=0.04), gpu=gpu)
    for served in (again, looser):
        for name in ("radiance", "inscattered", "surfaces", "depth", "radiance_error", "inscattered_error"):
            assert np.array_equal(getattr(served, name), getattr(first, name)), name
        assert (served.samples, served.seconds, served.judge) == (first.samples, first.seconds, first.judge)
        assert served.batches == first.batches
    assert first.freedom is not None
    assert first.freedom >= BATCHES - 1
    assert looser.settings["target"] == 0.04

    finer = trace(scene, SIZE, TruthSettings(target=0.003), gpu=gpu)
    assert finer.samples > first.samples
    assert max(finer.relative_error(), finer.relative_error("inscattered")) <= 0.003
    z = (finer.inscattered - first.inscattered) / np.maximum(first.inscattered_error, 1e-6)
    assert 0.3 < z[first.inscattered_error > 1e-5].std() < 1.5
    assert len(files(cache)) == 1


def test_what_differs_is_traced_anew(gpu: Gpu, cache: Path) -> None:
    scene = Scene([props.wall(-6)], [SUN], props.AHEAD, FOG)
    quick = TruthSettings(target=1, samples=32)
    trace(scene, SIZE, quick, gpu=gpu)
    trace(scene.with_(name="another name"), SIZE, quick, gpu=gpu)
    assert len(files(cache)) == 1
    for other, size, settings in (
        (scene.with_(medium=THICK), SIZE, quick),
        (scene, (8, 8), quick),
        (scene, SIZE, dataclasses.replace(quick, seed=1)),
        (scene, SIZE, dataclasses.replace(quick, filter="box")),
        (scene, SIZE, dataclasses.replace(quick, depth=3)),
        (scene.with_(camera=dataclasses.replace(scene.camera, fov=0.5)), SIZE, quick),
    ):
        count = len(files(cache))
        trace(other, size, settings, gpu=gpu)
        assert len(files(cache)) == count + 1
    trace(scene.with_(ambient=(1, 1, 1)), SIZE, quick, gpu=gpu, cache=False)
    assert len(files(cache)) == 7


@pytest.mark.parametrize("damage", [b"", b"not a file of arrays", None])
def test_a_damaged_entry_is_traced_again(gpu: Gpu, cache: Path, damage: bytes | None) -> None:
    scene = Scene([props.wall(-6)], [SUN], props.AHEAD, FOG)
    first = trace(scene, SIZE, QUICK, gpu=gpu)
    (entry,) = files(cache)
    whole = entry.read_bytes()
    if damage is None:
        middle = len(whole) // 2
        damage = whole[:middle] + bytes(b ^ 255 for b in whole[middle : middle + 64]) + whole[middle + 64 :]
    entry.write_bytes(damage)
    again = trace(scene, SIZE, QUICK, gpu=gpu)
    assert np.array_equal(first.radiance, again.radiance)
    assert files(cache) == [entry]
    with np.load(entry) as file:
        assert np.array_equal(file["radiance"], first.radiance)


def test_a_worse_truth_replaces_no_better_one(gpu: Gpu, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two processes begin at once, and the hasty one ends last."""
    scene = Scene([*props.slits(-3, 2.0, 0.3, 4), props.wall(-6)], [SUN], props.AHEAD, FOG)
    better = trace(scene, SIZE, QUICK, gpu=gpu)
    (entry,) = files(cache)
    whole = entry.read_bytes()
    load, calls = module._load, []

    def late(entry: Path, size: tuple[int, int]) -> Truth | None:
        calls.append(entry)
        return None if len(calls) == 1 else load(entry, size)

    monkeypatch.setattr(module, "_load", late)
    worse = trace(scene, SIZE, TruthSettings(target=1, samples=64), gpu=gpu)
    assert worse.relative_error("inscattered") > better.relative_error("inscattered")
    assert entry.read_bytes() == whole


def test_truths_of_the_last_versions_of_the_code_stay(gpu: Gpu, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene([props.wall(-6)], [SUN], props.AHEAD, FOG)
    for version in range(6):
        monkeypatch.setattr(module, "version_of", lambda _, version=version: f"version{version}")
        trace(scene, SIZE, TruthSettings(target=1, samples=32), gpu=gpu)
        os.utime(cache / f"version{version}", (version, version))
    assert sorted(p.name for p in cache.iterdir()) == ["version2", "version3", "version4", "version5"]


def test_a_processors_truth_is_no_gpus(gpu: Gpu, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene([props.wall(-6)], [SUN], props.AHEAD, FOG)
    entry = module._entry(scene, SIZE, QUICK, gpu)
    assert module._entry(scene, SIZE, dataclasses.replace(QUICK, target=0.5), gpu) == entry
    other = "DiscreteGPU" if gpu.adapter_info["adapter_type"] == "CPU" else "CPU"
    monkeypatch.setitem(gpu.adapter_info, "adapter_type", other)
    assert module._entry(scene, SIZE, QUICK, gpu) != entry


def test_a_cache_that_cannot_be_written_is_no_error(gpu: Gpu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("TYNDALL_CACHE", str(tmp_path / "file"))
    scene = Scene([props.wall(-6)], [SUN], props.AHEAD, FOG)
    assert trace(scene, SIZE, TruthSettings(target=1, samples=32), gpu=gpu).radiance.any()


# --- bad input ----------------------------------------------------------------------------------------------------


def test_mistakes_are_one_line(gpu: Gpu) -> None:
    for size, kind in (((0, 4), GpuError), ((4.5, 4), ParameterError), ((4,), ParameterError)):
        with pytest.raises(kind) as caught:
            trace(Scene(), size, gpu=gpu, cache=False)  # type: ignore[arg-type]
        assert "\n" not in str(caught.value)
    with pytest.raises(ParameterError, match=r"scene: 'box' is no Scene"):
        trace("box", SIZE, gpu=gpu)  # type: ignore[arg-type]
    for changes in ({"depth": 1}, {"target": -1}, {"samples": 3}, {"filter": "round"}, {"seed": -1}):
        with pytest.raises(ParameterError, match=next(iter(changes))):
            TruthSettings(**changes)


def test_a_scene_that_does_not_fit_leaves_nothing(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gpu, "limits", {**gpu.limits, "max-buffer-size": 1 << 20})
    before = gpu.ledger.by_owner()
    with pytest.raises(GpuError, match="truth"):
        trace(Scene([props.wall(-6)], [SUN]), (640, 360), gpu=gpu, cache=False)
    assert gpu.ledger.by_owner() == before


def test_a_mesh_of_triangles_casts_its_own_shape(gpu: Gpu) -> None:
    """One triangle before the background: covered pixels are those whose centres it holds."""
    triangle = Mesh(np.array([(-1, -1, -3), (1, -1, -3), (0, 1, -3)]), np.array([(0, 1, 2)]), material=BLACK)
    scene = Scene([Instance(triangle)], [], props.AHEAD, background=(1, 1, 1))
    found = traced(gpu, scene, TruthSettings(target=1, samples=32), (40, 30))
    seen = props.rays(scene.camera, (40, 30))
    covered = np.isfinite(props.cast(scene, seen.origin, seen.directions).distance)
    assert np.array_equal(found.radiance[..., 0] == 0, covered)
    box = traced(gpu, scene, TruthSettings(target=0.001, filter="box"), (40, 30))
    area = (1 - box.radiance[..., 0]).sum() / (40 * 30)
    view = (2 * 3 * math.tan(0.45)) ** 2 * 40 / 30
    assert area == pytest.approx(2 / view, rel=2e-3)
