"""The base image against closed forms, and the frame's own promises."""

from __future__ import annotations

import contextlib
import math
from dataclasses import replace
from typing import Any

import numpy as np
import props
import pytest
from props import AHEAD, TINY, WHITE, shoot

from tyndall.frame import Renderer, view_matrix
from tyndall.gpu.device import Gpu, GpuError
from tyndall.gpu.params import ParameterError
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    Light,
    Material,
    Medium,
    PointLight,
    Scene,
    SpotLight,
)
from tyndall.techniques.shadow.shadow_map import ShadowMap

LIGHTS = [
    pytest.param(DirectionalLight((0.3, -0.5, -0.8), 2.0, (1.0, 0.8, 0.5)), id="directional"),
    pytest.param(PointLight((1.0, 0.5, -2.0), 9.0, (0.5, 0.8, 1.0)), id="point"),
    pytest.param(SpotLight((1.0, 0.5, 0.0), (-0.2, -0.1, -1.0), 30.0, (1.0, 1.0, 0.5), 0.2, 0.6), id="spot"),
]
MATERIALS = [
    pytest.param(WHITE, id="white"),
    pytest.param(Material("gloss", (1, 1, 1, 1), roughness=0.25), id="gloss"),
    pytest.param(Material("black", (0, 0, 0, 1), roughness=0.5), id="black"),
    pytest.param(Material("metal", (1, 1, 1, 1), metallic=1.0, roughness=0.4), id="metal"),
    pytest.param(Material("half", (1, 1, 1, 1), metallic=0.4, roughness=0.7, emissive=(0.5, 2.0, 0.1)), id="half"),
]


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("material", MATERIALS)
def test_a_lit_wall_is_the_closed_form(gpu: Gpu, light: Light, material: Material) -> None:
    """Illuminance, 1/r², the cone of KHR_lights_punctual and the BRDF, in every pixel; ambient and emission add."""
    scene = Scene([props.wall(-5, material=material)], [light], AHEAD, ambient=(0.02, 0.01, 0.03))
    shot = shoot(gpu, scene, shadow=ShadowMap(size=1024))
    expected = props.surface_light(scene, TINY, (0, 0, 1), 5 * props.rays(AHEAD, TINY).stretch)
    # Roughness and metallic are kept in 8 and 16 bits, light in 16.
    np.testing.assert_allclose(shot.base, expected, rtol=0.01, atol=2e-3 * expected.max())


@pytest.mark.parametrize("angle", [0.5, 0.05, 0.02, 0.005])
def test_a_narrow_cone_is_as_bright_on_its_axis_as_a_wide_one(gpu: Gpu, angle: float) -> None:
    light = SpotLight((0, 0, 0), (0, 0, -1), 25 * math.pi, outer_angle=angle)
    scene = Scene([props.wall(-5)], [light], replace(AHEAD, fov=0.01))
    base = shoot(gpu, scene, (3, 3), shadow=ShadowMap(size=256)).base
    expected = props.surface_light(scene, (3, 3), (0, 0, 1), 5 * props.rays(scene.camera, (3, 3)).stretch)
    np.testing.assert_allclose(base[1, 1], expected[1, 1], rtol=0.01)


def test_a_point_light_in_the_air_is_dimmed_on_its_way(gpu: Gpu) -> None:
    medium = Medium((0.1, 0.2, 0.3), 0.05)
    scene = Scene([props.wall(-5)], [PointLight((0, 0, -1.0), 9.0)], AHEAD, medium)
    shot = shoot(gpu, scene, volumetric="march")
    expected = props.surface_light(scene, TINY, (0, 0, 1), 5 * props.rays(AHEAD, TINY).stretch)
    np.testing.assert_allclose(shot.base, expected, rtol=0.01)
    clear = props.surface_light(scene.with_(medium=Medium()), TINY, (0, 0, 1), 5 * props.rays(AHEAD, TINY).stretch)
    assert (expected[..., 2] < 0.4 * clear[..., 2]).all()


