"""Flattened casters: exact to the pixel. What holds for all shadows on planes is in planes_test.py."""

from __future__ import annotations

import math

import numpy as np
import props
import pytest
from props import WHITE, shoot

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.scene.model import Camera, DirectionalLight, Instance, Light, Mesh, PointLight, Scene, SpotLight
from tyndall.techniques.shadow.planar import Planar

DOWN = Camera((0, 6, 0.01), (0, 0, 0), fov=0.9, near=0.05)


def dark(gpu: Gpu, scene: Scene, size: tuple[int, int], technique: Planar | None = None) -> np.ndarray:
    """Where the picture has no light."""
    return shoot(gpu, scene, size, shadow=technique or Planar()).base[..., 0] == 0


@pytest.mark.parametrize("height", [0.5, 2.0, 3.0])
def test_the_shadow_of_a_level_sheet_is_larger_by_the_ratio_of_heights(gpu: Gpu, height: float) -> None:
    """Under a lamp at height H, a sheet at height h casts a shadow H/(H − h) times as wide."""
    lamp = PointLight((0.3, 4.0, -0.2), 40.0)
    half = 0.34
    sheet = props.quad((-half, height, half), (half, height, half), (half, height, -half), (-half, height, -half))
    camera = Camera((0, 3.5, 9), (0, 0, 0), fov=0.7, near=0.05)
    size = (160, 120)
    scene = Scene([props.floor(0, 9), sheet], [lamp], camera)
    points = props.rays(camera, size)
    hit = props.cast(scene, points.origin, points.directions)
    on = np.all([np.roll(hit.instance, s, a) == 0 for a in (0, 1) for s in (-1, 0, 1)], axis=0)
    at = points.at(np.where(on, hit.distance, 1))
    k = 4.0 / (4.0 - height)
    edges = [(-half - c) * k + c for c in (0.3, -0.2)], [(half - c) * k + c for c in (0.3, -0.2)]
    inside = np.all(
        [(at[..., axis] > edges[0][i]) & (at[..., axis] < edges[1][i]) for i, axis in ((0, 0), (1, 2))], axis=0
    )
    assert (inside & on).sum() > 30
    shown = dark(gpu, scene, size)
    assert (shown != inside)[on].sum() <= 3, "at most where an edge goes through a pixel's centre"


@pytest.mark.parametrize(
    "light",
    [
        pytest.param(DirectionalLight((0.5, -1.0, -0.35), 3.0), id="directional"),
        pytest.param(DirectionalLight((1.0, -0.4, 0.2), 9.0), id="low sun"),
        pytest.param(PointLight((-1.2, 2.2, 0.9), 20.0), id="point"),
        pytest.param(PointLight((-1e3, 2e3, -5e2), 3e7), id="far point"),
        pytest.param(SpotLight((-1.5, 3.0, 0.5), (0.5, -1, -0.15), 40.0, (1, 1, 1), 0.5, 0.7), id="spot"),
    ],
)
def test_edges_are_exact_to_the_pixel(gpu: Gpu, light: Light) -> None:
    """Against rays through a soup of triangles, of any shape and place above the floor."""
    rng = np.random.default_rng(5)
    middles = rng.uniform((-1.5, 0.6, -1.5), (1.5, 1.5, 1.5), (12, 3))
    corners = middles[:, None] + rng.normal(scale=0.5, size=(12, 3, 3)).clip(-0.59)
    soup = Instance(Mesh(corners.reshape(-1, 3), np.arange(36).reshape(12, 3), material=WHITE))
    scene = Scene([props.floor(0, 6), soup], [light], Camera((2.5, 5, 4.5), (0, 0, 0), fov=0.8, near=0.05))
    size = (160, 120)
    seen = props.rays(scene.camera, size)
    hit = props.cast(scene, seen.origin, seen.directions)
    on = hit.instance == 0
    points = seen.at(np.where(on, hit.distance, 1))
    on &= props.arriving(light, 0.0, points)[0][..., 0] > 1e-3
    truth = props.lit(scene, light, points)
    on &= np.all([np.roll(hit.instance, s, a) == 0 for a in (0, 1) for s in (-1, 1)], axis=0)
    assert (~truth & on).sum() > 300
    assert (dark(gpu, scene, size) == ~truth)[on].mean() >= 0.998


def test_a_pass_for_four_lights_and_one_to_tell_planes_apart(gpu: Gpu) -> None:
    lights = [DirectionalLight((0.3 * math.cos(a), -1, 0.3 * math.sin(a)), 1.0) for a in range(6)]
    scene = Scene([props.floor(0, 4), props.wall(-4, 4), props.box((-1, 1, -1), (1, 2, 1))], lights, DOWN)
    with Renderer(scene, (32, 24), gpu=gpu, volumetric="off", antialiasing="none", shadow=Planar()) as renderer:
        renderer.draw()
        held = renderer.memory()["shadow.planar"]
        labels = [name for name, _ in gpu.timings()]
        if labels:
            assert labels.count("shadow.planar.which") == 1
            assert labels.count("shadow.planar.flatten") == 2
    images, depth = 2 * 32 * 24 * 4, 32 * 24 * 4
    assert images + depth < held < images + depth + 10_000, "nothing but the tables besides; no maps without air"


def test_fewer_planes_are_served_where_so_asked(gpu: Gpu) -> None:
    walls = props.quad((-4, 0, -3), (4, 0, -3), (4, 5, -3), (-4, 5, -3), WHITE)
    roof = props.quad((-4, 5, 4), (-4, 5, -4), (4, 5, -4), (4, 5, 4), WHITE)
    camera = Camera((0, 2.5, 9), (0, 2.5, 0), fov=0.8, near=0.05)
    scene = Scene([props.floor(0, 4), walls, roof], [DirectionalLight((0, -1, -1), 3.0)], camera)
    served = [int(dark(gpu, scene, (48, 36), Planar(planes=count)).sum()) for count in (1, 2)]
    everything = int(dark(gpu, scene, (48, 36), Planar()).sum())
    assert served[0] < served[1] == everything
