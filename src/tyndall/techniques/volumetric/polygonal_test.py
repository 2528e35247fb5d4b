"""The walk through the shadow map, where it is longest."""

from __future__ import annotations

import numpy as np
import props
from props import shoot

from tyndall.gpu.device import Gpu
from tyndall.scene.model import Camera, DirectionalLight, Instance, Medium, Scene
from tyndall.techniques.shadow.shadow_map import ShadowMap
from tyndall.techniques.volumetric.march import March
from tyndall.techniques.volumetric.polygonal import Polygonal


def test_a_ray_under_a_thousand_bars(gpu: Gpu) -> None:
    """A map of 4096² whose texels alternate between bar and gap: no block can be stepped over, and none is left out."""
    bar = props.box((-10, 3, -0.005), (10, 3.02, 0.005)).mesh
    bars = []
    for i in range(900):
        matrix = np.eye(4)
        matrix[2, 3] = -0.02 * i - 0.5
        bars.append(Instance(bar, matrix))
    camera = Camera((0, 1, 0), (0, 1, -1), fov=0.15, near=0.05)
    scene = Scene([props.floor(-1, 10), *bars], [DirectionalLight((0, -1, 0))], camera, Medium(0.05))
    maps = ShadowMap(size=4096)
    walked = shoot(gpu, scene, (4, 3), volumetric=Polygonal(), shadow=maps).inscattered
    marched = shoot(gpu, scene, (4, 3), volumetric=March(steps=8000, jitter=0), shadow=maps).inscattered
    np.testing.assert_allclose(walked, marched, rtol=0.005)
