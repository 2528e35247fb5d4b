"""Exponential shadow maps: the darkness behind a caster, and exponents beyond what a float holds."""

from __future__ import annotations

import math

import numpy as np
import props
import pytest

from tyndall.gpu.device import Gpu
from tyndall.scene.model import DirectionalLight, PointLight
from tyndall.techniques.shadow.esm import Esm

SIZE = (32, 24)


@pytest.mark.parametrize("exponent", [0.02, 0.05, 0.1])
def test_light_falls_exponentially_behind_a_caster(gpu: Gpu, exponent: float) -> None:
    """``V = e^(−c·h)`` in the middle of a sheet's shadow at height h above the wall."""
    light = DirectionalLight((0, 0, -1), 3.0)
    technique = Esm(size=256, exponent=exponent, bias=0, slope_bias=0)
    texel = 6 / (256 - 2 * technique.margin)
    for height in (3.1, 3.4):
        scene = props.sheet_edge(light, height, edge=3)
        seen = props.shade(gpu, scene, technique, SIZE)
        expected = math.exp(-exponent * height / texel)
        np.testing.assert_allclose(seen, expected, rtol=0.02, atol=1e-3)


@pytest.mark.parametrize("light", [DirectionalLight((0.2, 0.1, -1), 3.0), PointLight((0.5, 0.2, 4), 30.0)])
def test_no_exponent_is_too_large(gpu: Gpu, light: DirectionalLight | PointLight) -> None:
    """16 a texel are e^(16·1024) across the map: it is the logarithm that is kept."""
    scene = props.sheet_edge(light, 3.5)
    for radius in (0.0, 3.0, 64.0):
        seen = props.shade(gpu, scene, Esm(size=1024 if radius < 64 else 128, radius=radius, exponent=16), SIZE)
        assert np.isfinite(seen).all()
        assert radius == 64 or seen.min() < 0.01  # so wide a blur of a slope is brighter than any shadow
        assert seen.max() == 1


def test_a_larger_exponent_is_darker(gpu: Gpu) -> None:
    scene = props.sheet_edge(DirectionalLight((0, 0, -1), 3.0), 3.1, edge=3)
    dark = [props.shade(gpu, scene, Esm(size=256, exponent=c), SIZE).mean() for c in (0.01, 0.02, 0.04, 0.08)]
    assert (np.diff(dark) < 0).all()
