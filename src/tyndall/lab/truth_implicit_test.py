"""Truth of scenes with implicit surfaces: closed forms, and the same scenes made of triangles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import props
import pytest

from tyndall.gpu.device import Gpu, GpuError
from tyndall.lab import truth as module
from tyndall.lab.meshed import meshed
from tyndall.lab.truth import Truth, TruthSettings, trace, unit_of
from tyndall.lab.ztest import z_test
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    HenyeyGreenstein,
    Implicit,
    Material,
    Medium,
    PointLight,
    Scene,
)
from tyndall.sdf import box, sphere, union

ROUGH = Material("rough", base_color=(0.8, 0.7, 0.6, 1), roughness=0.9)
RED = Material("red", base_color=(0.8, 0.1, 0.1, 1), roughness=0.4)
SUN = DirectionalLight((0.6, -0.7, -0.5), 2.0, (1.0, 0.8, 0.5))
ONCE = TruthSettings(target=1, samples=32)


def traced(gpu: Gpu, scene: Scene, settings: TruthSettings = ONCE, size: tuple[int, int] = (32, 24)) -> Truth:
    return trace(scene, size, settings, gpu=gpu, cache=False)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_ball_in_the_sun_is_shaded_as_the_closed_form_says(gpu: Gpu, scale: float) -> None:
    """To the terminator and beyond it: neither its own march's reach nor its normals darken or brighten it."""
    camera = Camera((0, 0, 4 * scale), (0, 0, 0), fov=0.6, near=0.01 * scale)
    ball = Implicit(sphere(scale), material=ROUGH)
    size = (48, 36)
    found = traced(gpu, Scene((), (SUN,), camera, implicits=[ball]), size=size)
    seen = props.rays(camera, size)
    b = (seen.directions * seen.origin).sum(-1)
    root = b * b - (16 - 1) * scale**2
    normal = (seen.at(-b - np.sqrt(np.maximum(root, 0)))) / scale
    towards = -np.array(SUN.direction) / np.linalg.norm(SUN.direction)
    expected = props.reflected(ROUGH, normal, -seen.directions, towards) * np.multiply(SUN.color, SUN.intensity)
    expected = np.where((root > 0)[..., None], expected, 0)
    clear = np.abs(root) > 2e-3 * scale**2  # but for a pixel on the very rim
    assert np.isfinite(found.depth)[clear].tolist() == (root > 0)[clear].tolist()
    off = np.abs(found.radiance - expected)[clear]
    assert off.max() < 2e-3 * expected.max()
    dark = clear & (root > 0) & ((normal * towards).sum(-1) < 0)
    assert dark.sum() > 30
    assert not found.radiance[dark].any()


def test_a_balls_shadow_on_a_slab_is_where_geometry_says(gpu: Gpu) -> None:
    """Both are one object; and the lamp is of a place."""
    camera = Camera((0, 3, 3), (0, 0, 0), fov=0.8)
    slab = box((6.0, 0.5, 6.0)).at(0, -0.25, 0) | sphere(0.4).at(0, 0.7, 0)
    lamp = PointLight((1.0, 3.0, 0.5), 30.0)
    size = (48, 36)
    found = traced(gpu, Scene((), (lamp,), camera, implicits=[Implicit(slab, material=ROUGH)]), size=size)
    seen = props.rays(camera, size)
    t = -seen.origin[1] / seen.directions[..., 1]
    points = seen.at(t)
    floor = np.abs(found.depth - t / seen.stretch) < 1e-3
    way = np.array(lamp.position) - points
    reach = np.linalg.norm(way, axis=-1, keepdims=True)
    way = way / reach
    to_ball = np.array([0, 0.7, 0]) - points
    along = (to_ball * way).sum(-1)
    past = np.linalg.norm(to_ball - along[..., None] * way, axis=-1)
    expected = props.reflected(ROUGH, (0, 1, 0), -seen.directions, way) * lamp.intensity / reach**2
    expected *= np.where(past < 0.4, 0.0, 1.0)[..., None]
    clear = floor & (np.abs(past - 0.4) > 1e-4)
    assert (clear & (past < 0.4)).sum() > 20
    assert clear.sum() > 700
    np.testing.assert_allclose(found.radiance[clear], expected[clear], rtol=2e-3, atol=2e-3 * expected.max())