def test_a_white_furnace_is_exactly_one(gpu: Gpu) -> None:
    """A white surface in light that is 1 from everywhere is 1: nothing tells it from its surroundings."""
    for roughness in (0.0, 0.5, 1.0):
        white = Material("white", (1, 1, 1, 1), roughness=roughness)
        scene = Scene([props.box((-1, -1, -4), (1, 1, -3), white)], [], AHEAD, ambient=(1,) * 3, background=(1,) * 3)
        shot = shoot(gpu, scene)
        assert np.isfinite(shot.depth).any()
        assert np.isinf(shot.depth).any()
        assert (shot.base == 1).all()
        assert (shot.picture == 255).all()


def test_depth_is_metres_along_the_view_axis(gpu: Gpu) -> None:
    size = (31, 21)
    scene = Scene([props.wall(-7, 2), props.box((-0.4, -0.4, -3.5), (0.5, 0.3, -3)), props.floor(-1, 30)], [], AHEAD)
    hit = props.cast(scene, AHEAD.position, props.rays(AHEAD, size).directions)
    expected = hit.distance / props.rays(AHEAD, size).stretch
    depth = shoot(gpu, scene, size).depth
    assert np.array_equal(np.isinf(depth), np.isinf(expected))
    sure = np.isfinite(expected)
    # Rasterisers snap vertices to 1/256 of a pixel; on a floor seen at this size that is some 1e-3 of its distance.
    agree = np.abs(depth[sure] / expected[sure] - 1) < 3e-3
    assert agree.mean() > 0.98  # a centre on a silhouette may go either way
    assert {-1, 0, 1, 2} == set(np.unique(hit.instance))


@pytest.mark.parametrize("near", [1e-4, 0.01, 1.0])
def test_reversed_depth_keeps_far_surfaces_apart(gpu: Gpu, near: float) -> None:
    """A centimetre at a kilometre: 1e-5, 80 float32 steps of reversed depth, whatever the near plane."""
    camera = replace(AHEAD, near=near)
    back = Material("back", (1, 1, 1, 1), emissive=(1, 0, 0))
    front = Material("front", (1, 1, 1, 1), emissive=(0, 1, 0))
    scene = Scene([props.wall(-1000, 9000, front), props.wall(-1000.02, 9000, back)], [], camera)
    assert (shoot(gpu, scene).base == [0, 1, 0]).all()


def test_the_near_plane_cuts(gpu: Gpu) -> None:
    scene = Scene([props.wall(-0.5), props.wall(-2)], [], replace(AHEAD, near=1.0))
    np.testing.assert_allclose(shoot(gpu, scene).depth, 2, rtol=1e-4)


def test_exposure_scales_the_picture_and_not_the_light(gpu: Gpu) -> None:
    grey = Material("grey", (1, 1, 1, 1), emissive=(0.05, 0.1, 0.2))
    shots = [shoot(gpu, Scene([props.wall(-2, material=grey)], [], replace(AHEAD, exposure=ev))) for ev in (0, 2)]
    assert np.array_equal(shots[0].radiance, shots[1].radiance)

    def encoded(x: float) -> int:
        return round(255 * (12.92 * x if x <= 0.0031308 else 1.055 * x ** (1 / 2.4) - 0.055))

    for shot, factor in zip(shots, (1, 4), strict=True):
        expected = [encoded(factor * x) for x in (0.05, 0.1, 0.2)]
        assert np.abs(shot.picture.astype(int) - expected).max() <= 1


def test_no_light_above_half_float_and_none_below_zero(gpu: Gpu) -> None:
    fierce = Scene([props.wall(-2)], [PointLight((0, 0, -1.999), 1e9)], AHEAD, Medium(0.1), background=(9e9, 0, 0))
    shot = shoot(gpu, fierce, volumetric="march", frames=2, antialiasing="taa", tonemap="aces")
    for image in (shot.base, shot.radiance):
        assert np.isfinite(image).all()
        assert (image >= 0).all()


