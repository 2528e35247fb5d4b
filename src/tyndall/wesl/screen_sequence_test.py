"""Sample points of the picture are even over a pixel's time and over its neighbours at once."""

from __future__ import annotations

import numpy as np
import props
import pytest

from tyndall.gpu.device import Gpu

POINTS = """
    import package::wesl::screen_sequence::screen_sequence_2d;
    fn evaluate(x: vec4f) -> vec4f {
        return vec4f(screen_sequence_2d(vec2u(x.xy), u32(x.z), 3u, u32(x.w)), 0.0, 0.0);
    }
"""


def points(gpu: Gpu, name: str, pixels: np.ndarray, index: np.ndarray, seed: int) -> np.ndarray:
    rows = np.column_stack([pixels, index, np.full(len(pixels), seed)])
    got = props.evaluate(gpu, f"test_screen_sequence_{name}_{seed}", POINTS, rows)[:, :2]
    assert (got >= 0).all()
    assert (got < 1).all()
    return got


def fills_every_stratum(sample: np.ndarray) -> bool:
    """Whether 2^m points lie one in each of the boxes of area 2^-m, whatever their shape: a (0, m, 2)-net."""
    m = len(sample).bit_length() - 1
    for k in range(m + 1):
        cells = np.floor(sample * [2**k, 2 ** (m - k)]) @ [2 ** (m - k), 1]
        if len(np.unique(cells)) != len(sample):
            return False
    return True


@pytest.mark.parametrize("seed", [0, 5])
def test_a_pixels_points_are_a_net(gpu: Gpu, seed: int) -> None:
    for pixel in ((0, 0), (637, 211)):
        sample = points(gpu, f"time_{pixel[0]}", np.tile(pixel, (64, 1)), np.arange(64), seed)
        assert fills_every_stratum(sample)
        assert fills_every_stratum(sample[:16])
        assert fills_every_stratum(sample[16:32])


@pytest.mark.parametrize("seed", [0, 5])
def test_the_points_of_a_block_of_pixels_are_a_net_in_every_frame(gpu: Gpu, seed: int) -> None:
    y, x = (a.ravel() for a in np.mgrid[0:8, 0:8])
    for frame in (0, 1, 77):
        pixels = np.stack([x + 24, y + 128], axis=1)
        sample = points(gpu, f"space_{frame}", pixels, np.full(64, frame), seed)
        assert fills_every_stratum(sample)
        corner = (x < 4) & (y >= 4)
        assert fills_every_stratum(sample[corner])


def test_frames_and_seeds_differ(gpu: Gpu) -> None:
    y, x = (a.ravel() for a in np.mgrid[0:8, 0:8])
    pixels = np.stack([x, y], axis=1)
    first = points(gpu, "a", pixels, np.zeros(64), 0)
    later = points(gpu, "b", pixels, np.ones(64), 0)
    other = points(gpu, "c", pixels, np.zeros(64), 1)
    assert not (first == later).any()
    assert (first == other).mean() < 0.1


def test_the_noise_of_a_picture_is_of_high_frequency(gpu: Gpu) -> None:
    """Part of a disk over blocks of 8 × 8 pixels: far less noisy than of independent points."""
    y, x = (a.ravel() for a in np.mgrid[0:64, 0:64])
    pixels = np.stack([x, y], axis=1)
    sample = points(gpu, "blue", pixels, np.full(len(pixels), 3), 0)
    inside = (((sample - 0.5) ** 2).sum(-1) < 0.16).reshape(64, 64).astype(float)
    blocks = inside.reshape(8, 8, 8, 8).mean(axis=(1, 3))
    independent = np.sqrt(inside.mean() * (1 - inside.mean()) / 64)
    assert inside.mean() == pytest.approx(np.pi * 0.16, abs=0.01)
    assert blocks.std() < 0.6 * independent
