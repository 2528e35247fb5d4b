"""Closed forms of the metrics."""

from __future__ import annotations

import json
import math
import sys

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
    assert metrics.picture_psnr(grey + np.uint8(1), grey) == pytest.approx(20 * math.log10(255))
    assert metrics.picture_psnr(np.zeros_like(grey), np.full_like(grey, 255)) == pytest.approx(0)
    assert metrics.picture_psnr(grey, grey) == math.inf


def test_psnr_of_light_does_not_change_with_its_unit(light: np.ndarray) -> None:
    white = np.ones((8, 8, 3))
    assert metrics.psnr(white - 0.01, white) == pytest.approx(40)
    assert metrics.psnr(light, light) == math.inf
    noisy = light + np.float32(0.1)
    assert metrics.psnr(1e4 * noisy, 1e4 * light) == pytest.approx(metrics.psnr(noisy, light), abs=1e-4)
    assert metrics.psnr(light, np.zeros_like(light)) is None


def test_one_glint_is_not_the_white() -> None:
    plain = np.ones((64, 64, 3))
    glint = plain.copy()
    glint[5, 5] = 1e6
    assert metrics.peak(glint) == 1
    lamp = np.zeros((64, 64, 3))
    lamp[5, 5] = 7
    assert metrics.peak(lamp) == 7


def test_relmse_is_each_pixel_relative_to_itself() -> None:
    reference = np.ones((4, 4, 3))
    assert metrics.relmse(1.1 * reference, reference) == pytest.approx(0.01 / 1.01)
    # A tenth off everywhere is the same in the dark and in the light, but for ε.
    wide = np.full((4, 4, 3), 100.0)
    wide[:2] = 1.0
    epsilon = 0.01 * wide.mean() ** 2
    expected = (0.01 / (1 + epsilon) + 100 / (1e4 + epsilon)) / 2
    assert metrics.relmse(1.1 * wide, wide) == pytest.approx(expected)
    assert metrics.relmse(1.1e5 * wide, 1e5 * wide) == pytest.approx(expected)
    assert metrics.relmse(wide, np.zeros_like(wide)) is None


# --- a reference with noise ---------------------------------------------------------------------------------------


def noisy(light: np.ndarray, error: np.ndarray, seed: int) -> np.ndarray:
    return light + error * np.random.default_rng(seed).standard_normal(light.shape)


@pytest.mark.parametrize("off", [0.0, 0.05, 0.3])
def test_the_corrected_error_is_unbiased_for_the_reference_s_noise(light: np.ndarray, off: float) -> None:
    """The mean square error less the expected square of the noise, over many noisy references: a z-test."""
    wide = light.astype(np.float64)
    image, error = wide + off, 0.1 + 0.1 * wide
    squares = []
    for seed in range(200):
        reference = noisy(wide, error, seed)
        squares.append(metrics.rmse(image, reference) ** 2 - np.mean(error**2))
    standard = np.std(squares, ddof=1) / math.sqrt(len(squares))
    assert abs(np.mean(squares) - off**2) < 4 * standard
    assert standard < 2e-3
    corrected = metrics.rel_rmse(image, reference, error)
    assert corrected == pytest.approx(math.sqrt(max(0, squares[-1])) / reference.mean())


def test_an_error_that_the_noise_hides_is_said_to_be_so(light: np.ndarray) -> None:
    error = np.full(light.shape, 0.2)
    target = metrics.Target(noisy(light, error, 3), error)
    same, far = metrics.score(light, target), metrics.score(1.5 * light, target)
    assert same.within_noise
    assert same.rel_rmse_corrected < same.rel_rmse_limit < same.rel_rmse
    assert far.rel_rmse_corrected < far.rel_rmse_limit < 1.2 * far.rel_rmse
    assert same.rel_rmse == pytest.approx(0.2 / light.mean(), rel=0.05)
    assert same.rel_rmse_corrected < 0.3 * same.rel_rmse
    assert not far.within_noise
    assert far.rel_rmse_corrected == pytest.approx(metrics.rel_rmse(1.5 * light, light), rel=0.02)
    clear = metrics.score(light, metrics.Target(light))
    assert not clear.within_noise, "without noise nothing is within it"
    assert clear.rel_rmse_limit is None


def test_a_small_error_shows_through_large_noise_in_a_large_picture() -> None:
    """An error of 5 % under noise of 20 %: hidden among 100 pixels, plain among 100,000."""
    found = []
    for side in (10, 320):
        light = np.ones((side, side, 3))
        error = np.full(light.shape, 0.2)
        reference = light + 0.2 * np.random.default_rng(side).standard_normal((side, side, 1))
        found.append(metrics.hidden(1.05 * light, reference, error))
    assert [hidden for _, hidden in found] == [True, False]
    assert found[0][0] > found[1][0] > 0.05


