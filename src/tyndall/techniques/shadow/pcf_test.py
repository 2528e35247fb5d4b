"""Percentage-closer filtering: the width and the shape of its edges."""

from __future__ import annotations

import numpy as np
import props
import pytest

from tyndall.gpu.device import Gpu
from tyndall.scene.model import DirectionalLight, PointLight
from tyndall.techniques.shadow.pcf import Pcf

SIZE = (96, 72)


@pytest.mark.parametrize("radius", [4.0, 12.0])
def test_a_straight_edge_hides_a_segment_of_the_disk(gpu: Gpu, radius: float) -> None:
    """``V = (arccos(−s) + s√(1 − s²))/π`` at s radii from the edge."""
    scene = props.sheet_edge(DirectionalLight((0, 0, -1), 3.0), 3.5)
    technique = Pcf(size=256, radius=radius, samples=64)
    x = props.rays(scene.camera, SIZE).at(props.rays(scene.camera, SIZE).stretch * 3)[..., 0]
    texel = 6 / (256 - 2 * technique.margin)
    seen = props.shade(gpu, scene, technique, SIZE, frames=4)
    expected = props.disk_part(x / (radius * texel))
    assert ((expected > 0.1) & (expected < 0.9)).sum() > 50
    # The lookup's own four texels blur the disk's rim.
    np.testing.assert_allclose(seen, expected, atol=0.06 if radius < 5 else 0.03)


def test_more_samples_make_less_noise(gpu: Gpu) -> None:
    scene = props.sheet_edge(DirectionalLight((0, 0, -1), 3.0), 3.5)
    x = props.rays(scene.camera, SIZE).at(props.rays(scene.camera, SIZE).stretch * 3)[..., 0]
    texel = 6 / (256 - 4)
    noise = []
    for samples in (4, 16, 64):
        seen = props.shade(gpu, scene, Pcf(size=256, radius=16, samples=samples), SIZE)
        noise.append(np.std(seen - props.disk_part(x / (16 * texel))))
    assert noise[1] < 0.6 * noise[0]
    assert noise[2] < 0.6 * noise[1]


def test_frames_turn_the_disk_so_that_their_mean_is_smooth(gpu: Gpu) -> None:
    scene = props.sheet_edge(DirectionalLight((0, 0, -1), 3.0), 3.5)
    technique = Pcf(size=256, radius=16, samples=4)
    one, many = (props.shade(gpu, scene, technique, SIZE, frames=frames) for frames in (1, 16))
    across = [np.abs(np.diff(seen, axis=0)).mean() for seen in (one, many)]  # the edge runs down the picture
    assert across[0] > 0
    assert across[1] < 0.4 * across[0]


def test_a_disk_over_the_edge_of_a_cubes_faces_sees_both(gpu: Gpu) -> None:
    """A sheet's edge at 45° from a point light lies between two faces; on both sides the edge is as smooth."""
    light = PointLight((-3, 0, 0), 20.0)  # the place x = 0 on the wall is at 45°
    scene = props.sheet_edge(light, 1.5, edge=-1.5)
    technique = Pcf(size=256, radius=8, samples=64)
    seen = props.shade(gpu, scene, technique, SIZE, frames=4)
    row = seen[SIZE[1] // 2 - 2 : SIZE[1] // 2 + 2].mean(axis=0)
    assert row[:36].max() < 0.03
    assert row[60:].min() > 0.97
    assert (np.diff(row) > -0.02).all()
    assert np.diff(row).max() < 0.35
