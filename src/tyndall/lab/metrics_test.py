"""Closed forms of the metrics."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tyndall.lab import metrics


@pytest.fixture
def light() -> np.ndarray:
    return np.random.default_rng(7).uniform(0.1, 3.0, (24, 32, 3)).astype(np.float32)


def test_equal_pictures_have_no_error(light: np.ndarray) -> None:
    assert metrics.rmse(light, light) == 0
    assert metrics.rel_rmse(light, light) == 0
    assert metrics.bias(light, light) == 0
    assert not metrics.error_map(light, light).any()


def test_a_constant_offset_is_all_bias(light: np.ndarray) -> None:
    offset = light.astype(np.float64) + 0.25
    assert metrics.rmse(offset, light) == pytest.approx(0.25)
    assert metrics.bias(offset, light) == pytest.approx(0.25 / light.mean(dtype=np.float64))
    assert metrics.rel_rmse(offset, light) == pytest.approx(metrics.bias(offset, light))


def test_a_scale_is_relative_to_the_mean(light: np.ndarray) -> None:
    double = 2 * light
    wide = light.astype(np.float64)
    assert metrics.bias(double, light) == pytest.approx(1)
    assert metrics.rel_rmse(double, light) == pytest.approx(math.sqrt((wide**2).mean()) / wide.mean())
    assert metrics.best_scale(double, light) == pytest.approx(0.5)
    assert metrics.scaled_rel_rmse(double, light) == pytest.approx(0, abs=1e-7)


def test_errors_that_cancel_have_no_bias() -> None:
    reference = np.ones((2, 2, 3), np.float32)
    checker = np.array([[1.5, 0.5], [0.5, 1.5]], np.float32)[..., None].repeat(3, axis=2)
    assert metrics.bias(checker, reference) == 0
    assert metrics.rel_rmse(checker, reference) == pytest.approx(0.5)


def test_no_light_at_all_is_a_bias_of_minus_one(light: np.ndarray) -> None:
    black = np.zeros_like(light)
    assert metrics.bias(black, light) == pytest.approx(-1)
    assert metrics.rel_rmse(black, light) >= 1
    assert metrics.best_scale(black, light) == 0


def test_relative_errors_do_not_change_with_the_unit_of_light(light: np.ndarray) -> None:
    noisy = light * np.random.default_rng(1).uniform(0.9, 1.1, light.shape).astype(np.float32)
    assert metrics.rel_rmse(noisy * 1e4, light * 1e4) == pytest.approx(metrics.rel_rmse(noisy, light), rel=1e-6)
    assert metrics.bias(noisy * 1e4, light * 1e4) == pytest.approx(metrics.bias(noisy, light), rel=1e-5)


def test_a_black_reference_has_no_relative_error(light: np.ndarray) -> None:
    black = np.zeros_like(light)
    assert metrics.rel_rmse(light, black) is None
    assert metrics.bias(light, black) is None
    assert not metrics.error_map(light, black).any()


def test_the_map_holds_the_whole_error(light: np.ndarray) -> None:
    other = light[::-1].copy()
    mapped = metrics.error_map(other, light).astype(np.float64)
    assert math.sqrt((mapped**2).mean()) == pytest.approx(metrics.rel_rmse(other, light), rel=1e-5)


def test_psnr_of_one_grey_level_and_of_opposites() -> None:
    grey = np.full((8, 8, 3), 100, np.uint8)
    assert metrics.psnr(grey + np.uint8(1), grey) == pytest.approx(20 * math.log10(255))
    assert metrics.psnr(np.zeros_like(grey), np.full_like(grey, 255)) == pytest.approx(0)
    assert metrics.psnr(grey, grey) == math.inf


def test_what_cannot_be_compared_is_refused(light: np.ndarray) -> None:
    with pytest.raises(ValueError, match="shape"):
        metrics.rmse(light[1:], light)
    broken = light.copy()
    broken[0, 0, 0] = np.nan
    with pytest.raises(ValueError, match="finite"):
        metrics.rel_rmse(broken, light)
    with pytest.raises(ValueError, match="8-bit"):
        metrics.psnr(light, light)