def test_first_row_is_on_top_and_first_column_left(gpu: Gpu) -> None:
    red, green = (Material(n, (1, 1, 1, 1), emissive=e) for n, e in (("r", (1, 0, 0)), ("g", (0, 1, 0))))
    up = props.quad((-9, 0.01, -3), (9, 0.01, -3), (9, 9, -3), (-9, 9, -3), red)
    right = props.quad((0.01, -9, -2.9), (9, -9, -2.9), (9, 0, -2.9), (0.01, 0, -2.9), green)
    base = shoot(gpu, Scene([up, right], [], AHEAD)).base
    assert (base[:6] == [1, 0, 0]).all()
    assert (base[6:, 8:] == [0, 1, 0]).all()
    assert not base[6:, :8].any()


def test_drawing_with_another_camera(gpu: Gpu) -> None:
    scene = Scene([props.wall(-4)], [], AHEAD)
    with Renderer(scene, TINY, gpu=gpu, volumetric="off", antialiasing="none", shadow=ShadowMap(size=64)) as renderer:
        for z in (0.0, 1.0, -2.0):
            renderer.draw(replace(AHEAD, position=(0, 0, z), target=(0, 0, z - 1)))
            np.testing.assert_allclose(renderer.depth(), 4 + z, rtol=1e-5)


def test_an_empty_scene_is_its_background(gpu: Gpu) -> None:
    shot = shoot(gpu, Scene(background=(0.25, 0.5, 0.75)), volumetric="froxel")
    assert (shot.radiance == [0.25, 0.5, 0.75]).all()
    assert np.isinf(shot.depth).all()


def test_unknown_techniques_are_refused_before_anything_is_made(gpu: Gpu) -> None:
    before = gpu.ledger.total
    for family in ("volumetric", "shadow", "antialiasing", "tonemap"):
        with pytest.raises(ParameterError, match=f"no {family} technique 'froxle'"):
            Renderer(Scene(), TINY, gpu=gpu, **{family: "froxle"})
    with pytest.raises(ParameterError, match="shadow_map is not a volumetric technique"):
        Renderer(Scene(), TINY, gpu=gpu, volumetric=ShadowMap())
    assert gpu.ledger.total == before


def test_a_technique_that_is_switched_leaves_nothing_in_the_history(gpu: Gpu) -> None:
    """While the camera stands still nothing is clipped: the old air, or an empty history, would stay for 50 frames."""
    scene = Scene([props.wall(-4)], [DirectionalLight((0, 0, -1), 3.0)], AHEAD, Medium(0.2))
    with Renderer(scene, TINY, gpu=gpu, volumetric="march", shadow=ShadowMap(size=64)) as renderer:
        for _ in range(8):
            renderer.draw()
        for family, technique in (("volumetric", "off"), ("antialiasing", "taa")):
            renderer.use(family, technique)
            renderer.draw()
            # No air, and a wall that is the same everywhere.
            np.testing.assert_allclose(renderer.radiance(), renderer.base(), rtol=2e-3)


