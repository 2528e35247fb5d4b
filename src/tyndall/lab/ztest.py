"""Are two noisy pictures the same? A z-test for each value, corrected for their number.

Each value of a Monte Carlo picture is a mean of many samples, so it is normal about the truth with its standard error
(central limit theorem). Of two unbiased pictures ``z = (a − b) / sqrt(error_a² + error_b²)`` is standard normal. Among
thousands of values some z are large by chance; Šidák's correction (1967) says how large the largest of ``n``
independent ones may be at a level of significance ``α``: each is held against ``1 − (1 − α)^(1/n)``, so that two equal
pictures differ in a fraction ``α`` of all tests. The sum of all differences counts as one more value: it finds a small
bias of all pixels, which no pixel would show. Mitsuba tests itself like this (after Subr and Arvo 2007).

Values that are exact in both pictures must be equal. What rounding leaves is allowed for by ``tolerance``.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class ZTest:
    """The outcome of :func:`z_test`.

    Attributes:
        worst: the largest ``|z|`` of a value.
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
    significance: float = 0.01,
    tolerance: float = 1e-4,
) -> ZTest:
    """Hold two pictures, or any arrays of one shape, against each other.

    Args:
        a, b: means. The channels of a picture's pixel, (H, W, channels), may come from the same samples: in the sum of
            all differences, their errors add up as if they were one.
        a_error, b_error: their standard errors; 0 where a value is exact.
        significance: how often two equal pictures may be called different, 0 … 1.
        tolerance: a difference to be ignored, relative to the value; far below the errors, or the test is blunt.

    Raises:
        ValueError: shapes that do not fit, or values that are not finite.
    """
    first, second, first_error, second_error = (np.asarray(x, np.float64) for x in (a, b, a_error, b_error))
    if first.shape != second.shape or not first.size:
        raise ValueError(f"z-test: shapes {first.shape} and {second.shape}")
    difference = first - second
    error = np.broadcast_to(np.hypot(first_error, second_error), difference.shape)
    if not (np.isfinite(difference).all() and np.isfinite(error).all()):
        raise ValueError("z-test: a value or an error is not finite")
    allowance = tolerance * np.maximum(np.abs(first), np.abs(second))
    z = _divided(np.sign(difference) * np.maximum(0.0, np.abs(difference) - allowance), error)
    total = difference.sum()
    excess = np.sign(total) * max(0.0, abs(float(total)) - float(allowance.sum()))
    independent = error.sum(axis=-1) if error.ndim == 3 else error
    bias = _divided(np.array(excess), np.array(np.sqrt(np.sum(independent**2))))
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
