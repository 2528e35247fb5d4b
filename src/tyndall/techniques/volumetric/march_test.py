"""The march: exact steps, and many lights in several dispatches."""

from __future__ import annotations

import numpy as np
import props
import pytest
from props import AHEAD, TINY, shoot

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.scene.model import DirectionalLight, HenyeyGreenstein, Medium, PointLight, Scene
from tyndall.techniques.shadow.shadow_map import ShadowMap
from tyndall.techniques.volumetric import march
from tyndall.techniques.volumetric.march import March

LIGHTS = [
    DirectionalLight((0.3, -0.5, -0.8), 1.0, (1.0, 0.3, 0.2)),
    PointLight((0.6, 0.4, -3.0), 2.0, (0.2, 1.0, 0.3)),
    DirectionalLight((-0.4, -0.5, -0.8), 1.0, (0.2, 0.3, 1.0)),
    DirectionalLight((0.0, -1.0, -0.1), 0.5),
    DirectionalLight((0.0, -0.1, -1.0), 0.7),
]


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5])
def test_several_dispatches_are_one_sum(gpu: Gpu, monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    """The loop limit splits lights into batches, which go to and fro between two images."""
    scene = Scene([props.wall(-6), *props.slits(1, 2.5, 0.4, 3)], LIGHTS[:count], AHEAD, Medium((0.1, 0.2, 0.3), 0.05))
    whole = shoot(gpu, scene, volumetric=March(steps=32, jitter=0))
    monkeypatch.setattr(march, "_LOOP_LIMIT", 32)
    split = shoot(gpu, scene, volumetric=March(steps=32, jitter=0))
    np.testing.assert_allclose(split.inscattered, whole.inscattered, rtol=1e-5)
    assert np.array_equal(split.transmittance, whole.transmittance)
    extra = split.memory["volumetric.march"] - whole.memory["volumetric.march"]
    assert extra == (16 * TINY[0] * TINY[1] if count > 1 else 0)


@pytest.mark.parametrize("steps", [1, 2, 7, 500])
def test_unshadowed_air_is_exact_with_any_number_of_steps(gpu: Gpu, steps: int) -> None:
    """Extinction is integrated inside each step, for each colour, whatever their ratio; jitter changes nothing."""
    bounds = ((-9, -9, -6), (9, 9, 1))
    medium = Medium((0.9, 0.1, 0.001), (0.3, 0.0, 0.0), HenyeyGreenstein(0.6), bounds)
    scene = Scene([], [DirectionalLight((0.1, -0.2, 1.0))], AHEAD, medium)
    expected = props.lit_slab(scene, TINY, 0, 6 * props.rays(AHEAD, TINY).stretch)
    for jitter in (0.0, 1.0):
        got = shoot(gpu, scene, volumetric=March(steps=steps, jitter=jitter)).inscattered
        np.testing.assert_allclose(got, expected, rtol=2e-4)


def test_error_falls_with_the_steps(gpu: Gpu) -> None:
    scene = Scene(
        [props.wall(-6), *props.slits(1, 2.5, 0.4, 5)], [DirectionalLight((0.6, -0.3, -0.7))], AHEAD, Medium(0.2)
    )
    truth = shoot(gpu, scene, volumetric=March(steps=8000, jitter=0)).inscattered
    errors = [
        props.difference(shoot(gpu, scene, volumetric=March(steps=n, jitter=0)).inscattered, truth)
        for n in (16, 64, 256)
    ]
    assert errors[1] < 0.5 * errors[0]
    assert errors[2] < 0.5 * errors[1]
    assert errors[2] < 0.02


def test_frames_of_noise_average_to_the_truth_faster_than_one_is_refined(gpu: Gpu) -> None:
    """64 frames of 8 jittered steps are no worse than a single frame of 128."""
    scene = Scene(
        [props.wall(-6), *props.slits(1, 2.5, 0.4, 5)], [DirectionalLight((0.6, -0.3, -0.7))], AHEAD, Medium(0.2)
    )
    truth = shoot(gpu, scene, volumetric=March(steps=8000, jitter=0)).inscattered
    technique = March(steps=8, jitter=1.0)
    total = np.zeros_like(truth)
    with Renderer(
        scene, TINY, gpu=gpu, volumetric=technique, shadow=ShadowMap(size=512), antialiasing="none", tonemap="none"
    ) as renderer:
        for _ in range(64):
            renderer.draw()
            total += renderer.inscattered()
    assert props.difference(total / 64, truth) < 0.03