def test_a_frame_that_fails_leaves_nothing_behind(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene([props.wall(-4)], [DirectionalLight((0, 0, -1))], AHEAD)
    with Renderer(scene, TINY, gpu=gpu, volumetric="off", shadow=ShadowMap(size=64)) as renderer:
        renderer.draw()
        passes = [label for label, _ in gpu.timings()]
        assert "volumetric.off.clear" in passes

        def interrupted(*_: object) -> None:
            raise KeyboardInterrupt

        with monkeypatch.context() as patch:
            patch.setattr(type(renderer.technique("tonemap")), "render", interrupted)
            with pytest.raises(KeyboardInterrupt):
                renderer.draw()
        renderer.draw()
        assert [label for label, _ in gpu.timings()] == passes


def test_a_renderer_that_cannot_be_made_leaves_nothing_behind(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    before = gpu.ledger.total
    made = Gpu.texture, Gpu.buffer
    for name, method in zip(("texture", "buffer"), made, strict=True):
        for refused in ("frame.lit", "frame.black", "mesh.indices", "mesh.materials", "frame.lights"):

            def limited(self: Gpu, label: str, *args: Any, _method: Any = method, _no: str = refused, **kw: Any) -> Any:
                if label == _no:
                    raise GpuError(f"{label}: Not enough memory left.")
                return _method(self, label, *args, **kw)

            with monkeypatch.context() as patch, contextlib.suppress(GpuError):
                patch.setattr(Gpu, name, limited)
                Renderer(Scene([props.wall(-4)]), TINY, gpu=gpu).close()
            assert gpu.ledger.total == before, refused


def test_memory_is_the_renderers_own(gpu: Gpu) -> None:
    """Two renderers share a device: neither counts the other's bytes, and together they are the ledger's."""
    scene = Scene([props.wall(-4)], [DirectionalLight((0, 0, -1))], AHEAD, Medium(0.1))
    other = gpu.ledger.by_owner()
    other.pop("constants", None)
    with Renderer(scene, TINY, gpu=gpu, shadow=ShadowMap(size=64)) as one:
        one.draw()
        alone = one.memory()
        assert alone.keys() == {
            *("frame", "mesh", "shadow.shadow_map", "volumetric.froxel", "antialiasing.taa", "tonemap.aces")
        }
        with Renderer(scene, (8, 8), gpu=gpu, shadow=ShadowMap(size=64)) as two:
            two.draw()
            assert one.memory() == alone
            both = gpu.ledger.by_owner()
            both.pop("constants")
            assert sum(both.values()) == sum(r for m in (other, alone, two.memory()) for r in m.values())


@pytest.mark.parametrize("size", [(16.0, 12.0), "16x12"])
def test_a_size_is_in_whole_pixels(gpu: Gpu, size: Any) -> None:
    with pytest.raises(ParameterError, match="^size: .* is not a width and a height in whole pixels$"):
        Renderer(Scene(), size, gpu=gpu)


@pytest.mark.parametrize("seed", [-1, 2**32])
def test_a_seed_has_32_bits(gpu: Gpu, seed: int) -> None:
    with pytest.raises(ParameterError, match=f"^seed: {seed} is outside 0 … 4294967295$"):
        Renderer(Scene(), TINY, gpu=gpu, seed=seed)


def test_looks_of_a_scene_are_starting_values(gpu: Gpu) -> None:
    scene = Scene(looks={"froxel": {"grid": (8, 6, 4)}, "shadow_map": {"size": 128}})
    with Renderer(scene, TINY, gpu=gpu) as renderer:
        assert renderer.technique("volumetric").grid == (8, 6, 4)
        assert renderer.technique("shadow").size == 128
        renderer.draw()
        assert renderer.memory()["volumetric.froxel"] < 8 * 6 * 4 * 16 + 100


def test_host_time_of_a_frame_is_reported(gpu: Gpu) -> None:
    scene = Scene([props.wall(-4)], [DirectionalLight()], AHEAD)
    with Renderer(scene, TINY, gpu=gpu, volumetric="off", shadow=ShadowMap(size=64)) as renderer:
        times = [renderer.draw() for _ in range(5)]
        gpu.wait()
    assert all(math.isfinite(t) and t > 0 for t in times)


def test_camera_matrices_are_right_handed() -> None:
    camera = Camera((3, 1, 2), (0, 0.5, -1))
    matrix = view_matrix(camera)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1)
    np.testing.assert_allclose(matrix @ [*camera.position, 1], [0, 0, 0, 1], atol=1e-12)
    towards = matrix @ [*camera.target, 1]
    np.testing.assert_allclose(towards[:2], 0, atol=1e-12)
    assert towards[2] < 0
