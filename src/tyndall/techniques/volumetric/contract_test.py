"""What every volumetric technique must get right, whatever its method.

Each test runs on all members of the family, and on what is listed in :data:`VARIANTS`. Where a method cannot do what a
test asks, the reason stands in :data:`BLIND`; where it needs certain parameters to be exact at this size, in
:data:`SETTINGS`.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import cache
from typing import Any, Literal, get_args, get_origin

import numpy as np
import props
import pytest
from props import AHEAD, TINY, shoot

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.gpu.params import Field, fields_of, uniform_dtype
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    Gibbons,
    HenyeyGreenstein,
    Implicit,
    Instance,
    Isotropic,
    Material,
    Medium,
    PointLight,
    Rayleigh,
    RectLight,
    Scene,
    Schlick,
    SpotLight,
    Volume,
)
from tyndall.sdf import sphere
from tyndall.techniques import FAMILIES, Technique
from tyndall.techniques.contract import Unsupported
from tyndall.techniques.shadow.shadow_map import ShadowMap

FAMILY = FAMILIES["volumetric"]
# The same technique by another method, held to the same.
VARIANTS: dict[str, tuple[str, dict[str, Any]]] = {"polygonal_faces": ("polygonal", {"evaluate": "faces"})}
ALL = (*FAMILY.members, *VARIANTS)
LIT = tuple(name for name in ALL if name != "off")

SETTINGS: dict[str, dict[str, Any]] = {
    "froxel": {"grid": (*TINY, 64)},  # one column a pixel: what is left is the slices' error
    "march": {"steps": 256, "jitter": 0.0},
}
# What a method does not see, by its nature.
BLIND = {
    "screen_space": {
        "wall": "takes whatever is not sky for an occluder of a directional light",
        "off screen": "sees only occluders that are in the picture",
    },
}
AIR = Medium((0.3, 0.2, 0.1), (0.05, 0.02, 0.0), HenyeyGreenstein(0.3))
FROM_BEHIND = DirectionalLight((0.3, -0.5, -0.8), 2.0, (1.0, 0.8, 0.5))
FROM_AHEAD = DirectionalLight((0.1, -0.2, 1.0), 2.0, (1.0, 0.8, 0.5))
NARROW = Camera((0, 0, 0), (0, 0, -1), fov=0.2, near=0.05)


def make(name: str, **changes: Any) -> Technique:
    technique, variant = VARIANTS.get(name, (name, {}))
    return FAMILY.make(technique, changes={**SETTINGS.get(technique, {}), **variant, **changes})


def seeing(what: str) -> list[Any]:
    """The techniques, those skipped that are blind to ``what``."""
    return [
        pytest.param(name, marks=pytest.mark.skip(reason=f"{name} {BLIND[name][what]}"))
        if what in BLIND.get(name, {})
        else name
        for name in LIT
    ]


def assert_close(got: Any, expected: Any, tolerance: float) -> None:
    """Every pixel within ``tolerance`` of the picture's brightest, in each channel."""
    error = np.abs(np.asarray(got) - expected)
    peak = np.asarray(expected).max(axis=(0, 1))
    assert (error <= tolerance * peak + 1e-9).all(), f"off by {(error / (peak + 1e-30)).max():.4f} of the brightest"


# --- one slab of lit air ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", seeing("wall"))
@pytest.mark.parametrize(
    "phase",
    [Isotropic(), HenyeyGreenstein(0.7), HenyeyGreenstein(-0.3), Rayleigh(), Gibbons(), Schlick(0.5)],
    ids=lambda p: f"{p.kind}{getattr(p, 'g', '')}",
)
def test_air_before_a_wall_is_the_closed_form(gpu: Gpu, name: str, phase: Any) -> None:
    scene = Scene([props.wall(-6)], [FROM_BEHIND], AHEAD, Medium(AIR.scattering, AIR.absorption, phase))
    shot = shoot(gpu, scene, volumetric=make(name))
    distance = 6 * props.rays(AHEAD, TINY).stretch
    expected = props.lit_slab(scene, TINY, 0, distance)
    np.testing.assert_allclose(shot.inscattered, expected, rtol=0.005)
    passed = np.exp(-np.array(AIR.extinction) * distance[..., None])
    np.testing.assert_allclose(shot.transmittance, passed, rtol=1e-3)


