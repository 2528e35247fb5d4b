"""Media inside shapes: the closed form of a slab, what the surfaces' shadows do to it, and what is before it."""

from __future__ import annotations

from typing import Any

import numpy as np
import props
import pytest

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError
from tyndall.scene.model import Camera, DirectionalLight, HenyeyGreenstein, Medium, PointLight, Scene, Volume
from tyndall.sdf import box, sphere
from tyndall.techniques.volume.none import NoVolumes
from tyndall.techniques.volume.uniform_march import UniformMarch

SIZE = (16, 12)
CAMERA = Camera((0, 0, 5), (0, 0, 0), fov=0.1, near=0.05)
SUN = DirectionalLight((0.6, 0, -0.8), 3.0)
GREY = Medium((0.3, 0.2, 0.1), (0.1, 0.0, 0.4), HenyeyGreenstein(0.4))


def draw(gpu: Gpu, scene: Scene, technique: Any = None, **others: Any) -> np.ndarray:
    chosen: dict[str, Any] = {"volumetric": "off", "antialiasing": "none", "tonemap": "none", **others}
    with Renderer(scene, SIZE, gpu=gpu, volume=technique or UniformMarch(), **chosen) as renderer:
        renderer.draw()
        return renderer.base().astype(float)


def slab(medium: Medium, length: Any, background: float = 0.0) -> np.ndarray:
    """σs/σt·p·E·(1 − e^(−σt·d)) of the sun's light, and what is left of the background."""
    sigma, scattering = np.array(medium.extinction), np.array(medium.scattering)
    towards_viewer = -props.rays(CAMERA, SIZE).directions
    rho = props.phase(medium.phase, towards_viewer @ np.array(SUN.direction))[..., None]
    left = np.exp(-sigma * np.asarray(length)[..., None])
    return scattering / sigma * rho * SUN.intensity * (1 - left) + background * left


@pytest.mark.parametrize("steps", [1, 7, 32])
@pytest.mark.parametrize("thickness", [0.2, 3.0])
def test_a_slab_is_the_closed_form_with_any_number_of_steps(gpu: Gpu, thickness: float, steps: int) -> None:
    cloud = Volume(box((8, 8, thickness)), GREY)
    scene = Scene([], [SUN], CAMERA, background=(0.5, 0.5, 0.5), volumes=[cloud])
    got = draw(gpu, scene, UniformMarch(steps=steps))
    rays = props.rays(CAMERA, SIZE)
    cosine = -rays.directions[..., 2]
    want = slab(GREY, thickness / cosine, 0.5)
    np.testing.assert_allclose(got, want, rtol=4e-3)


def test_what_stands_in_it_ends_it(gpu: Gpu) -> None:
    """A wall in the middle of the slab: half of it is before the wall, whose light is dimmed by that half."""
    cloud = Volume(box((8, 8, 2)), GREY)
    wall = props.wall(0)
    scene = Scene([wall], [], CAMERA, ambient=(0.5, 0.5, 0.5), volumes=[cloud])
    got, bare = draw(gpu, scene), draw(gpu, scene, NoVolumes())
    np.testing.assert_allclose(bare, 0.5, rtol=2e-3)
    left = np.exp(-np.array(GREY.extinction))
    want = 0.5 * left + 0.5 * np.array(GREY.scattering) / GREY.extinction * (1 - left)
    np.testing.assert_allclose(got, np.broadcast_to(want, got.shape), rtol=1e-2)


def test_a_white_cloud_in_even_light_vanishes(gpu: Gpu) -> None:
    """Soft or sharp: what it takes of the light behind it, it brings of the light around."""
    camera = Camera((0, 0.4, 5), (0, 0, 0), fov=0.6, near=0.05)
    for edge in (0.0, 0.5):
        cloud = Volume(sphere(1.0), Medium(2.0), edge=edge)
        got = draw(gpu, Scene(camera=camera, background=(1, 1, 1), ambient=(1, 1, 1), volumes=[cloud]))
        np.testing.assert_allclose(got, 1, atol=3e-3)


def test_steps_converge_where_the_edge_is_soft(gpu: Gpu) -> None:
    """A ball whose density grows with depth: e^(−σ∫ρ) along the middle, and errors that fall as steps grow."""
    cloud = Volume(sphere(1.0), Medium(0.0, 1.5), edge=1.0)
    scene = Scene(camera=Camera((0, 0, 5), (0, 0, 0), fov=0.01, near=0.05), background=(1, 1, 1), volumes=[cloud])
    want = np.exp(-1.5 * 2 * 0.5)  # ρ = depth
    errors = [abs(draw(gpu, scene, UniformMarch(steps=n, jitter=0.0)).mean() - want) for n in (3, 9, 65)]
    assert errors[2] < 2e-3
    assert errors[0] > errors[1] > errors[2] - 5e-4


def test_surfaces_shade_it(gpu: Gpu) -> None:
    """Behind a board that hides the lamp the slab is dark, by the shadow technique's answer for the air."""
    lamp = PointLight((0, 4.0, 0.0), 20.0)
    camera = Camera((0, 0, 8), (0, 0, 0), fov=0.6, near=0.05)
    board = props.box((-8, 1.4, -8), (0, 1.5, 8))
    scene = Scene([board], [lamp], camera, volumes=[Volume(box((6, 2, 2)), Medium(0.2))])
    got = draw(gpu, scene)
    lit = draw(gpu, scene.with_(instances=()))
    points = props.rays(camera, SIZE).at(8)
    inside = np.abs(points[..., 1]) < 0.8
    dark, bright = inside & (points[..., 0] < -0.5), inside & (points[..., 0] > 0.8)
    assert dark.sum() > 5
    assert bright.sum() > 5
    assert (got[dark] < 0.02 * lit[dark]).all()
    np.testing.assert_allclose(got[bright], lit[bright], rtol=0.05)


def test_the_nearer_volume_covers_the_farther_one(gpu: Gpu) -> None:
    """Whatever their order in the scene."""
    near = Volume(box((8, 8, 1)).at(0, 0, 1), Medium((0.5, 0, 0), 1.0))
    far = Volume(box((8, 8, 1)).at(0, 0, -1), Medium((0, 0.5, 0), 1.0))
    one, other = (draw(gpu, Scene([], [SUN], CAMERA, volumes=volumes)) for volumes in ([near, far], [far, near]))
    assert np.array_equal(one, other)
    alone = draw(gpu, Scene([], [SUN], CAMERA, volumes=[far]))
    np.testing.assert_allclose(one[..., 1], alone[..., 1] * np.exp(-1.0), rtol=2e-2)


def test_what_has_no_end_is_no_volume() -> None:
    with pytest.raises(ParameterError, match="^edge: -1"):
        Volume(sphere(1.0), Medium(0.1), edge=-1)
    with pytest.raises(ParameterError, match="volumes.0.: Medium is not Volume"):
        Scene(volumes=[Medium()])  # type: ignore[list-item]
