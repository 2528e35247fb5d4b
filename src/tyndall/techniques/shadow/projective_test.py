"""Outlines of casters as projective textures. What holds for all shadows on planes is in planes_test.py."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import props
import pytest
from props import WHITE

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.scene.model import Camera, DirectionalLight, Light, PointLight, Scene, SpotLight
from tyndall.techniques.shadow.planar import Planar
from tyndall.techniques.shadow.projective import Projective

SIZE = (96, 72)
ABOVE = Camera((2.5, 4, 4.5), (0, 0.3, 0), fov=0.8, near=0.05)
SUN = DirectionalLight((0.5, -1.0, -0.35), 3.0)
CUBE = props.box((-0.5, 0.4, -0.5), (0.5, 1.4, 0.5))
ROOM = props.box((-3, 0, -3), (3, 4, 3), replace(WHITE, double_sided=True))
LIGHTS = [
    SUN,
    PointLight((-1.2, 2.2, 0.9), 20.0),
    SpotLight((-1.5, 3, 0.5), (0.5, -1, -0.15), 40.0, (1, 1, 1), 0.5, 0.7),
]


def visible(gpu: Gpu, scene: Scene, technique: Projective | Planar, size: tuple[int, int] = SIZE) -> np.ndarray:
    """Drawn light over that without casters; 1 where there is none."""
    with Renderer(scene, size, gpu=gpu, volumetric="off", antialiasing="none", shadow=technique) as renderer:
        renderer.draw()
        base = renderer.base()[..., 0].astype(float)
        renderer.draw(casters=False)
        full = renderer.base()[..., 0].astype(float)
    return np.where(full > 0.01 * full.max(), base / np.where(full > 0, full, 1), 1)


@pytest.mark.parametrize("light", LIGHTS, ids=lambda light: light.kind)
def test_finer_outlines_approach_the_flattened_casters(gpu: Gpu, light: Light) -> None:
    """The other exact way to the same shadow; the error is of the edge's texels, so it halves with their width."""
    scene = Scene([props.floor(0, 4), CUBE], [light], ABOVE)
    exact = visible(gpu, scene, Planar(), (192, 144))
    errors = [np.abs(visible(gpu, scene, Projective(size=n), (192, 144)) - exact).mean() for n in (64, 256, 1024)]
    assert errors[1] < 0.5 * errors[0]
    assert errors[2] < 0.5 * errors[1]
    assert errors[2] < 0.002


def test_the_filter_smooths_an_edge_over_a_texel(gpu: Gpu) -> None:
    scene = Scene([props.floor(0, 4), CUBE], [SUN], ABOVE)
    seen = visible(gpu, scene, Projective(size=64))
    between = (seen > 0.02) & (seen < 0.98)
    assert 40 < between.sum() < 0.2 * seen.size
    assert (visible(gpu, scene, Projective(size=1024)) == seen).mean() > 0.8


@pytest.mark.parametrize("size", [64, 1024])
@pytest.mark.parametrize("kind", ["point", "directional"])
def test_no_wall_shades_the_floor_before_it(gpu: Gpu, kind: str, size: int) -> None:
    """The filter would spread a wall's texels over the corner, if those next to the floor counted."""
    camera = Camera((0.5, 3.5, 2.9), (0, 0.8, -2), fov=1.2, near=0.05)
    if kind == "point":
        scene = Scene([ROOM], [PointLight((0.4, 1.7, -0.3), 20.0)], camera)
    else:
        wall = props.quad((-3, 0, -3), (3, 0, -3), (3, 4, -3), (-3, 4, -3))
        scene = Scene([props.floor(0, 3), wall], [DirectionalLight((0.3, -1, -0.7), 3.0)], camera)
    seen = visible(gpu, scene, Projective(size=size))
    assert (seen == 1).all()


def test_a_sheet_that_stands_on_the_floor_loses_a_texel_at_its_foot(gpu: Gpu) -> None:
    """As the module's description says, and no more: from two texels behind the foot on, the shadow is whole."""
    sheet = props.quad((-1, 0, 0), (1, 0, 0), (1, 1, 0), (-1, 1, 0), WHITE)
    sun = DirectionalLight((0, -1.0, -1.0), 3.0)
    scene = Scene([props.floor(0, 4), sheet], [sun], Camera((0.5, 4, -4.5), (0, 0, 0), fov=0.6, near=0.05))
    size = (192, 144)
    seen = props.rays(scene.camera, size)
    hit = props.cast(scene, seen.origin, seen.directions)
    at = seen.at(np.where(hit.instance == 0, hit.distance, 1))
    texel = 12 / 256 * np.sqrt(2)  # of the floor's diagonal, along the light's slope
    inner = (hit.instance == 0) & (np.abs(at[..., 0]) < 0.9) & (at[..., 2] < -2 * texel) & (at[..., 2] > -1 + 2 * texel)
    assert inner.sum() > 100
    assert visible(gpu, scene, Projective(size=256), size)[inner].max() == 0


def test_planes_beyond_four_take_more_images(gpu: Gpu) -> None:
    """Six sides of a room, each with the shadow of a block: four channels an image."""
    scene = Scene([ROOM, props.box((-1, 1, -1), (1, 2, 1))], [PointLight((0.3, 3, 0.2), 20.0)], ABOVE)
    camera = Camera((-2.5, 3.5, -2.4), (2.0, 0.8, 2.1), fov=1.9, near=0.05)
    scene = scene.with_(camera=camera)
    with Renderer(scene, (8, 6), gpu=gpu, volumetric="off", shadow=Projective(size=64)) as renderer:
        renderer.draw()
        assert 2 * 6 * 64 * 64 * 4 < renderer.memory()["shadow.projective"] < 2 * 6 * 64 * 64 * 4 + 10_000
        renderer.use("shadow", Projective(size=64, planes=4))
        renderer.draw()
        assert 6 * 64 * 64 * 4 < renderer.memory()["shadow.projective"] < 6 * 64 * 64 * 4 + 10_000
    exact = visible(gpu, scene, Planar())
    assert (exact == 0).sum() > 300
    assert np.abs(visible(gpu, scene, Projective()) - exact).mean() < 0.005