@pytest.mark.parametrize("size", [(1, 1), (17, 5), (3, 40)])
@pytest.mark.parametrize("name", seeing("wall"))
def test_pictures_of_odd_sizes(gpu: Gpu, name: str, size: tuple[int, int]) -> None:
    """Sizes that fill no workgroup, and both aspects."""
    scene = Scene([props.wall(-6)], [FROM_BEHIND], AHEAD, AIR)
    changes = {"grid": (*size, 64)} if name == "froxel" else {}
    shot = shoot(gpu, scene, size, volumetric=make(name, **changes))
    expected = props.lit_slab(scene, size, 0, 6 * props.rays(AHEAD, size).stretch)
    np.testing.assert_allclose(shot.inscattered, expected, rtol=0.005)


def test_the_walls_distance_is_along_the_ray() -> None:
    """The test above tells distance along the ray from view depth: they differ by a third in the corners."""
    assert props.rays(AHEAD, TINY).stretch.max() > 1.2


@pytest.mark.parametrize("name", LIT)
@pytest.mark.parametrize("lower", [-5.0, 1.0], ids=["camera outside", "camera inside"])
def test_air_in_a_box_under_the_open_sky(gpu: Gpu, name: str, lower: float) -> None:
    low, high = (-1.2, -1.0, -5.0), (1.0, 1.1, lower + 2 if lower < 0 else lower)
    scene = Scene([], [FROM_AHEAD], AHEAD, Medium(AIR.scattering, AIR.absorption, AIR.phase, (low, high)))
    shot = shoot(gpu, scene, volumetric=make(name))
    near, far = props.hit_box((0, 0, 0), props.rays(AHEAD, TINY).directions, low, high)
    begin = np.maximum(near, 0)
    end = np.maximum(far, begin)
    assert (end == begin).any() == (lower < 0), "the box must miss the corners of the picture from outside"
    # A slice that the box's side cuts is interpolated by froxels: 1/64 of the light.
    assert_close(shot.inscattered, props.lit_slab(scene, TINY, begin, end, start=begin), 0.016)
    np.testing.assert_allclose(
        shot.transmittance, np.exp(-np.array(AIR.extinction) * (end - begin)[..., None]), rtol=1e-3
    )


@pytest.mark.parametrize("name", LIT)
def test_endless_air_under_the_open_sky(gpu: Gpu, name: str) -> None:
    scene = Scene([], [FROM_AHEAD], AHEAD, AIR, background=(5, 5, 5))
    shot = shoot(gpu, scene, volumetric=make(name))
    np.testing.assert_allclose(shot.inscattered, props.lit_slab(scene, TINY, 0, np.inf), rtol=0.005)
    assert not shot.transmittance[..., :2].any()
    np.testing.assert_allclose(shot.radiance, shot.inscattered, rtol=2e-3)


@pytest.mark.parametrize("name", seeing("wall"))
def test_a_horizon_between_ground_and_endless_air(gpu: Gpu, name: str) -> None:
    camera = Camera((0, 2, 0), (0, 1.9, -1), fov=0.9, near=0.05)
    scene = Scene([props.floor(0)], [FROM_BEHIND], camera, AIR)
    shot = shoot(gpu, scene, volumetric=make(name))
    seen = props.rays(camera, TINY)
    with np.errstate(divide="ignore"):
        distance = np.where(seen.directions[..., 1] < 0, -2 / seen.directions[..., 1], np.inf)
    ends = (np.abs(seen.at(np.where(np.isfinite(distance), distance, 0))[..., [0, 2]]) > 20).any(-1)
    distance[ends] = np.inf
    assert np.isfinite(distance).any()
    assert np.isinf(distance).any()
    assert_close(shot.inscattered, props.lit_slab(scene, TINY, 0, distance), 0.01)


