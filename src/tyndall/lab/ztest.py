"""Are two noisy pictures the same? A z-test for each value, corrected for their number.

Each value of a Monte Carlo picture is a mean of many samples, so it is normal about the truth with its standard error
(central limit theorem). Of two unbiased pictures ``z = (a − b) / sqrt(error_a² + error_b²)`` is standard normal. Among
thousands of values some z are large by chance; Šidák's correction (1967) says how large the largest of ``n``
independent ones may be at a level of significance ``α``: each is held against ``1 − (1 − α)^(1/n)``, so that two equal
pictures differ in a fraction ``α`` of all tests. The sum of all differences counts as one more value: it finds a small
bias of all pixels, which no pixel would show. Mitsuba tests itself like this (after Subr and Arvo 2007).

An error that is itself estimated, from ``n`` batches, makes the quotient Student's t with ``n − 1`` degrees of freedom,
whose tails are much wider: of 16 batches, 4.07 is as rare as a z of 3.29, and 8.27 as 5. The degrees of freedom of two
such errors are Welch's and Satterthwaite's (1946), ``(a² + b²)² / (a⁴/ν_a + b⁴/ν_b)``. Each quotient is turned into the
z that is exceeded as often, so that all are held against one bound.

Values that are exact in both pictures must be equal. What rounding leaves is allowed for by ``tolerance``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

_MANY = 1e4  # degrees of freedom, from which on Student's t of 5 is z to one in a thousand


@dataclass(frozen=True)
class ZTest:
    """The outcome of :func:`z_test`.

    Attributes:
        worst: the largest ``|z|`` of a value, of Student's t the z as rare.
        where: that value's index.
        bias: ``z`` of the sum of all differences.
        critical: how large either may be.
        spread: root mean square of z over the noisy values; about 1 where the errors are right, 0 without noise.
        count: values compared.
    """

    worst: float
    where: tuple[int, ...]
    bias: float
    critical: float
    spread: float
    count: int

    @property
    def passed(self) -> bool:
        """Whether the pictures may be the same."""
        return self.worst <= self.critical and abs(self.bias) <= self.critical

    def __bool__(self) -> bool:
        return self.passed

    def __str__(self) -> str:
        verdict = "the same" if self.passed else "different"
        return (
            f"{verdict}: largest |z| {self.worst:.2f} at {self.where}, of the sum {self.bias:.2f}, "
            f"critical {self.critical:.2f}; spread {self.spread:.2f} of {self.count} values"
        )


def z_test(
    a: ArrayLike,
    b: ArrayLike,
    a_error: ArrayLike,
    b_error: ArrayLike = 0.0,
    *,
    a_freedom: float | None = None,
    b_freedom: float | None = None,
    significance: float = 0.01,
    tolerance: float = 1e-4,
) -> ZTest:
    """Hold two pictures, or any arrays of one shape, against each other.

    Args:
        a, b: means. The channels of a picture's pixel, (H, W, channels), may come from the same samples: in the sum of
            all differences, their errors add up as if they were one.
        a_error, b_error: their standard errors; 0 where a value is exact.
        a_freedom, b_freedom: degrees of freedom of the errors, one less than the batches that they are estimated from;
            None where they are known, or come from so many samples that they are as good as known.
        significance: how often two equal pictures may be called different, 0 … 1.
        tolerance: a difference to be ignored, relative to the value; far below the errors, or the test is blunt.

    Raises:
        ValueError: shapes that do not fit, values that are not finite, or fewer than one degree of freedom.
    """
    first, second, first_error, second_error = (np.asarray(x, np.float64) for x in (a, b, a_error, b_error))
    if first.shape != second.shape or not first.size:
        raise ValueError(f"z-test: shapes {first.shape} and {second.shape}")
    difference = first - second
    squares = [np.broadcast_to(np.square(x), difference.shape) for x in (first_error, second_error)]
    error = np.sqrt(squares[0] + squares[1])
    if not (np.isfinite(difference).all() and np.isfinite(error).all()):
        raise ValueError("z-test: a value or an error is not finite")
    allowance = tolerance * np.maximum(np.abs(first), np.abs(second))
    rates = [_rate(freedom) for freedom in (a_freedom, b_freedom)]
    z = _divided(np.sign(difference) * np.maximum(0.0, np.abs(difference) - allowance), error)
    z = _as_normal(z, _freedom(squares, rates))
    total = difference.sum()
    excess = np.sign(total) * max(0.0, abs(float(total)) - float(allowance.sum()))
    # Of channels that err as one, errors add up and not their squares.
    summed = [np.square(np.sqrt(x).sum(axis=-1)) if x.ndim == 3 else x for x in squares]
    independent = summed[0] + summed[1]
    bias = _divided(np.array(excess), np.array(np.sqrt(independent.sum())))
    # All pixels' errors together, each with its own degrees of freedom.
    uncertain = float(sum(rate * np.square(x).sum() for rate, x in zip(rates, summed, strict=True)))
    freedom = float(np.square(independent.sum())) / uncertain if uncertain > 0 else np.inf
    bias = _as_normal(bias, np.array(freedom))
    chance = 1 - (1 - significance) ** (1 / (difference.size + 1))
    where = np.unravel_index(int(np.abs(z).argmax()), z.shape)
    noisy = error > 0
    return ZTest(
        worst=float(np.abs(z).max()),
        where=tuple(int(i) for i in where),
        bias=float(bias),
        critical=NormalDist().inv_cdf(1 - chance / 2),
        spread=float(np.sqrt(np.mean(np.square(z[noisy])))) if noisy.any() else 0.0,
        count=difference.size,
    )


def _divided(excess: NDArray[Any], error: NDArray[Any]) -> NDArray[np.float64]:
    """excess / error; of exact values 0 where they are equal, and infinite where they are not."""
    exact = np.where(excess == 0, 0.0, np.copysign(np.inf, excess))
    divided: NDArray[np.float64] = np.where(error > 0, excess / np.where(error > 0, error, 1.0), exact)
    return divided


def _rate(freedom: float | None) -> float:
    if freedom is None:
        return 0.0
    if not freedom >= 1:
        raise ValueError(f"z-test: {freedom} degrees of freedom")
    return 1 / freedom


def _freedom(squares: list[NDArray[Any]], rates: list[float]) -> NDArray[np.float64]:
    """Of the sums of two squares of errors; infinite where they are known."""
    total = squares[0] + squares[1]
    # Shares first: the fourth power of a small error is 0.
    shares = [np.divide(x, total, out=np.zeros_like(total), where=total > 0) for x in squares]
    uncertain = rates[0] * shares[0] ** 2 + rates[1] * shares[1] ** 2
    return np.asarray(np.divide(1.0, uncertain, out=np.full_like(total, np.inf), where=uncertain > 0))


def _as_normal(t: NDArray[np.float64], freedom: NDArray[np.float64]) -> NDArray[np.float64]:
    """The z that is exceeded as often as Student's t with so many degrees of freedom."""
    z = t.copy()
    estimated = np.isfinite(t) & (freedom < _MANY) & (t != 0)
    if estimated.any():
        tail = _log_tail(np.abs(t[estimated]), freedom[estimated])
        z[estimated] = np.copysign(_normal_quantile(tail), t[estimated])
    return z


