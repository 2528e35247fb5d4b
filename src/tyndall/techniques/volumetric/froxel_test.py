"""Froxels: what the grid's size costs and what lies beyond it."""

from __future__ import annotations

from typing import Any

import numpy as np
import props
import pytest
from props import AHEAD, TINY, shoot

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.scene.model import Camera, DirectionalLight, HenyeyGreenstein, Medium, Scene
from tyndall.techniques.shadow.shadow_map import ShadowMap
from tyndall.techniques.volumetric.froxel import Froxel
from tyndall.techniques.volumetric.march import March

SIZE = (48, 36)
SHAFTS = Scene(
    [*props.slits(1, 2.5, 0.4, 5), props.wall(-6, 6)],
    [DirectionalLight((0.6, -0.3, -0.7), 1.0)],
    Camera((0.4, 0.3, 0), (0, 0, -3), fov=0.9, near=0.05),
    Medium(0.15, 0.05, HenyeyGreenstein(0.4)),
)


def error(gpu: Gpu, truth: Any, **changes: Any) -> float:
    """Relative RMSE of the shafts' L_v."""
    got = shoot(gpu, SHAFTS, SIZE, volumetric=Froxel(**changes), shadow=ShadowMap(size=1024)).inscattered
    return props.difference(got, truth)


@pytest.fixture(scope="module")
def truth(gpu: Gpu) -> Any:
    """L_v of the shafts by a converged march."""
    return shoot(gpu, SHAFTS, SIZE, volumetric=March(steps=3000, jitter=0), shadow=ShadowMap(size=1024)).inscattered


def test_error_falls_with_the_slices(gpu: Gpu, truth: Any) -> None:
    errors = [error(gpu, truth, grid=(*SIZE, depth), samples=1) for depth in (8, 32, 128)]
    assert errors[1] < 0.6 * errors[0]
    assert errors[2] < 0.6 * errors[1]
    assert errors[2] < 0.02


def test_error_falls_with_the_columns(gpu: Gpu, truth: Any) -> None:
    errors = [error(gpu, truth, grid=(SIZE[0] // n, SIZE[1] // n, 128)) for n in (6, 3, 1)]
    assert errors[1] < errors[0]
    assert errors[2] < 0.5 * errors[1]
    assert errors[0] < 0.15, "coarse columns blur, and no more"


def test_samples_do_the_work_of_slices(gpu: Gpu, truth: Any) -> None:
    coarse = error(gpu, truth, grid=(*SIZE, 16), samples=1)
    assert error(gpu, truth, grid=(*SIZE, 16), samples=16) < 0.8 * coarse


def test_frames_of_jitter_do_the_work_of_samples(gpu: Gpu, truth: Any) -> None:
    still = error(gpu, truth, grid=(*SIZE, 8), samples=1)
    total = np.zeros_like(truth)
    technique = Froxel(grid=(*SIZE, 8), samples=1, jitter=1.0)
    with Renderer(
        SHAFTS, SIZE, gpu=gpu, volumetric=technique, shadow=ShadowMap(size=1024), antialiasing="none", tonemap="none"
    ) as renderer:
        for _ in range(32):
            renderer.draw()
            total += renderer.inscattered()
    assert props.difference(total / 32, truth) < 0.8 * still


def test_unshadowed_air_needs_one_froxel_a_pixel(gpu: Gpu) -> None:
    """A slab is integrated exactly: under a directional light one slice over the whole medium gives the closed form."""
    medium = Medium((0.3, 0.2, 0.1), 0.05, HenyeyGreenstein(0.3), ((-9, -9, -5), (9, 9, 0)))
    scene = Scene([], [DirectionalLight((0.1, -0.2, 1.0), 2.0)], AHEAD, medium)
    shot = shoot(gpu, scene, volumetric=Froxel(grid=(*TINY, 1)))
    np.testing.assert_allclose(
        shot.inscattered, props.lit_slab(scene, TINY, 0, 5 * props.rays(AHEAD, TINY).stretch), rtol=3e-3
    )


@pytest.mark.parametrize("far", [2.5, 5.0])
def test_beyond_the_grid_air_is_lit(gpu: Gpu, far: float) -> None:
    """A roof shades all of the view; only what lies within ``far`` knows of it."""
    roof = props.quad((-3, 3, 1), (3, 3, 1), (3, 3, -11), (-3, 3, -11))
    narrow = Camera((0, 0, 0), (0, 0, -1), fov=0.2, near=0.05)
    scene = Scene([props.wall(-10, 3), roof], [DirectionalLight((0, -1, 0))], narrow, Medium(0.15, 0.05))
    shot = shoot(gpu, scene, volumetric=Froxel(grid=(*TINY, 32), far=far))
    stretch = props.rays(narrow, TINY).stretch
    np.testing.assert_allclose(shot.inscattered, props.lit_slab(scene, TINY, far * stretch, 10 * stretch), rtol=0.01)


def test_a_surface_inside_a_froxel_takes_its_share(gpu: Gpu) -> None:
    """In-scattering grows smoothly with the distance of a wall that the light passes along, without steps at slices."""
    light = []
    distances = np.linspace(2.0, 3.0, 11)
    for z in distances:
        medium = Medium(0.2, 0.0, HenyeyGreenstein(0.0), ((-9, -9, -8), (9, 9, 0)))
        scene = Scene([props.wall(-z)], [DirectionalLight((0, -1, 0))], AHEAD, medium)
        light.append(shoot(gpu, scene, volumetric=Froxel(grid=(*TINY, 8))).inscattered[6, 8, 0])
    steps = np.diff(light)
    assert (steps > 0).all()
    assert steps.max() < 1.5 * steps.min()
