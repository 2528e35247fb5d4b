"""``model="paper"``: the equations of S1 as it gives them, quirks included, worked out by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import props
import pytest
from props import AHEAD, TINY, shoot

from tyndall.gpu.device import Gpu
from tyndall.scene.model import Camera, DirectionalLight, HenyeyGreenstein, Instance, Medium, PointLight, Scene
from tyndall.techniques import FAMILIES, Technique
from tyndall.techniques.contract import Unsupported
from tyndall.techniques.shadow.shadow_map import ShadowMap

SIZE = (32, 24)
AHEAD_LIGHT = DirectionalLight((0.1, -0.2, 1.0), 3.0, (1.0, 0.8, 0.5))
BEHIND_LIGHT = DirectionalLight((0.3, -0.5, -0.8), 3.0, (1.0, 0.8, 0.5))


def paper(name: str, **changes: Any) -> Technique:
    return FAMILIES["volumetric"].make(name, changes={"model": "paper", **changes})


def lit(light: DirectionalLight, g: float, size: tuple[int, int], camera: Camera = AHEAD) -> np.ndarray:
    """L_c · ρ(θ) of each pixel (H, W, 3)."""
    travels = np.array(light.direction) / np.linalg.norm(light.direction)
    rho = props.phase(HenyeyGreenstein(g), -(props.rays(camera, size).directions @ travels))
    return rho[..., None] * light.intensity * np.array(light.color)


@pytest.mark.parametrize("name", ["screen_space", "polygonal", "froxel"])
def test_the_paper_adds_light_without_dimming(gpu: Gpu, name: str) -> None:
    """L_f = L_b + L_v, whatever the scene's medium."""
    scene = Scene([props.wall(-4)], [BEHIND_LIGHT], AHEAD, Medium(0.5, 0.5))
    shot = shoot(gpu, scene, volumetric=paper(name))
    assert (shot.transmittance == 1).all()
    np.testing.assert_allclose(shot.radiance, shot.base + shot.inscattered, rtol=2e-3)
    other = shoot(gpu, scene.with_(medium=Medium()), volumetric=paper(name))
    assert np.array_equal(shot.inscattered, other.inscattered)


def test_froxel_sums_slices_of_equal_depth(gpu: Gpu) -> None:
    """Equations 10–12: Σ_k L_c · ρ · C_s · density · D(k) over the layers whose middle is lit; no extinction."""
    technique = paper("froxel", grid=(*TINY, 10), z_limit=8.0, g=0.5, c_s=0.18, density=0.1)
    for depth in (0.7, 4.1, 7.9, 30.0):
        scene = Scene([props.wall(-depth, 60)], [BEHIND_LIGHT], AHEAD)
        shot = shoot(gpu, scene, volumetric=technique)
        layers = (0.8 * (np.arange(10) + 0.5) < depth).sum()
        expected = lit(BEHIND_LIGHT, 0.5, TINY) * 0.18 * 0.1 * (layers * 0.8)
        np.testing.assert_allclose(shot.inscattered, expected, rtol=5e-3)


def test_froxel_shadows_its_slices(gpu: Gpu) -> None:
    """A roof over the near half of the view takes the near half of the slices away."""
    roof = props.quad((-3, 3, 1), (3, 3, 1), (3, 3, -5), (-3, 3, -5))
    light = DirectionalLight((0, -1, 0), 1.0)
    narrow = Camera((0, 0, 0), (0, 0, -1), fov=0.2, near=0.05)
    scene = Scene([props.wall(-10.05, 3), roof], [light], narrow)
    shot = shoot(gpu, scene, volumetric=paper("froxel", grid=(*TINY, 100), z_limit=10.0))
    expected = lit(light, 0.4, TINY, narrow) * 0.1 * 5.0
    np.testing.assert_allclose(shot.inscattered, expected, rtol=0.02)


@pytest.mark.parametrize("decay", [1.0, 0.94])
def test_screen_space_is_equations_6_to_8(gpu: Gpu, decay: float) -> None:
    """exposure · Σ decay^i · weight · L_c · V(p_i)/N, by a loop over the depth picture."""
    n, exposure, weight = 24, 1.5, 0.02
    scene = Scene(props.slits(-3, 1.2, 0.3, 3), [AHEAD_LIGHT], AHEAD)
    technique = paper("screen_space", samples=n, decay=decay, exposure=exposure, weight=weight)
    shot = shoot(gpu, scene, SIZE, volumetric=technique)
    towards = -np.array(AHEAD_LIGHT.direction)
    f = 1 / math.tan(AHEAD.fov / 2)
    ndc = np.array([f * SIZE[1] / SIZE[0] * towards[0] / -towards[2], f * towards[1] / -towards[2]])
    place = np.array([0.5 + 0.5 * ndc[0], 0.5 - 0.5 * ndc[1]]) * SIZE
    sky = np.isinf(shot.depth)
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    total = np.zeros(SIZE[::-1])
    for i in range(1, n + 1):
        u, v = x + i * (place[0] - x) / n, y + i * (place[1] - y) / n
        inside = (u >= 0) & (u < SIZE[0]) & (v >= 0) & (v < SIZE[1])
        column, row = np.clip(u.astype(int), 0, SIZE[0] - 1), np.clip(v.astype(int), 0, SIZE[1] - 1)
        total += decay**i * (inside & sky[row, column])
    expected = exposure * weight * total[..., None] / n * AHEAD_LIGHT.intensity * np.array(AHEAD_LIGHT.color)
    assert 0.1 < sky.mean() < 0.9
    assert expected.min() < 0.7 * expected.max()
    close = np.isclose(shot.inscattered, expected, rtol=1e-3).all(-1)
    assert close.mean() > 0.97  # a sample on a pixel's border may fall either way


