"""What every occlusion technique must get right: open is open, and only the ambient light is dimmed."""

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
from tyndall.gpu.params import fields_of
from tyndall.scene.bundled import primitives
from tyndall.scene.model import Camera, DirectionalLight, Image, Instance, Mesh, Scene, Texture
from tyndall.techniques import FAMILIES, Technique
from tyndall.techniques.occlusion.none import NoOcclusion

FAMILY = FAMILIES["occlusion"]
ALL = tuple(name for name in FAMILY.members if name != "field_ao")  # whose scenes are in field_ao_test.py
SIZE = (48, 36)
AMBIENT = (0.5, 1.0, 0.25)
ABOVE = Camera((0.9, 1.1, 1.6), (0.2, 0, 0), fov=0.8, near=0.02)


def draw(gpu: Gpu, scene: Scene, technique: str | Technique, frames: int = 1) -> np.ndarray:
    others: dict[str, Any] = {"volumetric": "off", "antialiasing": "none", "tonemap": "none"}
    with Renderer(scene, SIZE, gpu=gpu, occlusion=technique, **others) as renderer:
        for _ in range(frames):
            renderer.draw()
        return renderer.base().astype(float)


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_plane_is_open(gpu: Gpu, name: str, scale: float) -> None:
    """Exactly, from a scene of millimetres to one of kilometres."""
    camera = replace(ABOVE, position=tuple(scale * x for x in ABOVE.position), target=(0, 0, 0), near=0.02 * scale)
    scene = Scene([props.floor(0, 20 * scale)], camera=camera, ambient=AMBIENT)
    rays = props.rays(camera, SIZE)
    onto = np.isfinite(props.cast(scene, rays.origin, rays.directions).distance)
    assert onto.mean() > 0.9
    got = draw(gpu, scene, name)[onto]
    np.testing.assert_allclose(got, np.broadcast_to(AMBIENT, got.shape), rtol=1e-3)
    assert np.array_equal(got, draw(gpu, scene, NoOcclusion())[onto])


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("boards", [False, True])
def test_a_plane_that_lies_askew_is_open(gpu: Gpu, name: str, scale: float, boards: bool) -> None:
    """No box around its triangles hides what they do themselves; boards are a thousand times as long as wide."""
    turn = props.turned(0.35, 0.4)
    shape = props.boards(1000 * scale, scale, 8) if boards else props.floor(0, 20 * scale)
    camera = Camera(
        turn.point(0.1 * scale, 1.6 * scale, 3.5 * scale), turn.point(0, 0.5 * scale, 0), turn.point(0, 1, 0)
    )
    scene = Scene([turn.place(shape)], camera=replace(camera, fov=0.9, near=0.02 * scale), ambient=AMBIENT)
    full, got = draw(gpu, scene, NoOcclusion()), draw(gpu, scene, name)
    assert (full > 0).mean() > 0.4
    np.testing.assert_array_equal(got, full)


@pytest.mark.parametrize("name", ALL)
def test_bumps_in_the_normals_alone_hide_nothing(gpu: Gpu, name: str) -> None:
    """Of an open floor with a steep normal map, also seen from beside; and of a coarse solid with smooth normals."""
    y, x = np.mgrid[0:64, 0:64] * (8 * math.pi / 64)
    normals = np.stack([0.9 * np.sin(x), 0.9 * np.sin(y), np.ones_like(x)], -1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    pixels = np.full((64, 64, 4), 255, np.uint8)
    pixels[..., :3] = np.round((normals * 0.5 + 0.5) * 255)
    bumpy = replace(WHITE, normal_texture=Texture(Image(pixels)))
    part = primitives.ball(1.0, 8, 5)
    ball = Instance(Mesh(part.positions, part.indices, part.normals, material=WHITE))
    for shape, position in (
        (props.floor(0, 4, bumpy), (0.1, 1.5, 3.5)),
        (props.floor(0, 4, bumpy), (0, 0.1, 3.5)),
        (ball, (1, 1, 2.5)),
    ):
        scene = Scene([shape], camera=Camera(position, (0, 0, 0), fov=0.9, near=0.02), ambient=AMBIENT)
        full, got = draw(gpu, scene, NoOcclusion()), draw(gpu, scene, name, frames=2)
        seen = full[..., 0] > 0
        assert seen.sum() > 100
        assert (got[seen] / full[seen]).mean() > 0.999


@pytest.mark.parametrize("name", ALL)
def test_only_the_ambient_light_is_dimmed(gpu: Gpu, name: str) -> None:
    """Not lights, emission or the background; and none of it is made brighter."""
    glowing = replace(WHITE, emissive=(0.3, 0.1, 0.2))
    wall = props.quad((-0.4, 0, 20), (-0.4, 0, -20), (-0.4, 1, -20), (-0.4, 1, 20))
    shapes = [props.floor(0, 20, glowing), wall]
    lit = Scene(shapes, [DirectionalLight((-0.3, -1, -0.2), 2.0)], ABOVE, background=(0.2, 0.4, 0.8))
    rest = draw(gpu, lit, NoOcclusion())
    assert np.array_equal(draw(gpu, lit, name, frames=2), rest)
    both = lit.with_(ambient=AMBIENT)
    assert (draw(gpu, both, name, frames=2) <= draw(gpu, both, NoOcclusion())).all()
    assert (draw(gpu, both, name, frames=2) >= rest).all()


def extremes() -> list[Any]:
    found = []
    for name in ALL:
        for f in fields_of(FAMILY.members[name]):
            for value in (f.param.low, f.param.high):
                if isinstance(value, (int, float)):
                    found.append(pytest.param(name, {f.name: f.type(value)}, id=f"{name}.{f.name}={value:g}"))
    return found


@pytest.mark.parametrize(("name", "changes"), extremes())
def test_the_ends_of_every_range_draw_something(gpu: Gpu, name: str, changes: dict[str, Any]) -> None:
    wall = props.quad((-0.4, 0, 20), (-0.4, 0, -20), (-0.4, 1, -20), (-0.4, 1, 20))
    scene = Scene([props.floor(0, 20), wall], camera=ABOVE, ambient=AMBIENT)
    got = draw(gpu, scene, FAMILY.make(name, changes=changes), frames=2)
    assert np.isfinite(got).all()
    assert got.mean() > 0.1