@pytest.mark.parametrize("name", ALL)
def test_surfaces_are_dimmed_and_air_is_added(gpu: Gpu, name: str) -> None:
    scene = Scene([props.wall(-4)], [FROM_BEHIND], AHEAD, AIR, ambient=(0.2, 0.3, 0.4))
    shot = shoot(gpu, scene, volumetric=make(name))
    assert shot.base.min() > 0.1
    np.testing.assert_allclose(shot.radiance, shot.base * shot.transmittance + shot.inscattered, rtol=2e-3)
    if name == "off":
        assert not shot.inscattered.any()
        assert (shot.transmittance == 1).all()
    else:
        assert shot.transmittance.max() < 0.7


@pytest.mark.parametrize("name", LIT)
def test_thin_air_stays_finite_and_right(gpu: Gpu, name: str) -> None:
    bounds = ((-9, -9, -4), (9, 9, 1))
    for sigma in (0.0, 1e-9, 1e-5):
        scene = Scene([], [FROM_AHEAD], AHEAD, Medium(sigma, 0.0, Rayleigh(), bounds))
        shot = shoot(gpu, scene, volumetric=make(name))
        limit = sigma * 4 * props.rays(AHEAD, TINY).stretch[..., None] * np.array(FROM_AHEAD.color) * 2
        cosine = -(props.rays(AHEAD, TINY).directions @ FROM_AHEAD.direction) / np.linalg.norm(FROM_AHEAD.direction)
        expected = limit * props.phase(Rayleigh(), cosine)[..., None]
        np.testing.assert_allclose(shot.inscattered, expected, rtol=0.01)
        np.testing.assert_allclose(shot.transmittance, 1, atol=1e-3)


