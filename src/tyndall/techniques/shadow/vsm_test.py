"""Variance shadow maps: the mean of one caster's edge, and a bound where there are two."""

from __future__ import annotations

import math

import numpy as np
import props
import pytest

from tyndall.gpu.device import Gpu
from tyndall.scene.model import DirectionalLight, Scene
from tyndall.techniques.shadow.esm import Esm
from tyndall.techniques.shadow.evsm import Evsm
from tyndall.techniques.shadow.moment_maps import MomentMaps
from tyndall.techniques.shadow.vsm import Vsm

SIZE = (96, 72)
SUN = DirectionalLight((0, 0, -1), 3.0)


def texels_across(scene: Scene, technique: MomentMaps) -> np.ndarray:
    """x of each pixel's place on the wall, in texels of the map."""
    seen = props.rays(scene.camera, SIZE)
    return seen.at(3 * seen.stretch)[..., 0] / (6 / (technique.size - 2 * technique.margin))


def blurred_edge(x: np.ndarray, radius: float) -> np.ndarray:
    """A step at 0 blurred by a Gaussian of standard deviation radius/2 that is cut at the radius."""
    whole = math.erf(math.sqrt(2))
    part = np.array([math.erf(v) for v in (x / (radius / 2) / math.sqrt(2)).ravel()]).reshape(x.shape)
    return np.clip(0.5 + 0.5 * part / whole, 0, 1)


@pytest.mark.parametrize("radius", [6.0, 16.0])
@pytest.mark.parametrize(
    "technique",
    [
        Vsm(size=256, bleeding=0, min_deviation=0),
        Evsm(size=256, bleeding=0, min_deviation=0),
        Esm(size=256, bias=0, slope_bias=0),
    ],
    ids=lambda t: f"{t.name}",
)
def test_behind_one_caster_all_give_the_lit_part_of_the_blur(gpu: Gpu, technique: MomentMaps, radius: float) -> None:
    """Of two depths, Chebyshev's bound is an equation, and so is the exponentials' mean of one that is far nearer."""
    scene = props.sheet_edge(SUN, 3.5)
    made = type(technique)(**{**vars(technique), "radius": radius})
    seen = props.shade(gpu, scene, made, SIZE)
    expected = blurred_edge(texels_across(scene, made), radius)
    assert ((expected > 0.05) & (expected < 0.95)).sum() > 50
    np.testing.assert_allclose(seen, expected, atol=0.05)


def overlapping() -> Scene:
    """Two sheets above a wall: one near it over x < 0.5, one far from it over x < −0.2. Beneath both all is dark."""
    low = props.sheet_edge(SUN, 3.2, edge=0.5)
    high = props.quad((-3, -3, 4), (-0.2, -3, 4), (-0.2, 3, 4), (-3, 3, 4))
    return Scene([*low.instances, high], [SUN], low.camera)


def test_the_bound_is_never_below_what_is_lit(gpu: Gpu) -> None:
    scene = overlapping()
    technique = Vsm(size=256, radius=12, bleeding=0)
    seen = props.shade(gpu, scene, technique, SIZE)
    shift = 0.5 / (6 / (technique.size - 2 * technique.margin))
    lit = blurred_edge(texels_across(scene, technique) - shift, 12)
    assert (seen - lit).min() > -0.03
    dark = lit == 0
    assert seen[dark].max() > 0.1, "light bleeds where casters overlap"


def test_bleeding_is_cut_off_by_its_parameter_and_by_a_warp(gpu: Gpu) -> None:
    scene = overlapping()
    techniques = (
        Vsm(size=256, radius=12, bleeding=0),
        Vsm(size=256, radius=12, bleeding=0.5),
        Evsm(size=256, radius=12, bleeding=0),
    )
    bled = []
    for technique in techniques:
        seen = props.shade(gpu, scene, technique, SIZE)
        shift = 0.5 / (6 / (technique.size - 2 * technique.margin))
        dark = texels_across(scene, technique) < shift - 13
        assert dark.sum() > 500
        bled.append(seen[dark].sum())
    assert bled[1] < 0.5 * bled[0]
    assert bled[2] < 0.5 * bled[0]
