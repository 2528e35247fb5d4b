"""Ambient occlusion against closed forms of form factors, and that it dims nothing else."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import props
import pytest
from props import WHITE

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.scene.model import Camera, DirectionalLight, Instance, Scene
from tyndall.techniques.occlusion.none import NoOcclusion
from tyndall.techniques.occlusion.ray_traced_ao import RayTracedAo

SIZE = (48, 36)
AMBIENT = (0.5, 1.0, 0.25)
ABOVE = Camera((0.9, 1.1, 1.6), (0.2, 0, 0), fov=0.8, near=0.02)
FAR = 1e6


def draw(gpu: Gpu, scene: Scene, technique: Any, frames: int = 1, camera: Any = None) -> np.ndarray:
    with Renderer(
        scene, SIZE, gpu=gpu, volumetric="off", antialiasing="none", tonemap="none", occlusion=technique
    ) as renderer:
        for _ in range(frames):
            renderer.draw(camera)
        return renderer.base().astype(float)


def openness(gpu: Gpu, scene: Scene, technique: RayTracedAo, frames: int = 4) -> np.ndarray:
    """Ambient light over what it is without occlusion."""
    bright = scene.with_(lights=(), ambient=AMBIENT)
    full, dimmed = draw(gpu, bright, NoOcclusion()), draw(gpu, bright, technique, frames)
    return (dimmed / np.where(full > 0, full, 1))[..., 0]


def seen(scene: Scene) -> tuple[np.ndarray, props.Hit]:
    rays = props.rays(scene.camera, SIZE)
    hit = props.cast(scene, rays.origin, rays.directions)
    return rays.at(np.where(np.isfinite(hit.distance), hit.distance, 0)), hit


def upright(x: float, height: float) -> Instance:
    """A wall that faces +x, very long."""
    return props.quad((x, 0, 200), (x, 0, -200), (x, height, -200), (x, height, 200))


@pytest.mark.parametrize(("height", "radius"), [(200.0, FAR), (0.6, FAR), (200.0, 0.8), (200.0, 0.3)])
def test_a_corner_of_two_planes_is_the_closed_form(gpu: Gpu, height: float, radius: float) -> None:
    """A wall of height h at distance x hides (1 − x/√(x² + h²))/2 of the floor's hemisphere (a half of it where it has
    no end); one without end within a radius R hides (a − sin a cos a)/π, cos a = x/R, a segment of the unit disk.
    """
    scene = Scene([props.floor(0, 200), upright(-0.4, height)], camera=ABOVE)
    rays, frames = 32, 4
    got = openness(gpu, scene, RayTracedAo(radius=radius, samples=rays, fresh=1), frames)
    points, hit = seen(scene)
    x = points[..., 0] + 0.4
    floor = (hit.instance == 0) & (x > 0.01) & (np.abs(points).max(-1) < 5)
    x = np.where(floor, x, 1)
    if radius == FAR:
        expected = 0.5 * (1 + x / np.hypot(x, height))
    else:
        a = np.arccos(np.clip(x / radius, 0, 1))
        expected = 1 - (a - np.sin(a) * np.cos(a)) / math.pi
    # The second term: where hardly anything is hidden, one ray more or less.
    deviation = np.sqrt(expected * (1 - expected) / (rays * frames) + 1 / (rays * frames) ** 2)
    z = ((got - expected) / deviation)[floor]
    assert floor.sum() > 600
    assert np.abs(z).max() < 4.5
    assert z.std() < 0.8, "the points must be more even than random ones"
    assert abs(np.mean((got - expected)[floor])) < 2e-3
    if height == 200 and radius == FAR:
        assert np.median(got[floor]) == pytest.approx(0.5, abs=0.01)


def test_the_inside_of_a_closed_box_is_dark(gpu: Gpu) -> None:
    room = props.box((-1, -1, -1), (2, 2, 3), replace(WHITE, double_sided=True))
    scene = Scene([room], camera=Camera((0.5, 0.5, 2.0), (0, 0, 0), fov=0.8, near=0.02))
    assert (openness(gpu, scene, RayTracedAo(radius=FAR, fresh=2), frames=2) == 0).all()
    assert openness(gpu, scene, RayTracedAo(radius=0.05), frames=2).mean() > 0.95


def test_the_mean_of_frames_is_that_of_their_rays(gpu: Gpu) -> None:
    scene = Scene([props.floor(0, 20), upright(-0.4, 1.0)], camera=ABOVE)
    gathered = openness(gpu, scene, RayTracedAo(samples=2, fresh=1), frames=24)
    at_once = openness(gpu, scene, RayTracedAo(samples=48, fresh=1), frames=1)
    np.testing.assert_allclose(gathered, at_once, atol=2e-3)  # of half floats


def test_a_moving_camera_keeps_what_it_has_gathered(gpu: Gpu) -> None:
    scene = Scene([props.floor(0, 20), upright(-0.4, 1.0)], camera=ABOVE, ambient=AMBIENT)
    end = replace(ABOVE, position=(0.98, 1.1, 1.6), target=(0.28, 0, 0))
    truth = draw(gpu, scene, RayTracedAo(samples=128, fresh=1), 2, end)
    single = draw(gpu, scene, RayTracedAo(fresh=1), 1, end)
    with Renderer(
        scene, SIZE, gpu=gpu, volumetric="off", antialiasing="none", tonemap="none", occlusion=RayTracedAo(fresh=1)
    ) as renderer:
        for step in range(17):
            u = step / 16
            renderer.draw(replace(ABOVE, position=(0.9 + 0.08 * u, 1.1, 1.6), target=(0.2 + 0.08 * u, 0, 0)))
        moving = renderer.base().astype(float)
    assert props.difference(moving, truth) < 0.4 * props.difference(single, truth)


def test_shadows_and_occlusion_by_rays_share_one_tree(gpu: Gpu) -> None:
    scene = Scene([props.floor(0, 20)], [DirectionalLight()], ABOVE, ambient=AMBIENT)
    with Renderer(scene, SIZE, gpu=gpu, volumetric="off", shadow="ray_traced", occlusion="ray_traced_ao") as renderer:
        renderer.draw()
        both = renderer.memory()
        renderer.use("occlusion", "none")
        renderer.draw()
        alone = renderer.memory()
    assert both["tracing"] == alone["tracing"]
    assert both["occlusion.ray_traced_ao"] == pytest.approx(SIZE[0] * SIZE[1] * 2 * (4 + 8), abs=64)
    assert "occlusion.ray_traced_ao" not in alone