@pytest.mark.parametrize("name", LIT)
@pytest.mark.parametrize("scale", [1e-3, 1e5])
def test_a_scene_of_any_size_looks_the_same(gpu: Gpu, name: str, scale: float) -> None:
    """Lengths times s and coefficients over s leave every optical depth as it is: millimetres, or a city."""

    def light(s: float) -> Any:
        grown = np.diag([s, s, s, 1.0])
        boards = [Instance(board.mesh, grown) for board in props.slits(-3, 2.5, 0.5, 3)]
        camera = Camera((0, 0, 0), (0, 0, -s), fov=0.9, near=0.05 * s)
        return shoot(
            gpu, Scene(boards, [FROM_AHEAD], camera, Medium(0.15 / s, 0.05 / s)), volumetric=make(name)
        ).inscattered

    plain = light(1.0)
    assert plain.max() > 1.5 * plain.min()
    np.testing.assert_allclose(light(scale), plain, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("name", LIT)
@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_twice_the_light_is_twice_the_shaft(gpu: Gpu, name: str, factor: float) -> None:
    """From starlight to a sun beside a furnace, whatever numbers an image format holds."""

    def light(strength: float) -> Any:
        scene = Scene(
            props.slits(-3, 2.5, 0.5, 3), [replace(FROM_AHEAD, intensity=strength)], AHEAD, Medium(0.15, 0.05)
        )
        return shoot(gpu, scene, volumetric=make(name)).inscattered

    np.testing.assert_allclose(light(factor) / factor, light(1.0), rtol=2e-3, atol=1e-6)


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize(
    "light",
    [
        PointLight((0, 0, -1.999), 1e9),
        PointLight((0.01, 0.02, -1.0), 1e7),
        PointLight((0, 0, 0), 1e6),
        DirectionalLight((0, 0, -1), 1e7),
    ],
    ids=["on the wall", "in the air", "in the eye", "sun"],
)
def test_fierce_light_stays_finite(gpu: Gpu, name: str, light: Any) -> None:
    scene = Scene([props.wall(-2)], [light], AHEAD, Medium(2.0))
    shot = shoot(gpu, scene, volumetric=make(name), frames=2, antialiasing="taa", tonemap="aces")
    for image in (shot.inscattered, shot.base, shot.radiance):
        assert np.isfinite(image).all()
        assert (image >= 0).all()


@pytest.mark.parametrize("name", LIT)
def test_air_that_only_absorbs_is_dark(gpu: Gpu, name: str) -> None:
    scene = Scene([props.wall(-4)], [FROM_AHEAD], AHEAD, Medium(0.0, (0.5, 0.1, 0.0)))
    shot = shoot(gpu, scene, volumetric=make(name))
    assert not shot.inscattered.any()
    distance = 4 * props.rays(AHEAD, TINY).stretch[..., None]
    np.testing.assert_allclose(shot.transmittance, np.exp(-np.array([0.5, 0.1, 0.0]) * distance), rtol=1e-3)


# --- shadows in the air -------------------------------------------------------------------------------------------


def half_lit(dark: str) -> Scene:
    """τ = 2 before a wall at 10 m; a roof outside the picture shades the near or the far half under a light above."""
    near, far = (1.0, -5.0) if dark == "near" else (-5.0, -11.0)
    roof = props.quad((-3, 3, near), (3, 3, near), (3, 3, far), (-3, 3, far))
    return Scene([props.wall(-10, 3), roof], [DirectionalLight((0, -1, 0), 1.0)], NARROW, Medium(0.15, 0.05))


@pytest.mark.parametrize("name", seeing("off screen"))
@pytest.mark.parametrize("dark", ["near", "far"])
def test_light_of_one_half_of_the_ray(gpu: Gpu, name: str, dark: str) -> None:
    """Catches an accumulation that attenuates the wrong side, and a camera in shadow that is taken for lit."""
    scene = half_lit(dark)
    shot = shoot(gpu, scene, volumetric=make(name), shadow=ShadowMap(size=1024))
    stretch = props.rays(NARROW, TINY).stretch
    span = (5 * stretch, 10 * stretch) if dark == "near" else (0 * stretch, 5 * stretch)
    expected = props.lit_slab(scene, TINY, *span)
    unit = 0.15 / 0.2 / (4 * math.pi)
    share = math.exp(-1) * (1 - math.exp(-1)) if dark == "near" else 1 - math.exp(-1)
    assert expected[6, 8, 0] / unit == pytest.approx(share, rel=0.01)
    np.testing.assert_allclose(shot.inscattered, expected, rtol=0.02)


@pytest.mark.parametrize("name", seeing("wall"))
def test_a_light_behind_the_camera_is_not_mirrored(gpu: Gpu, name: str) -> None:
    """What stands in the picture does not shade the air between it and a camera that the light comes from."""
    post = props.box((-0.3, -0.3, -5), (0.3, 0.3, -4.5))
    light = DirectionalLight((0, 0, -1), 2.0)
    scene = Scene([props.wall(-6), post], [light], AHEAD, AIR)
    shot = shoot(gpu, scene, volumetric=make(name))
    seen = props.rays(AHEAD, TINY)
    distance = shot.depth * seen.stretch
    assert_close(shot.inscattered, props.lit_slab(scene, TINY, 0, distance), 0.01)


def test_screen_space_makes_no_rays_from_behind(gpu: Gpu) -> None:
    for model in ("physical", "paper"):
        scene = Scene([], [DirectionalLight((0, 0, -1), 2.0)], AHEAD, AIR)
        shot = shoot(gpu, scene, volumetric=make("screen_space", model=model))
        assert not shot.inscattered.any()


@pytest.mark.parametrize("name", LIT)
def test_lights_add(gpu: Gpu, name: str) -> None:
    boards = props.slits(-3, 2.5, 0.4, 5)
    lights = [FROM_AHEAD, DirectionalLight((-0.5, -0.3, 1.0), 1.0, (0.2, 0.6, 1.0))]

    def light(*chosen: DirectionalLight) -> Any:
        return shoot(gpu, Scene(boards, chosen, AHEAD, AIR), volumetric=make(name)).inscattered

    first, second = light(lights[0]), light(lights[1])
    assert first.max() > 0.01
    assert second.max() > 0.01
    assert_close(light(*lights), first + second, 2e-3)


@pytest.mark.parametrize("name", ALL)
def test_darkness(gpu: Gpu, name: str) -> None:
    shot = shoot(gpu, Scene([props.wall(-4)], [], AHEAD, AIR), volumetric=make(name))
    assert not shot.inscattered.any()
    assert not shot.radiance.any()


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [("polygonal", 0.01), ("polygonal_faces", 0.02), ("froxel", 0.02)],
)
@pytest.mark.parametrize("side", ["ahead", "behind"])
def test_slits_agree_with_the_march(gpu: Gpu, name: str, tolerance: float, side: str) -> None:
    size = (32, 24)
    direction = (0.3, -0.4, 0.9) if side == "ahead" else (0.6, -0.3, -0.7)
    boards = props.slits(-3 if side == "ahead" else 1, 2.5, 0.4, 5)
    scene = Scene(
        boards if side == "ahead" else [*boards, props.wall(-6, 6)],
        [DirectionalLight(direction, 1.0)],
        Camera((0.4, 0.3, 0), (0, 0, -3), fov=0.9, near=0.05),
        Medium(0.15, 0.05, HenyeyGreenstein(0.4)),
    )
    shadow = ShadowMap(size=1024)
    truth = shoot(gpu, scene, size, volumetric=make("march", steps=2000), shadow=shadow).inscattered
    assert truth.max() > 2 * truth.min(), "there must be shafts"
    changes = {"grid": (*size, 128)} if name == "froxel" else {}
    got = shoot(gpu, scene, size, volumetric=make(name, **changes), shadow=shadow).inscattered
    assert props.difference(got, truth) < tolerance


