"""What is the blur's own; the rest is in the family's contract and in the paper's tests."""

from __future__ import annotations

import numpy as np
import pytest
from props import AHEAD, shoot

from tyndall.gpu.device import Gpu
from tyndall.scene.model import DirectionalLight, Light, Medium, PointLight, Scene


@pytest.mark.parametrize(
    "light",
    [DirectionalLight((-0.9, -0.7, 0.5)), PointLight((-6.0, 5.0, -4.0), 9.0)],
    ids=["directional", "point"],
)
def test_a_light_outside_the_picture_leaves_no_dark_border(gpu: Gpu, light: Light) -> None:
    """Before an open sky every pixel has its full airlight, those at the edge as well."""
    scene = Scene([], [light], AHEAD, Medium(0.1))
    blurred, truth = (shoot(gpu, scene, (48, 36), volumetric=name).inscattered for name in ("screen_space", "march"))
    assert truth.min() > 0
    np.testing.assert_allclose(blurred, truth, rtol=0.02)