def test_screen_space_makes_no_rays_of_a_light_behind_the_camera(gpu: Gpu) -> None:
    """S1's formula would mirror it into the picture."""
    light = DirectionalLight((-0.1, 0.2, -1.0), 3.0)
    assert not shoot(gpu, Scene([], [light], AHEAD), volumetric=paper("screen_space")).inscattered.any()


def test_polygonal_is_equation_9(gpu: Gpu) -> None:
    """L_c · ρ · (1 − e^(−τd))/τ where everything is lit."""
    camera = Camera((0, 3, 4), (0, 0, -1), fov=0.7, near=0.05)
    light = DirectionalLight((0.2, -1.0, -0.3), 2.0, (1.0, 0.8, 0.5))
    scene = Scene([props.floor(0, 20)], [light], camera)
    distance = -3 / props.rays(camera, TINY).directions[..., 1]
    for g, tau in ((0.4, 0.3), (0.0, 3.99e-5)):
        shot = shoot(gpu, scene, volumetric=paper("polygonal", g=g, tau=tau))
        expected = lit(light, g, TINY, camera) * (-np.expm1(-tau * distance) / tau)[..., None]
        np.testing.assert_allclose(shot.inscattered, expected, rtol=2e-3)


def room() -> list[Instance]:
    """Walls, floor and ceiling of 4 × 3 × 6 m around the origin, with an opening in the ceiling."""
    return [
        props.box((-2.2, -1.2, -5.2), (2.2, -1.0, 1.2)),
        props.box((-2.2, -1.0, -5.2), (-2.0, 2.2, 1.2)),
        props.box((2.0, -1.0, -5.2), (2.2, 2.2, 1.2)),
        props.box((-2.0, -1.0, -5.2), (2.0, 2.2, -5.0)),
        props.box((-2.0, -1.0, 1.0), (2.0, 2.2, 1.2)),
        props.box((-2.0, 2.0, -5.0), (2.0, 2.2, -2.6)),
        props.box((-2.0, 2.0, -2.0), (2.0, 2.2, 1.0)),
        props.box((-2.0, 2.0, -2.6), (-0.6, 2.2, -2.0)),
        props.box((0.4, 2.0, -2.6), (2.0, 2.2, -2.0)),
    ]


@pytest.mark.parametrize("direction", [(0.1, -1.0, 0.3), (-0.3, -1.0, -0.2)])
def test_polygonal_in_a_closed_room_is_the_march(gpu: Gpu, direction: tuple[float, float, float]) -> None:
    """With σs = σt = τ a march gives τ times equation 9; the camera stands in the dark under a hole in the roof.

    Rays go on behind the walls, into the lit air outside: what they meet there must cancel.
    """
    tau = 0.3
    light = DirectionalLight(direction, 2.0)
    scene = Scene(room(), [light], AHEAD, Medium(tau, 0.0, HenyeyGreenstein(0.4)))
    shadow = ShadowMap(size=1024)
    truth = shoot(
        gpu, scene, SIZE, volumetric=FAMILIES["volumetric"].make("march", changes={"steps": 1000}), shadow=shadow
    )
    got = shoot(gpu, scene, SIZE, volumetric=paper("polygonal", g=0.4, tau=tau), shadow=shadow)
    expected = truth.inscattered / tau
    assert expected.max() > 5 * np.median(expected), "there must be one shaft"
    assert props.difference(got.inscattered, expected) < 0.05
    assert abs(got.inscattered.mean() / expected.mean() - 1) < 0.03


@pytest.mark.parametrize("name", ["screen_space", "polygonal", "froxel"])
def test_the_paper_knows_parallel_light_only(gpu: Gpu, name: str) -> None:
    with pytest.raises(Unsupported, match="directional") as error:
        shoot(gpu, Scene([], [PointLight()], AHEAD), volumetric=paper(name))
    assert "\n" not in str(error.value)