@cache
def cast_shafts(near: bool) -> tuple[Scene, Any]:
    """A scene of shafts through boards behind the camera, and its L_v with visibility by rays cast at the triangles."""
    boards = props.slits(1, 2.5, 0.4, 5)
    light = PointLight((0.5, 1.0, 3.5), 40.0) if near else DirectionalLight((0.6, -0.3, -0.7), 1.0)
    camera = Camera((0.4, 0.3, 0), (0, 0, -3), fov=0.9, near=0.05)
    scene = Scene([*boards, props.wall(-6, 6)], [light], camera, Medium(0.15, 0.05, HenyeyGreenstein(0.4)))
    seen = props.rays(camera, TINY)
    distance = -6 / seen.directions[..., 2]
    count = 250
    s = distance * ((np.arange(count) + 0.5) / count)[:, None, None]
    points = seen.at(s)
    irradiance, travels = props.arriving(light, scene.medium.extinction, points)
    p = props.phase(scene.medium.phase, -(travels * seen.directions).sum(-1))
    arrives = props.lit(scene.with_(instances=boards), light, points) * p
    dimmed = np.exp(-np.array(scene.medium.extinction) * s[..., None])
    total = (arrives[..., None] * irradiance * dimmed).mean(axis=0) * distance[..., None]
    return scene, total * scene.medium.scattering


@pytest.mark.parametrize("near", [False, True], ids=["sun", "lamp"])
@pytest.mark.parametrize("name", seeing("off screen"))
def test_shafts_agree_with_rays_cast_to_the_light(gpu: Gpu, name: str, near: bool) -> None:
    """The whole chain, shadow map included, against 250 samples a ray that ask the triangles themselves."""
    scene, expected = cast_shafts(near)
    assert expected.max() > 2 * expected.min()
    shot = shoot(gpu, scene, volumetric=make(name), shadow=ShadowMap(size=512 if near else 1024))
    assert props.difference(shot.inscattered, expected) < 0.02


RESOLUTION = {"march": {"steps": 512}, "froxel": {"grid": (*TINY, 128)}, "screen_space": {"samples": 128}}


@pytest.mark.parametrize("name", RESOLUTION)
def test_twice_the_samples_change_little(gpu: Gpu, name: str) -> None:
    scene = Scene(props.slits(-3, 2.5, 0.5, 5), [FROM_AHEAD], AHEAD, AIR)
    once = shoot(gpu, scene, volumetric=make(name)).inscattered
    twice = shoot(gpu, scene, volumetric=make(name, **RESOLUTION[name])).inscattered
    assert once.max() > 0.01
    assert props.difference(once, twice) < 0.05
    if name != "screen_space":
        lit = Scene([props.wall(-6)], [FROM_BEHIND], AHEAD, AIR)
        few = {"march": {"steps": 8}, "froxel": {"grid": (*TINY, 32)}}[name]
        coarse = shoot(gpu, lit, volumetric=make(name, **few)).inscattered
        fine = shoot(gpu, lit, volumetric=make(name)).inscattered
        # The extinction inside a step is integrated exactly, so coarse steps cost nothing in unshadowed air.
        np.testing.assert_allclose(coarse, fine, rtol=0.01)


