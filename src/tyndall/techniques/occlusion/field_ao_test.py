"""Ambient light that the field hides: open is open, and corners are the closed form's."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import props
import pytest
from props import WHITE

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.scene.model import Camera, DirectionalLight, Implicit, Scene
from tyndall.sdf import box, sphere
from tyndall.techniques.contract import Technique, Unsupported
from tyndall.techniques.occlusion.field_ao import FieldAo
from tyndall.techniques.occlusion.none import NoOcclusion

SIZE = (48, 36)
AMBIENT = (0.5, 1.0, 0.25)


def draw(gpu: Gpu, scene: Scene, technique: Technique) -> np.ndarray:
    others: dict[str, Any] = {"volumetric": "off", "antialiasing": "none", "tonemap": "none"}
    with Renderer(scene, SIZE, gpu=gpu, occlusion=technique, **others) as renderer:
        renderer.draw()
        return renderer.base().astype(float)


def opening(gpu: Gpu, scene: Scene, technique: Technique) -> np.ndarray:
    """(H, W): the part of the ambient light that is left."""
    full = draw(gpu, scene, NoOcclusion())
    return draw(gpu, scene, technique)[..., 1] / np.where(full[..., 1] > 0, full[..., 1], 1)


def corner(k: np.ndarray) -> np.ndarray:
    """What is open at k radii from a wall without end: of the unit disk, the part on this side of a line at k."""
    k = np.clip(k, 0, 1)
    return 1 - (np.arccos(k) - k * np.sqrt(1 - k * k)) / np.pi


@pytest.mark.parametrize("cones", [1, 7])
@pytest.mark.parametrize("scale", [1e-2, 1.0, 1e2])
def test_a_plane_is_open(gpu: Gpu, scale: float, cones: Any) -> None:
    """Of its own field, and a mesh with nothing near, also seen at a grazing angle."""
    for height in (1.1, 0.15):
        camera = Camera((0.9 * scale, height * scale, 1.6 * scale), (0, 0, 0), fov=0.8, near=0.02 * scale)
        far = Implicit(sphere(0.5 * scale).at(0, 60 * scale, 0))
        own = Implicit(box(tuple(scale * x for x in (40, 2, 40))).at(0, -scale, 0), material=WHITE)
        for shapes, implicits in (([props.floor(0, 20 * scale)], (far,)), ([props.floor(0, 20 * scale)], (own,))):
            scene = Scene(shapes, camera=camera, ambient=AMBIENT, implicits=props.fields(*implicits))
            got = opening(gpu, scene, FieldAo(radius=scale, cones=cones))
            below = props.rays(camera, SIZE).directions[..., 1] < -0.05
            np.testing.assert_allclose(got[below], 1, atol=2e-3)


@pytest.mark.parametrize("cones", [1, 7])
@pytest.mark.parametrize("thickness", [2.0, 0.02])
@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_a_corner_is_as_open_as_the_closed_form(gpu: Gpu, thickness: float, turn: float, cones: Any) -> None:
    camera = Camera((1.2, 1.6, 0), (1.0, 0, 0), fov=0.9, near=0.02)
    wall = Implicit(box((thickness, 20, 40)).at(-0.5 * thickness, 0, 0).rotate(turn, (0, 1, 0)), material=WHITE)
    scene = Scene([props.floor(0, 20)], camera=camera, ambient=AMBIENT, implicits=props.fields(wall))
    got = opening(gpu, scene, FieldAo(radius=1.0, cones=cones))
    seen = props.rays(camera, SIZE)
    points = seen.at(-seen.origin[1] / seen.directions[..., 1])
    away = points[..., 0] * math.cos(turn) - points[..., 2] * math.sin(turn)
    sure = away > 0.03
    off = (got - corner(away))[sure]
    assert away[sure].min() < 0.25
    assert away.max() > 1.5
    assert np.abs(off).max() < (0.02 if cones == 7 else 0.012)
    assert abs(off.mean()) < 0.01


def test_a_deep_corner_is_a_quarter_open(gpu: Gpu) -> None:
    """Where a floor and two walls meet, all within the radius."""
    camera = Camera((1.2, 1.2, 1.2), (0.01, 0, 0.01), fov=0.05, near=0.02)
    walls = [Implicit(box((2, 40, 40)).at(-1, 0, 0)), Implicit(box((40, 40, 2)).at(0, 0, -1))]
    scene = Scene([props.floor(0, 20)], camera=camera, ambient=AMBIENT, implicits=props.fields(*walls))
    got = opening(gpu, scene, FieldAo(radius=20.0))
    seen = props.rays(camera, SIZE)
    points = seen.at(-seen.origin[1] / seen.directions[..., 1])
    inside = (points[..., [0, 2]] > 0.002).all(-1)
    assert inside.sum() > 100
    np.testing.assert_allclose(got[inside], 0.25, atol=0.09)


def test_a_ball_over_a_floor_hides_its_form_factor(gpu: Gpu) -> None:
    """Right below a ball of radius r whose centre is h above, (r/h)² of the light is hidden."""
    camera = Camera((0.4, 0.2, 2.0), (0, 0, 0), fov=0.1, near=0.02)
    for height in (1.2, 1.5):
        ball = Implicit(sphere(1).at(0, height, 0))
        scene = Scene([props.floor(0, 20)], camera=camera, ambient=AMBIENT, implicits=props.fields(ball))
        got = opening(gpu, scene, FieldAo(radius=10.0))[16:20, 22:26].mean()
        assert got == pytest.approx(1 - 1 / height**2, abs=0.15)


def test_taps_below_a_ball_are_dark_and_beside_it_lighter(gpu: Gpu) -> None:
    """A ball that rests on the floor: by 0.3 at most from its form factor, and lighter the farther."""
    camera = Camera((0, 3, 6), (0, 0.5, 0), fov=1.0, near=0.02)
    ball = Implicit(sphere(1).at(0, 1, 0))
    scene = Scene([props.floor(0, 20)], camera=camera, ambient=AMBIENT, implicits=props.fields(ball))
    seen = props.rays(camera, SIZE)
    points = seen.at(-seen.origin[1] / seen.directions[..., 1])
    away = np.hypot(points[..., 0], points[..., 2])
    got = opening(gpu, scene, FieldAo(radius=5.0, cones=1))
    beside = (points[..., 2] > 0.3) & (away > 1) & (away < 4)
    want = 1 - (1 + away**2) ** -1.5
    assert np.abs(got - want)[beside].max() < 0.15
    assert np.corrcoef(got[beside], away[beside])[0, 1] > 0.7


@pytest.mark.parametrize("taps", range(1, 9))
def test_more_taps_follow_the_corner_better(gpu: Gpu, taps: int) -> None:
    camera = Camera((1.2, 1.6, 0), (1.0, 0, 0), fov=0.9, near=0.02)
    wall = Implicit(box((2, 20, 40)).at(-1, 0, 0))
    scene = Scene([props.floor(0, 20)], camera=camera, ambient=AMBIENT, implicits=props.fields(wall))
    got = opening(gpu, scene, FieldAo(cones=1, taps=taps))
    seen = props.rays(camera, SIZE)
    away = seen.at(-seen.origin[1] / seen.directions[..., 1])[..., 0]
    assert np.abs(got - corner(away))[away > 0.03].max() < 0.006 + 0.1 / taps**2


def test_only_the_ambient_light_is_dimmed(gpu: Gpu) -> None:
    camera = Camera((0.9, 1.1, 1.6), (0.2, 0, 0), fov=0.8, near=0.02)
    wall = Implicit(box((2, 4, 40)).at(-1.4, 0, 0))
    lit = Scene([props.floor(0, 20)], [DirectionalLight((-0.3, -1, -0.2), 2.0)], camera, implicits=props.fields(wall))
    assert np.array_equal(draw(gpu, lit, FieldAo()), draw(gpu, lit, NoOcclusion()))
    both = lit.with_(ambient=AMBIENT)
    dark, full = draw(gpu, both, FieldAo()), draw(gpu, both, NoOcclusion())
    assert (dark <= full).all()
    assert (dark < 0.95 * full).any()
    half = draw(gpu, both, FieldAo(strength=0.5))
    np.testing.assert_allclose(half, 0.5 * (dark + full), rtol=2e-3, atol=1e-3)


def test_a_scene_without_implicit_surfaces_is_refused(gpu: Gpu) -> None:
    with pytest.raises(Unsupported, match="^field_ao: .* use ray_traced_ao$"):
        Renderer(Scene([props.floor(0, 20)]), SIZE, gpu=gpu, occlusion="field_ao")