def test_right_pictures_are_seldom_called_wrong() -> None:
    light = np.ones((24, 32, 3))
    error = np.full(light.shape, 0.3)
    wrong = 0
    for seed in range(300):
        reference = light + 0.3 * np.random.default_rng(seed).standard_normal((24, 32, 1))
        limit, hidden = metrics.hidden(light, reference, error)
        wrong += not hidden
        assert limit < 0.3
    assert wrong <= 4, "three standard errors"


def test_the_reference_s_own_error_is_relative_to_its_mean() -> None:
    assert metrics.relative_noise(np.full((2, 2, 3), 4.0), np.full((2, 2, 3), 0.2)) == pytest.approx(0.05)
    assert metrics.relative_noise(np.ones((2, 2, 3)), None) == 0
    assert metrics.relative_noise(np.zeros((2, 2, 3)), None) is None


# --- what people see ----------------------------------------------------------------------------------------------


def test_ssim_of_equal_pictures_is_one_and_of_constants_is_closed(light: np.ndarray) -> None:
    assert metrics.ssim(light, light) == pytest.approx(1)
    flat = np.full((24, 32, 3), 1.0)
    # No variance: SSIM is the luminance term, (2·x·r + c) / (x² + r² + c) with c = (0.01·peak)².
    assert metrics.ssim(0.8 * flat, flat) == pytest.approx((2 * 0.8 + 1e-4) / (1 + 0.64 + 1e-4))
    assert metrics.ssim(light[::-1], light) < 0.5
    assert metrics.ssim(light[:10], light[:10]) is None, "smaller than the window"
    assert metrics.ssim(light, np.zeros_like(light)) is None


def test_flip_is_its_library_s_where_that_has_an_answer(light: np.ndarray) -> None:
    from flip_evaluator import evaluate

    other = (light * np.random.default_rng(2).uniform(0.7, 1.3, light.shape)).astype(np.float32)
    _, mean, used = evaluate(light, other, "HDR", applyMagma=False)
    assert metrics.flip(other, light) == pytest.approx(mean, rel=1e-4)
    assert mean > 0.01
    for name, value in metrics.flip_exposures(light).items():
        assert value == pytest.approx(used[name], abs=1e-2), "another median of an even count"


def test_flip_of_dark_pictures_neither_dies_nor_takes_forever(light: np.ndarray) -> None:
    dark = np.zeros_like(light)
    dark[:3] = light[:3]
    assert metrics.flip(dark, dark) == 0
    assert 0 < metrics.flip(np.zeros_like(light), dark) <= 1
    assert metrics.flip_exposures(dark)["numExposures"] <= 7
    assert metrics.flip(light, np.zeros_like(light)) is None
    assert metrics.flip(-light, light) == pytest.approx(metrics.flip(0 * light, light)), "there is no negative light"