# --- point and spot lights ----------------------------------------------------------------------------------------

NEAR_LIGHTS = [
    pytest.param(PointLight((0.6, 0.4, -3.0), 3.0, (1.0, 0.7, 0.4)), id="point"),
    pytest.param(SpotLight((0.2, 1.4, -4.0), (0.1, -1.0, 0.2), 3.0, (1.0, 0.7, 0.4), 0.3, 0.6), id="spot"),
    pytest.param(SpotLight((0.5, 0.2, -5.0), (-0.1, 0.0, 1.0), 3.0, (1.0, 0.7, 0.4), 0.1, 0.5), id="at the viewer"),
    pytest.param(SpotLight((-0.5, 0.6, -3.0), (1.0, 0.2, -0.3), 3.0, (1.0, 0.7, 0.4), 0.5, 1.45), id="wide"),
    pytest.param(SpotLight((0.7, -0.5, 0.8), (-0.1, 0.1, -1.0), 9.0, (1.0, 0.7, 0.4), 0.2, 0.4), id="headlight"),
    pytest.param(RectLight((0.6, 1.2, -3.0), (-0.3, -1, -0.2), 3.0, (1, 0.7, 0.4), 0.8, 0.3, 0.5), id="panel"),
    pytest.param(RectLight((0.1, 0.2, -4.0), (0.6, 0.1, 0.3), 3.0, (1, 0.7, 0.4), 0.3, 0.2), id="edge on"),
]


@pytest.mark.parametrize("light", NEAR_LIGHTS)
@pytest.mark.parametrize("name", LIT)
def test_near_lights_against_quadrature(gpu: Gpu, name: str, light: PointLight | SpotLight | RectLight) -> None:
    if name == "screen_space" and light.position[2] > 0:
        pytest.skip(f"{name} sees only lights that are before the camera")
    scene = Scene([props.wall(-6)], [light], AHEAD, AIR)
    try:
        shot = shoot(gpu, scene, volumetric=make(name))
    except Unsupported as refused:
        assert re.fullmatch(rf"{name} .*{light.kind} light: use .*", str(refused))  # noqa: PT017 - both outcomes are right
        assert gpu.ledger.by_owner().keys() <= {"constants"}, "a refusal leaves nothing on the device"
        return
    seen = props.rays(AHEAD, TINY)
    expected = props.quadrature(scene, light, TINY, 0, 6 * seen.stretch)
    way = np.array(light.position)
    closest = np.linalg.norm(np.cross(seen.directions, way), axis=-1)
    clear = closest > 0.4  # at the light itself 1/r² has no bound, and no sampling is fair
    error = np.abs(shot.inscattered - expected)[clear] / expected.max(axis=(0, 1), where=clear[..., None], initial=0)
    assert error.max() < 0.02


@pytest.mark.parametrize("light", NEAR_LIGHTS[:3])
@pytest.mark.parametrize("name", LIT)
def test_near_lights_in_endless_air(gpu: Gpu, name: str, light: PointLight | SpotLight | RectLight) -> None:
    """Rays to the sky end after no distance that a grid or a number of steps could be made for."""
    scene = Scene([], [light], AHEAD, AIR)
    try:
        shot = shoot(gpu, scene, volumetric=make(name))
    except Unsupported:
        return
    spans = [(0, 8), (8, 30), (30, 120), (120, 400)]
    expected = np.sum([props.quadrature(scene, light, TINY, a, b) for a, b in spans], axis=0)
    closest = np.linalg.norm(np.cross(props.rays(AHEAD, TINY).directions, np.array(light.position)), axis=-1)
    clear = closest > 0.4
    error = np.abs(shot.inscattered - expected)[clear] / expected.max(axis=(0, 1), where=clear[..., None], initial=0)
    assert error.max() < 0.01
    assert shot.inscattered.mean() == pytest.approx(expected.mean(), rel=0.01)