def still_life(medium: Medium | None = None) -> Scene:
    """Rounded things of several materials, a cut among them, over a floor of triangles."""
    shape = union(
        sphere(0.5).material(RED) - sphere(0.3).at(0.1, 0.4, 0.2),
        sphere(0.35).at(0.7, -0.15, 0.2),
        smooth=0.1,
    )
    lights = (DirectionalLight((0.4, -1, -0.3), 2.0, angular_diameter=0.1), PointLight((-1.2, 1.0, 1.0), 4.0))
    return Scene(
        [props.floor(-0.5, 4, ROUGH)],
        lights,
        Camera((0, 0.8, 2.6), (0.2, -0.1, 0), fov=0.7),
        medium or Medium(),
        background=(0.1, 0.2, 0.3),
        ambient=(0.05, 0.05, 0.05),
        implicits=[Implicit(shape, material=ROUGH)],
    )


@pytest.mark.parametrize("depth", [2, 3])
def test_it_is_the_truth_of_the_same_scene_of_triangles(gpu: Gpu, depth: int) -> None:
    """Direct light and air, then bounces too; but for the triangles' own error along rims."""
    air = Medium((0.1, 0.15, 0.2), (0.02, 0.02, 0.02), HenyeyGreenstein(0.3), ((-3, -0.5, -3), (3, 2, 3)))
    scene = still_life(air if depth == 2 else None)
    settings = TruthSettings(target=0.0, samples=128 if depth == 2 else 64, depth=depth)
    one, two = (traced(gpu, s, settings, (24, 18)) for s in (scene, meshed(scene, 96)))
    alike = np.abs(one.depth - two.depth) < 2e-4 * two.depth
    alike |= np.isinf(one.depth) & np.isinf(two.depth)
    assert alike.mean() > 0.97
    assert (one.depth[alike] < two.depth.max()).sum() > 100
    result = z_test(
        one.radiance[alike],
        two.radiance[alike],
        one.radiance_error[alike],
        two.radiance_error[alike],
        a_freedom=one.freedom,
        b_freedom=two.freedom,
        tolerance=4e-3,
    )
    assert result, str(result)


def test_its_own_light_is_in_the_unit(gpu: Gpu) -> None:
    """What shines may be a part of a shape, and shines as the whole picture is bright."""
    glowing = Material(base_color=(0, 0, 0, 1), roughness=1, emissive=(3e6, 2e6, 1e6))
    scene = Scene((), (), Camera((0, 0, 4), (0, 0, 0)), implicits=[Implicit(sphere(2).material(glowing))])
    assert unit_of(scene) >= 3e6
    found = traced(gpu, scene, size=(4, 3))
    np.testing.assert_allclose(found.radiance[1, 1], glowing.emissive, rtol=1e-5)


def test_the_cache_knows_the_code_of_implicit_surfaces(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    listed: list[Path] = []
    monkeypatch.setattr(module, "version_of", lambda sources: listed.extend(sources) or "version")
    one, two = (module._entry(Scene(implicits=[Implicit(sphere(r))]), (4, 3), ONCE, gpu) for r in (1.0, 1.0000001))
    assert one != two
    names = {f"{path.parent.name}/{path.name}" for path in listed}
    assert {"sdf/march.wesl", "sdf/interpreter.wesl", "sdf/program.py", "sdf/field.py", "tracing/fields.wesl"} <= names
    assert not any("_test" in name for name in names)


def test_loops_that_are_ended_early_are_no_truth(gpu: Gpu) -> None:
    """A shape of which nothing can be pruned: the march of a ray that passes it by closely takes too many turns for a
    software adapter, which would say nothing.
    """
    if gpu.adapter_info["adapter_type"] != "CPU":
        pytest.skip("a GPU takes its time")
    rng = np.random.default_rng(1)
    beads = [sphere(0.2).at(*place) for place in rng.uniform(-1, 1, (400, 3))]
    scene = Scene(implicits=[Implicit(union(*beads, smooth=0.01, blend="root"))], lights=(SUN,))
    scene = scene.with_(camera=Camera((0, 1, 4), (0, 0, 0), fov=0.3))
    with pytest.raises(GpuError, match="march for longer"):
        traced(gpu, scene, size=(8, 2))
