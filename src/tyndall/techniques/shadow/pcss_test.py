"""Percentage-closer soft shadows: penumbrae as wide as geometry says, for every kind of light."""

from __future__ import annotations

import math

import numpy as np
import props
import pytest

from tyndall.gpu.device import Gpu
from tyndall.scene.model import Camera, DirectionalLight, Light, PointLight, Scene, SpotLight
from tyndall.techniques.shadow.pcss import Pcss
from tyndall.techniques.shadow.ray_traced import RayTraced
from tyndall.techniques.shadow.shadow_map import ShadowMap

SIZE = (96, 72)
BEST = Pcss(size=1024, search_samples=64, samples=64)


def across(scene: Scene) -> np.ndarray:
    """x on the wall at z = −3 of each pixel."""
    seen = props.rays(scene.camera, SIZE)
    return seen.at(3 * seen.stretch)[..., 0]


@pytest.mark.parametrize("height", [0.5, 1.5])
@pytest.mark.parametrize("kind", ["directional", "point", "spot"])
def test_a_straight_edge_throws_the_penumbra_of_similar_triangles(gpu: Gpu, height: float, kind: str) -> None:
    """The light's image through the edge has the radius ``r·(d − b)/b``, or ``h·tan(α/2)``; the edge hides
    a segment."""
    distance, extent, height = 6.0, 0.3, height + 3.05  # the sheet is behind the camera
    lights: dict[str, tuple[Light, float]] = {
        "directional": (DirectionalLight((0, 0, -1), 3.0, angular_diameter=2 * math.atan(0.1)), 0.1 * height),
        "point": (PointLight((0, 0, distance - 3), 30.0, radius=extent), extent * height / (distance - height)),
        "spot": (
            SpotLight((0, 0, distance - 3), (0, 0, -1), 30.0, (1, 1, 1), 0.6, 0.9, radius=extent),
            extent * height / (distance - height),
        ),
    }
    light, radius = lights[kind]
    scene = props.sheet_edge(light, height)
    x = across(scene)
    seen = props.shade(gpu, scene, BEST, SIZE, frames=8)
    expected = props.disk_part(x / radius)
    graded = (expected > 0.02) & (expected < 0.98)
    assert graded.sum() > 100
    np.testing.assert_allclose(seen, expected, atol=0.12)
    assert np.abs(seen - expected)[graded].mean() < 0.04
    assert seen[x < -1.1 * radius - 0.05].max() < 0.01
    assert seen[x > 1.1 * radius + 0.05].min() > 0.99


@pytest.mark.parametrize("size", [0.0, 1e-5, 1e-3])
def test_a_small_light_throws_the_hard_shadow(gpu: Gpu, size: float) -> None:
    light = PointLight((-1.2, 2.2, 0.9), 20.0, radius=size)
    camera = Camera((2.5, 4, 4.5), (0, 0.3, 0), fov=0.8, near=0.05)
    scene = Scene([props.floor(0, 4), props.box((-0.5, 0.4, -0.5), (0.5, 1.4, 0.5))], [light], camera)
    hard = props.shade(gpu, scene, ShadowMap(size=256), (64, 48))
    soft = props.shade(gpu, scene, Pcss(size=256, min_radius=0), (64, 48))
    assert np.abs(soft - hard).mean() < (1e-4 if size == 0 else 3e-3)


def test_a_larger_light_throws_a_wider_penumbra(gpu: Gpu) -> None:
    widths = []
    for diameter in (0.05, 0.12, 0.3):
        scene = props.sheet_edge(DirectionalLight((0, 0, -1), 3.0, angular_diameter=diameter), 3.5)
        seen = props.shade(gpu, scene, BEST, SIZE, frames=4).mean(axis=0)
        assert (np.diff(seen) > -0.03).all(), "it brightens steadily"
        widths.append(((seen > 0.03) & (seen < 0.97)).sum())
    assert widths[1] > 1.8 * widths[0]
    assert widths[2] > 1.8 * widths[1]


def test_the_penumbra_widens_with_the_caster_s_distance(gpu: Gpu) -> None:
    """A board that leans on the floor: sharp at its foot, soft at its top; close to what rays see throughout."""
    sun = DirectionalLight((1, -1, 0), 3.0, angular_diameter=0.12)
    board = props.quad((0, 0, 0.3), (0, 0, -0.3), (0, 2.5, -0.3), (0, 2.5, 0.3))
    camera = Camera((1.2, 4, 0.01), (1.2, 0, 0), fov=0.8, near=0.05)
    scene = Scene([props.floor(0, 3), board], [sun], camera)
    size = (96, 72)
    rays = props.shade(gpu, scene, RayTraced(samples=64), size, frames=4)
    soft = props.shade(gpu, scene, BEST, size, frames=4)
    hard = props.shade(gpu, scene, ShadowMap(size=1024), size)
    hit = props.cast(scene, camera.position, props.rays(camera, size).directions)
    floor = hit.instance == 0
    assert np.abs(soft - rays)[floor].mean() < 0.5 * np.abs(hard - rays)[floor].mean()
    points = props.rays(camera, size).at(np.where(floor, hit.distance, 1))
    between = (soft > 0.1) & (soft < 0.9) & floor
    near = (between & (points[..., 0] > 0.1) & (points[..., 0] < 0.6)).sum()
    far = (between & (points[..., 0] > 1.5) & (points[..., 0] < 2.0)).sum()
    assert far > 2 * near


def test_what_stands_beside_the_cone_does_not_widen_it(gpu: Gpu) -> None:
    """A second sheet, high up and far aside, is within the search but hides nothing of the light."""
    sun = DirectionalLight((0, 0, -1), 3.0, angular_diameter=0.1)
    low = props.sheet_edge(sun, 3.2)
    high = props.quad((1.2, -3, 4), (3, -3, 4), (3, 3, 4), (1.2, 3, 4))
    both = Scene([*low.instances, high], [sun], low.camera)
    # A point that casts nothing, but makes the search of both scenes as wide.
    tip = props.quad((2.99, 2.99, 4), (3, 2.99, 4), (3, 3, 4), (2.99, 3, 4))
    one = Scene([*low.instances, tip], [sun], low.camera)
    x = across(low)
    seen = [props.shade(gpu, scene, BEST, SIZE, frames=4) for scene in (one, both)]
    np.testing.assert_allclose(seen[0][x < 0.4], seen[1][x < 0.4], atol=0.06)