@pytest.mark.parametrize("name", LIT)
def test_near_lights_fall_with_the_square_of_the_distance(gpu: Gpu, name: str) -> None:
    """In air too thin to dim, twice as far is a quarter of the light."""
    light = []
    for far in (1, 2):
        position = (0.0, 0.0, -300.0 * far)
        box = ((-1, -1, -1.5), (1, 1, 1.5))
        scene = Scene([], [PointLight(position, 9e4)], AHEAD, Medium(1e-3, 0.0, Isotropic(), box))
        try:
            light.append(shoot(gpu, scene, volumetric=make(name)).inscattered)
        except Unsupported:
            return
    np.testing.assert_allclose(light[0], 4 * light[1], rtol=0.02)
    assert light[1][6, 8, 0] == pytest.approx(1e-3 * 1.5 / (4 * math.pi) * 9e4 / 600**2, rel=0.02)


# --- parameters, memory, time -------------------------------------------------------------------------------------

# Sizes at which every extreme is drawn. A parameter that sizes a resource is capped on the way up, or a froxel grid of
# 1024³ would ask for 16 GiB: the cap is 48 a side, and 2048 for a single number.
SMALL: dict[str, dict[str, Any]] = {
    "froxel": {"grid": (8, 6, 16)},
    "march": {"steps": 16},
    "screen_space": {"samples": 8},
}


def extremes(f: Field) -> list[Any]:
    """Smallest and largest value of a parameter, or every choice."""
    if get_origin(f.type) is Literal:
        return list(get_args(f.type))
    if f.type is bool:
        return [False, True]
    low, high = f.param.low, f.param.high
    cap = math.inf if not f.param.rebuild else 48 if get_origin(f.type) is tuple else 2048
    whole = f.type is int or (get_args(f.type) and get_args(f.type)[0] is int)
    values = [-1e3 if low is None else low, min(cap, 1e3 if high is None else high)]
    kind = int if whole else float
    count = len(get_args(f.type)) if get_origin(f.type) is tuple else 0
    return [tuple([kind(v)] * count) if count else kind(v) for v in values]


def sweeps() -> list[Any]:
    cases = []
    for family in FAMILIES.values():
        for name, cls in family.members.items():
            models = [get_args(f.type) for f in fields_of(cls) if f.name == "model"]
            for model in models[0] if models else (None,):
                suffix = f"-{model}" if model else ""
                cases.append(pytest.param(family.name, name, model, id=f"{family.name}-{name}{suffix}"))
    return cases


@pytest.mark.parametrize(("family", "name", "model"), sweeps())
def test_every_parameter_from_end_to_end(gpu: Gpu, family: str, name: str, model: str | None) -> None:
    scene = Scene(
        [*props.slits(-3, 2.5, 0.5, 3), props.floor(-1.5, 5)], [FROM_AHEAD, FROM_BEHIND], AHEAD, AIR, ambient=(0.1,) * 3
    )
    cls = FAMILIES[family].members[name]
    base = {**SMALL.get(name, {}), **({"model": model} if model else {})}
    if "field" in name:  # they need something to ask
        ball = Implicit(sphere(0.3).at(0, 0, -2), material=Material(reflections=family == "reflection"))
        scene = replace(scene, implicits=[ball])
    if family == "volume":
        scene = replace(scene, volumes=[Volume(sphere(0.4).at(0, 0, -2), AIR)])
    if family == "shadow" and "size" in {f.name for f in fields_of(cls)}:
        base["size"] = 256
    cases: list[dict[str, Any]] = [{}]
    for f in fields_of(cls):
        cases += [{f.name: value} for value in extremes(f) if f.name != "model"]
    techniques = {"volumetric": FAMILIES["volumetric"].make("froxel", changes=SMALL["froxel"])}
    techniques["shadow"] = ShadowMap(size=64)
    with Renderer(scene, (8, 6), gpu=gpu, antialiasing="none", tonemap="none", **techniques) as renderer:
        for case in cases:
            made = FAMILIES[family].make(name, changes={**base, **case})
            try:
                renderer.use(family, made)
            except Unsupported:
                assert case == {"share": 1.0}, "a plane that is all that lights reach; this scene has several"
                continue
            for _ in range(2):
                renderer.draw()
            shot = props.read(renderer)
            for image in (shot.inscattered, shot.transmittance, shot.radiance):
                assert np.isfinite(image).all(), case
            assert (shot.transmittance >= 0).all(), case
            assert (shot.transmittance <= 1).all(), case


