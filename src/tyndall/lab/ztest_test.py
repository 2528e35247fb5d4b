import math

import numpy as np
import pytest

from tyndall.lab.ztest import z_test


def noise(seed: int, shape: tuple[int, ...] = (24, 24, 3)) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=shape)


def test_equal_pictures_differ_about_as_often_as_the_significance_says() -> None:
    truth = np.linspace(0.5, 2, 24 * 24 * 3).reshape(24, 24, 3)
    error = 0.1 * truth
    tests = [z_test(truth + error * noise(seed), truth, error, significance=0.1, tolerance=0) for seed in range(400)]
    # 400 tests at 10 % each for the largest z; about 3 standard deviations of the binomial.
    assert 22 <= sum(not test for test in tests) <= 58
    assert np.mean([test.spread for test in tests]) == pytest.approx(1, abs=5e-3)


@pytest.mark.parametrize(("freedom", "other"), [(15, None), (15, 31), (7, 7)])
def test_estimated_errors_raise_no_more_alarms(freedom: int, other: int | None) -> None:
    """Means of batches and the errors that these batches' own scatter gives, of one picture or of both."""

    def estimated(seed: int, degrees: int, sigma: float) -> tuple[np.ndarray, np.ndarray]:
        batches = sigma * np.random.default_rng(seed).normal(size=(degrees + 1, 12, 12, 3))
        return 1 + batches.mean(axis=0), batches.std(axis=0, ddof=1) / math.sqrt(degrees + 1)

    def test(seed: int, told: bool) -> bool:
        a, a_error = estimated(seed, freedom, 0.1)
        b, b_error = estimated(seed + 1000, other, 0.2) if other else (np.ones_like(a), np.zeros_like(a))
        degrees = {"a_freedom": freedom, "b_freedom": other} if told else {}
        return bool(z_test(a, b, a_error, b_error, significance=0.1, tolerance=0, **degrees))

    alarms = sum(not test(seed, True) for seed in range(200))
    # Binomial of 200 at 10 %, 3.5 standard deviations; Welch's degrees of freedom are an approximation.
    assert 5 <= alarms <= 35
    if other is None:
        assert sum(not test(seed, False) for seed in range(40)) >= 16, "as if the errors were known"


def test_students_t_is_that_of_tables() -> None:
    """Two-sided 1 % and 0.1 % points."""
    for freedom, percent, permille in (
        (1, 63.657, 636.619),
        (5, 4.032, 6.869),
        (15, 2.947, 4.073),
        (120, 2.617, 3.373),
    ):
        for t, z in ((percent, 2.5758), (permille, 3.2905)):
            found = z_test(np.full(1, 1 + t), np.ones(1), 1.0, a_freedom=freedom, tolerance=0)
            assert found.worst == pytest.approx(z, abs=2e-3)
    # Cauchy's tail is arctan's, also in the middle and far out: 1/(π·t).
    for t in (0.1, 1.0, 1e6):
        found = z_test(np.full(1, t), np.zeros(1), 1.0, a_freedom=1, tolerance=0)
        assert 0.5 * math.erfc(found.worst / math.sqrt(2)) == pytest.approx(math.atan(1 / t) / math.pi, rel=1e-3)
    assert z_test(np.ones(1), np.zeros(1), 0.2, a_freedom=9e3, tolerance=0).worst == pytest.approx(5, rel=1e-3)
    assert z_test(np.ones(1), np.zeros(1), 1e-3, a_freedom=1e300, tolerance=0).worst == pytest.approx(1000)


def test_the_critical_value_is_sidaks() -> None:
    # One value and the sum: each at 1 − √0.99 = 0.501 %, a two-sided 2.806 standard deviations.
    assert z_test(np.ones(1), np.ones(1), 0.1).critical == pytest.approx(2.806, abs=1e-3)
    # 1,728 values: 5.81e-6 each.
    assert z_test(np.ones((24, 24, 3)), np.ones((24, 24, 3)), 0.1).critical == pytest.approx(4.53, abs=0.01)


def test_one_pixel_that_is_off_is_found_and_named() -> None:
    picture = 1 + 0.01 * noise(3)
    picture[5, 7, 1] += 0.08
    found = z_test(picture, np.ones_like(picture), 0.01)
    assert not found
    assert found.where == (5, 7, 1)
    assert "different" in str(found)


def test_a_bias_too_small_for_any_pixel_is_found_in_the_sum() -> None:
    picture = 1 + 0.05 * noise(4)
    assert z_test(picture, np.ones_like(picture), 0.05)
    found = z_test(picture * 1.02, np.ones_like(picture), 0.05)
    assert not found
    assert found.worst < found.critical < found.bias


def test_channels_that_share_their_samples_are_one_in_the_sum() -> None:
    grey = 1 + 0.05 * np.repeat(noise(7, (24, 24, 1)), 3, axis=2)
    as_values, as_picture = (z_test(x, np.ones_like(x), 0.05, tolerance=0) for x in (grey.ravel(), grey))
    assert as_values.bias == pytest.approx(math.sqrt(3) * as_picture.bias)
    assert as_picture.bias == pytest.approx(24 * (grey.mean() - 1) / 0.05)


def test_both_errors_count() -> None:
    picture = 1 + 0.05 * noise(5)
    other = 1 + 0.05 * noise(6)
    both = z_test(picture, other, 0.05, 0.05)
    assert both
    assert both.spread == pytest.approx(1, abs=0.05)
    assert not z_test(picture, other, 0.03)


def test_exact_values_must_be_equal_but_for_rounding() -> None:
    exact = np.array([0.0, 1.0, 2.0])
    assert z_test(exact, exact, 0.0)
    assert z_test(exact * (1 + 5e-5), exact, 0.0)
    wrong = z_test(exact + [0, 0, 1e-3], exact, 0.0)
    assert not wrong
    assert wrong.where == (2,)
    assert wrong.worst == np.inf


def test_what_cannot_be_compared_is_said() -> None:
    with pytest.raises(ValueError, match="shapes"):
        z_test(np.ones(3), np.ones(4), 0.1)
    with pytest.raises(ValueError, match="not finite"):
        z_test(np.array([np.nan]), np.ones(1), 0.1)
    with pytest.raises(ValueError, match="degrees of freedom"):
        z_test(np.ones(1), np.ones(1), 0.1, a_freedom=0)
