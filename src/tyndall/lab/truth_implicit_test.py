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
from tyndall.techniques.shadow.ray_traced import RayTraced
from tyndall.techniques.shadow.shadow_map import ShadowMap

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
    # (What is out of sight makes the shader that of the next test, which then need not be compiled.)
    ball = Implicit(sphere(scale) | box(0.1 * scale).at(0, -50 * scale, 0), material=ROUGH)
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
    slab = sphere(0.4).at(0, 0.7, 0) | box((6.0, 0.5, 6.0)).at(0, -0.25, 0)
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


def still_life() -> Scene:
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
        Medium((0.1, 0.15, 0.2), (0.02, 0.02, 0.02), HenyeyGreenstein(0.3), ((-3, -0.5, -3), (3, 2, 3))),
        background=(0.1, 0.2, 0.3),
        ambient=(0.05, 0.05, 0.05),
        implicits=[Implicit(shape, material=ROUGH)],
    )


def test_it_is_the_truth_of_the_same_scene_of_triangles(gpu: Gpu) -> None:
    """Direct light, air and bounces; but for the triangles' own error along rims."""
    scene, settings = still_life(), TruthSettings(target=0.0, samples=64, depth=3)
    one, two = (traced(gpu, s, settings, (24, 18)) for s in (scene, meshed(scene, 96)))
    with np.errstate(invalid="ignore"):
        alike = np.abs(one.depth - two.depth) < 2e-4 * two.depth
    alike |= np.isinf(one.depth) & np.isinf(two.depth)
    assert alike.mean() > 0.97
    assert (one.depth[alike] < two.depth.max()).sum() > 100
    scale = float(two.radiance.mean())
    off = np.abs(one.radiance - two.radiance)[alike].max(axis=-1)
    error = np.hypot(one.radiance_error, two.radiance_error)[alike].max(axis=-1)
    assert np.sqrt(np.mean(error**2)) < 0.1 * scale
    assert (off > 5 * error + 0.01 * scale).mean() < 0.01, "a rim's shadow may miss a pixel"
    assert one.radiance[alike].mean() == pytest.approx(float(two.radiance[alike].mean()), rel=3e-3)
    assert one.inscattered.mean() == pytest.approx(float(two.inscattered.mean()), rel=1e-2)


def test_its_own_light_is_in_the_unit(gpu: Gpu) -> None:
    """What shines may be a part of a shape, and shines as the whole picture is bright."""
    glowing = Material(base_color=(0, 0, 0, 1), roughness=1, emissive=(3e6, 2e6, 1e6))
    scene = Scene((), (), Camera((0, 0, 4), (0, 0, 0)), implicits=[Implicit((sphere(2) | box()).material(glowing))])
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
    """A software adapter would say nothing. All beads are in one cell of an object that is a thousand kilometres wide,
    so that none is left out anywhere.
    """
    if gpu.adapter_info["adapter_type"] != "CPU":
        pytest.skip("a GPU takes its time")
    beads = [sphere(0.2).at(*place) for place in np.random.default_rng(1).uniform(-1, 1, (4000, 3))]
    wide = union(*beads, box((1e6, 1.0, 1e6)).at(0, -1000, 0))
    scene = Scene((), (SUN,), Camera((0, 1, 4), (0, 0, 0), fov=0.3), implicits=[Implicit(wide)])
    with pytest.raises(GpuError, match="march for longer"):
        traced(gpu, scene, size=(3, 2))


def test_shadow_techniques_tend_to_it(gpu: Gpu) -> None:
    """Off the rims, which a frame draws by a part of a pixel wider."""
    thing = (sphere(0.5) | box((0.9, 0.3, 0.5)).at(0.5, -0.3, 0)).at(-0.2, 0.1, -3)
    sun = DirectionalLight((0.4, -1, -0.3), 2.0, angular_diameter=0.2)
    scene = Scene([props.floor(-0.6, 4, ROUGH)], [sun], props.AHEAD, implicits=[Implicit(thing, material=ROUGH)])
    size = (40, 30)
    found = traced(gpu, scene, TruthSettings(target=4e-3), size)
    got = {
        "rays": props.shoot(gpu, scene, size, shadow=RayTraced(samples=16, fresh=1), frames=4),
        "hard": props.shoot(gpu, scene, size, shadow=ShadowMap(size=1024)),
    }
    seen = np.where(np.isfinite(found.depth), found.depth, 1e3)
    alike = np.abs(got["rays"].depth - seen) < 2e-3 * seen
    alike[1:-1, 1:-1] &= alike[:-2, 1:-1] & alike[2:, 1:-1] & alike[1:-1, :-2] & alike[1:-1, 2:]
    assert alike.mean() > 0.25
    off = {name: props.difference(shot.radiance[alike], found.radiance[alike]) for name, shot in got.items()}
    assert off["rays"] < 0.02, off
    assert off["rays"] < 0.5 * off["hard"] < 0.2, off