def _log_tail(t: NDArray[np.float64], freedom: NDArray[np.float64]) -> NDArray[np.float64]:
    """Logarithm of the probability that Student's t is above ``t`` ≥ 0, by ``I_x(ν/2, ½)/2`` with ``x = ν/(ν + t²)``.

    The incomplete beta function's continued fraction, or that of its complement, whichever is the shorter (Abramowitz
    and Stegun 26.5.8, by the method of Lentz 1976).
    """
    x = freedom / (freedom + t * t)
    y = t * t / (freedom + t * t)
    a, b = freedom / 2, np.full_like(freedom, 0.5)
    direct = x < (a + 1) / (a + b + 2)
    p, q = np.where(direct, a, b), np.where(direct, b, a)
    u = np.where(direct, x, y)
    log_gamma = np.vectorize(math.lgamma, otypes=[np.float64])
    log_front = a * np.log(x) + b * np.log(y) + log_gamma(a + b) - log_gamma(a) - math.lgamma(0.5)
    log_part = log_front - np.log(p) + np.log(_beta_fraction(p, q, u))
    whole = np.where(direct, log_part, np.log1p(-np.exp(np.where(direct, -1.0, log_part))))
    return np.asarray(whole - math.log(2))


def _beta_fraction(a: NDArray[np.float64], b: NDArray[np.float64], x: NDArray[np.float64]) -> NDArray[np.float64]:
    tiny = 1e-300
    c = np.ones_like(x)
    d = 1 - (a + b) * x / (a + 1)
    d = 1 / np.where(np.abs(d) < tiny, tiny, d)
    value = d.copy()
    for m in range(1, 300):
        even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        for term in (even, odd):
            d, c = 1 + term * d, 1 + term / c
            d = 1 / np.where(np.abs(d) < tiny, tiny, d)
            c = np.where(np.abs(c) < tiny, tiny, c)
            value *= c * d
        if np.all(np.abs(c * d - 1) < 1e-12):
            break
    return value


def _normal_quantile(log_tail: NDArray[np.float64]) -> NDArray[np.float64]:
    """The z ≥ 0 that a standard normal number exceeds with a probability, given as its logarithm; 38 at most."""
    z, table = _normal_tails()
    return np.interp(-log_tail, -table, z)


@cache
def _normal_tails() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """z, and the logarithm of its tail: smooth, so that a table gives z to five digits."""
    z = np.linspace(0, 38, 20_001)
    return z, np.array([math.log(0.5 * math.erfc(x / math.sqrt(2))) for x in z])