@pytest.mark.parametrize(
    ("module", "metric", "package"),
    [("flip_evaluator", "flip", "flip-evaluator"), ("skimage.metrics", "ssim", "scikit-image")],
)
def test_a_missing_library_is_one_line_and_the_rest_is_there(
    light: np.ndarray, monkeypatch: pytest.MonkeyPatch, module: str, metric: str, package: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    scores = metrics.score(1.1 * light, metrics.Target(light))
    assert getattr(scores, metric) is None
    assert scores.bias == pytest.approx(0.1, rel=1e-3)
    (line,) = scores.missing
    assert package in line
    assert "pip install 'tyndall[truth]'" in line
    assert "missing" not in scores.to_json()


# --- edges of shadows ---------------------------------------------------------------------------------------------


def half_shadow(height: int, width: int = 64) -> tuple[np.ndarray, np.ndarray]:
    """A textured wall, lit on the right of the middle, and without its shadow."""
    texture = np.random.default_rng(4).uniform(0.2, 2.0, (height, width, 3))
    shadow = np.where(np.arange(width) < width // 2, 0.1, 1.0)[None, :, None]
    return texture * shadow, texture


def test_edges_are_where_the_shadow_begins_whatever_the_texture() -> None:
    lit, full = half_shadow(40)
    edges = metrics.shadow_edges(lit, full)
    assert metrics.edge_reach(40) == 1
    # The 3×3 mean widens the step to two pixels, and the reach adds one on either side.
    assert np.array_equal(np.flatnonzero(edges[20]), np.arange(30, 34))
    assert (edges == edges[0]).all()
    assert not metrics.shadow_edges(full, full).any()
    assert not metrics.shadow_edges(0.3 * full, full).any(), "a shadow without an edge"


def test_the_edge_is_the_same_part_of_a_larger_picture() -> None:
    small = half_shadow(360, 96)
    large = [np.repeat(np.repeat(p, 3, axis=0), 3, axis=1) for p in small]
    assert (metrics.edge_reach(360), metrics.edge_reach(1080)) == (2, 6)
    assert metrics.shadow_edges(*small).mean() == 6 / 96
    assert metrics.shadow_edges(*large).mean() == 14 / 288


def test_noise_makes_no_edges_and_hides_none() -> None:
    lit, full = half_shadow(40)
    clean = metrics.shadow_edges(lit, full)
    error = 0.1 * full
    seen = metrics.shadow_edges(noisy(lit, error, 1), full, error)
    assert (seen & ~clean).mean() < 0.01
    assert (seen & clean).sum() > 0.9 * clean.sum()


def test_where_nothing_shines_there_is_no_edge() -> None:
    lit, full = half_shadow(40)
    lit[:20] = full[:20] = 0
    assert not metrics.shadow_edges(lit, full)[:18].any()


def test_the_boundary_s_share_of_the_error_adds_up(light: np.ndarray) -> None:
    edges = np.zeros(light.shape[:2], bool)
    edges[:, 10:14] = True
    other = light.astype(np.float64)
    other[edges] += 0.5
    other[~edges] -= 0.1
    mean, share = light.mean(dtype=np.float64), edges.mean()
    found = metrics.boundary(other, metrics.Target(light, None, edges))
    assert found == pytest.approx(0.5 / mean)
    rest = 0.1 / mean
    assert share * found**2 + (1 - share) * rest**2 == pytest.approx(metrics.rel_rmse(other, light) ** 2)
    assert metrics.boundary(other, metrics.Target(light)) is None
    assert metrics.boundary(other, metrics.Target(light, None, ~edges & edges)) is None


# --- all at once --------------------------------------------------------------------------------------------------


def test_all_figures_of_a_scaled_picture(light: np.ndarray) -> None:
    scores = metrics.score(2 * light, metrics.Target(light))
    assert scores.bias == pytest.approx(1, rel=1e-5)
    assert scores.best_scale == pytest.approx(0.5)
    assert scores.scaled_rel_rmse == pytest.approx(0, abs=1e-7)
    assert scores.rel_rmse == scores.rel_rmse_corrected
    assert 0 < scores.ssim < 1
    assert 0 < scores.flip < 1
    assert scores.missing == ()
    document = scores.to_json()
    assert document["boundary"] is None
    assert document["within_noise"] is False
    assert metrics.score(light, metrics.Target(light)).to_json()["psnr"] is None, "JSON has no infinity"


def test_figures_without_light_are_none(light: np.ndarray) -> None:
    scores = metrics.score(light, metrics.Target(np.zeros_like(light)))
    figures = scores.to_json()
    assert figures.pop("rmse") > 0
    assert figures["rel_rmse_limit"] is None
    assert figures.pop("best_scale") == 0
    assert figures.pop("within_noise") is False
    assert set(figures.values()) == {None}


def test_what_cannot_be_compared_is_refused(light: np.ndarray) -> None:
    with pytest.raises(ValueError, match="shape"):
        metrics.rmse(light[1:], light)
    broken = light.copy()
    broken[0, 0, 0] = np.nan
    with pytest.raises(ValueError, match="finite"):
        metrics.rel_rmse(broken, light)
    with pytest.raises(ValueError, match="8-bit"):
        metrics.picture_psnr(light, light)


@pytest.mark.parametrize("unknown", [math.nan, math.inf])
def test_an_error_that_is_not_known_is_no_small_error(light: np.ndarray, unknown: float) -> None:
    noise = np.full_like(light, 0.01)
    noise[3, 4, 1] = unknown
    edges = np.ones(light.shape[:2], bool)
    scores = metrics.score(1.1 * light, metrics.Target(light, noise, edges))
    assert scores.rel_rmse == pytest.approx(0.1 * math.sqrt((light**2).mean()) / light.mean(), rel=1e-3)
    assert scores.rel_rmse_corrected is None
    assert scores.rel_rmse_limit is None
    assert not scores.within_noise
    assert scores.boundary is None
    assert scores.scaled_rel_rmse is None
    assert metrics.relative_noise(light, noise) is None
    json.dumps(scores.to_json(), allow_nan=False)
