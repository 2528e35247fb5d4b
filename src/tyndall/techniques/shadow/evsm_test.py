"""Exponential variance shadow maps: what the two warps are for, and that none leaves the range of a float."""

from __future__ import annotations

import numpy as np
import props
import pytest

from tyndall.gpu.device import Gpu
from tyndall.scene.model import DirectionalLight, Light, PointLight
from tyndall.techniques.shadow.evsm import Evsm

SIZE = (32, 24)


@pytest.mark.parametrize("light", [DirectionalLight((0.2, 0.1, -1), 3.0), PointLight((0.5, 0.2, 4), 30.0)])
@pytest.mark.parametrize("warp", [(42.0, 42.0), (42.0, 0.1), (0.1, 42.0), (0.1, 0.1)])
def test_no_warp_leaves_the_floats(gpu: Gpu, light: Light, warp: tuple[float, float]) -> None:
    scene = props.sheet_edge(light, 3.5)
    technique = Evsm(size=256, radius=3, positive=warp[0], negative=warp[1])
    seen = props.shade(gpu, scene, technique, SIZE)
    assert np.isfinite(seen).all()
    assert seen.min() < 0.05
    assert seen.max() == 1


def test_each_warp_bounds_the_other(gpu: Gpu) -> None:
    """The smaller of two bounds is taken, so that another warp can only make it darker."""
    scene = props.sheet_edge(DirectionalLight((0, 0, -1), 3.0), 3.5)
    both = props.shade(gpu, scene, Evsm(size=256, radius=8, bleeding=0, positive=20, negative=20), SIZE)
    weak = props.shade(gpu, scene, Evsm(size=256, radius=8, bleeding=0, positive=20, negative=0.1), SIZE)
    assert (both <= weak + 0.02).all()