@pytest.mark.parametrize("name", ALL)
def test_switching_frees_what_the_last_one_held(gpu: Gpu, name: str) -> None:
    scene = Scene([props.wall(-4)], [FROM_BEHIND], AHEAD, AIR)
    with Renderer(scene, TINY, gpu=gpu, volumetric="off", shadow=ShadowMap(size=64)) as renderer:
        renderer.draw()
        before = renderer.memory()
        renderer.use("volumetric", make(name))
        renderer.draw()
        held = {owner: size for owner, size in renderer.memory().items() if owner.startswith("volumetric.")}
        assert set(held) == {f"volumetric.{make(name).name}"}
        renderer.use("volumetric", "off")
        renderer.draw()
        after = renderer.memory()
    assert {k: v for k, v in after.items() if k != "constants"} == {k: v for k, v in before.items() if k != "constants"}


def test_memory_of_the_techniques_is_what_their_textures_need(gpu: Gpu) -> None:
    scene = Scene([props.wall(-4)], [FROM_BEHIND], AHEAD, AIR)

    def held(technique: Technique) -> int:
        return shoot(gpu, scene, volumetric=technique).memory[f"volumetric.{technique.name}"]

    parameters = {name: -(-uniform_dtype(cls).itemsize // 16) * 16 for name, cls in FAMILY.members.items()}
    assert held(make("froxel", grid=(10, 7, 5))) == 2 * 10 * 7 * 5 * 8 + parameters["froxel"]
    for name in ("off", "march", "screen_space"):
        assert held(make(name)) == parameters[name]
    # Two floats for each block of 4², 16² and 64² texels of the map of 512².
    blocks = 8 * (128**2 + 32**2 + 8**2)
    assert held(make("polygonal")) == blocks + parameters["polygonal"]
    assert held(make("polygonal_faces")) <= 64 + parameters["polygonal"]


@pytest.mark.parametrize("name", LIT)
def test_two_runs_are_equal_and_stillness_is_still(gpu: Gpu, name: str) -> None:
    scene = Scene(props.slits(-3, 2.5, 0.5, 3), [FROM_AHEAD], AHEAD, AIR)

    def light(frames: int, seed: int, **changes: Any) -> Any:
        return shoot(gpu, scene, volumetric=make(name, **changes), frames=frames, seed=seed).inscattered

    assert np.array_equal(light(1, 0), light(4, 0)), "without jitter a frame does not depend on its number"
    if "jitter" in {f.name for f in fields_of(type(make(name)))}:
        few: dict[str, Any] = {"march": {"steps": 16}, "screen_space": {"samples": 5}}.get(name, {"grid": (*TINY, 16)})
        one = light(3, 7, jitter=1.0, **few)
        assert np.array_equal(one, light(3, 7, jitter=1.0, **few)), "equal seeds give equal bits"
        assert not np.array_equal(one, light(4, 7, jitter=1.0, **few)), "noise changes every frame"
        assert not np.array_equal(one, light(3, 8, jitter=1.0, **few)), "and with the seed"


def test_jitter_is_unbiased(gpu: Gpu) -> None:
    """The mean of noisy frames is the converged picture, by a z-test on the mean's own standard error."""
    scene = Scene(props.slits(-3, 2.5, 0.5, 3), [FROM_AHEAD], AHEAD, AIR)
    truth = shoot(gpu, scene, volumetric=make("march", steps=4000)).inscattered.mean()
    noisy = make("march", steps=8, jitter=1.0)
    means = []
    with Renderer(
        scene, TINY, gpu=gpu, volumetric=noisy, shadow=ShadowMap(size=512), antialiasing="none", tonemap="none"
    ) as renderer:
        for _ in range(48):
            renderer.draw()
            means.append(renderer.inscattered().astype(float).mean())
    error = np.std(means, ddof=1) / math.sqrt(len(means))
    assert error < 0.02 * truth
    assert abs(np.mean(means) - truth) < 4 * error + 0.002 * truth
