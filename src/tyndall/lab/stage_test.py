"""A still frame is the same whatever was drawn before it."""

from __future__ import annotations

import numpy as np

from tyndall.gpu.device import Gpu
from tyndall.lab.stage import Stage, describe, make
from tyndall.scene.bundled.box import box
from tyndall.scene.model import Implicit, Scene
from tyndall.sdf import sphere


def test_a_still_frame_does_not_remember(gpu: Gpu) -> None:
    scene = box()
    with Stage(scene, (48, 27), adapter=gpu, seed=5) as stage:
        march = make("volumetric", "march", scene)
        first = stage.still(march)
        renderer = stage.use(make("volumetric", "off", scene))
        for _ in range(3):
            renderer.draw()
        again = stage.still(march)
    assert np.array_equal(first.light, again.light)
    assert np.array_equal(first.picture.pixels, again.picture.pixels)
    assert first.picture.metadata["technique"] == "march"


def test_another_size_is_the_same_view(gpu: Gpu) -> None:
    scene = box()
    march = make("volumetric", "march", scene, {"march": {"steps": 256, "jitter": 0}})
    with Stage(scene, (80, 45), adapter=gpu) as stage, stage.resized((16, 9)) as small:
        large_light, small_light = stage.still(march).light, small.still(march).light
    # An odd factor: the centres of small pixels are centres of large ones.
    np.testing.assert_allclose(large_light[2::5, 2::5], small_light, rtol=1e-2, atol=1e-3 * float(small_light.mean()))


def test_a_technique_is_described_by_its_parameters() -> None:
    scene = box()
    described = describe(make("volumetric", "froxel", scene, {"froxel": {"grid": (8, 8, 8)}}))
    assert described["technique"] == "froxel"
    assert described["grid"] == (8, 8, 8)


def test_a_technique_of_any_family_takes_its_family_s_place(gpu: Gpu) -> None:
    scene = box()
    coarse = make("shadow", "shadow_map", scene, {"shadow_map": {"size": 16}})
    with Stage(scene, (48, 27), volumetric="march", adapter=gpu) as stage:
        fine = stage.still(stage.techniques["shadow"])
        rough = stage.still(coarse)
        again = stage.still(make("volumetric", "march", scene))
    assert fine.light.mean() > 0, "the stage's own volumetric technique is in use"
    assert not np.array_equal(fine.light, rough.light)
    assert np.array_equal(fine.light, again.light), "the stage's own shadows are back"


def test_without_shadows_everything_is_at_least_as_bright(gpu: Gpu) -> None:
    scene = box()
    with Stage(scene, (48, 27), adapter=gpu) as stage:
        full = stage.unshadowed()
        still = stage.still(make("volumetric", "march", scene, {"march": {"jitter": 0, "steps": 32}}))
    for kind in ("inscattered", "surfaces"):
        light, most = still.of(kind), full.of(kind)
        assert (light <= most * 1.01 + 1e-3 * float(most.mean())).all()
        assert light.mean() < 0.9 * most.mean(), "a room with one opening"
    np.testing.assert_array_equal(still.picture.depth, full.picture.depth)


def test_the_parts_of_a_still_frame_are_the_whole(gpu: Gpu) -> None:
    scene = box()
    with Stage(scene, (48, 27), adapter=gpu) as stage:
        still = stage.still(make("volumetric", "froxel", scene))
    whole = still.of("surfaces") + still.of("inscattered")
    np.testing.assert_allclose(still.of("radiance"), whole, rtol=3e-3, atol=1e-4)


def test_light_is_developed_as_a_frame_is(gpu: Gpu) -> None:
    scene = box()
    with Stage(scene, (48, 27), adapter=gpu) as stage:
        still = stage.still(make("volumetric", "march", scene))
        stage.still(make("volumetric", "off", scene))
        assert np.array_equal(stage.develop(still.picture.radiance), still.picture.pixels)
        assert not stage.develop(np.full((27, 48, 3), -1.0, np.float32)).max() > 1, "but for the dither"
        after = stage.still(make("volumetric", "march", scene))
    assert np.array_equal(after.picture.pixels, still.picture.pixels)


def test_with_the_lights_off_what_is_ambient_stays(gpu: Gpu) -> None:
    scene = box()
    dark = scene.with_(lights=())
    with Stage(scene, (48, 27), adapter=gpu) as stage, Stage(dark, (48, 27), adapter=gpu) as other:
        unlit, expected = stage.unlit(), other.still(make("volumetric", "off", dark))
        lit = stage.still(make("volumetric", "off", scene))
    np.testing.assert_array_equal(unlit.surfaces, expected.surfaces)
    assert unlit.surfaces.mean() > 0, "the scene has ambient light"
    assert lit.surfaces.mean() > 1.05 * unlit.surfaces.mean(), "the lights are on again"


def test_how_rays_are_marched_is_the_scenes_then_what_is_asked_for(gpu: Gpu) -> None:
    scene = Scene(implicits=[Implicit(sphere(1))], looks={"marching": {"steps": 7, "threshold": 1}})
    with (
        Stage(scene, (8, 8), parameters={"marching": {"steps": "9"}}, adapter=gpu) as stage,
        stage.resized((4, 4)) as other,
    ):
        assert (stage.marching.steps, stage.marching.threshold) == (9, 1)
        assert other.marching == stage.marching
