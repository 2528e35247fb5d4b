"""A still frame is the same whatever was drawn before it."""

from __future__ import annotations

import numpy as np

from tyndall.gpu.device import Gpu
from tyndall.lab.stage import Stage, describe, make
from tyndall.scene.bundled.box import box


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
