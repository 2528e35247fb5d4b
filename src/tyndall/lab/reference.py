"""A reference that has converged, and says so.

A technique with a number of steps is rendered with ``n``, ``2n``, ``4n`` … steps until doubling changes its in-
scattered light ``L_v`` by less than a tolerance, measured as :func:`~tyndall.lab.metrics.rel_rmse` of one against
the next. For the ray march, whose error per ray is of first order in the step wherever the ray crosses a shadow's
edge, each doubling halves the change; the error that is left is then about as large as the last change. A time
budget may end the search early: the result says by how much the last doubling changed the light, and whether that
is within the tolerance.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tyndall.lab import metrics


@dataclass(frozen=True)
class Converged[T]:
    """What :func:`converge` found.

    Attributes:
        value: what was rendered last, with the most steps.
        steps: how many those were.
        change: relative RMSE of ``L_v`` between the last two; 0 where there is no light at all.
        within: whether ``change`` is below the tolerance.
        seconds: how long the last one took to render.
    """

    value: T
    steps: int
    change: float
    within: bool
    seconds: float


def converge[T](
    render: Callable[[int], T],
    light: Callable[[T], NDArray[np.float32]],
    *,
    start: int = 128,
    limit: int = 16384,
    tolerance: float = 1e-3,
    budget_s: float | None = None,
    progress: Callable[[float], object] | None = None,
) -> Converged[T]:
    """Render with twice the steps until the light no longer changes.

    Args:
        render: makes a result with a number of steps.
        light: the result's ``L_v``, (H, W, 3).
        start, limit: first and largest number of steps.
        tolerance: relative change of ``L_v`` on doubling that counts as none.
        budget_s: seconds after which no finer rendering begins; one doubling is made in any case.
        progress: hears a fraction of 1.
    """
    begin = time.monotonic()
    steps, value = start, render(start)
    while True:
        before = time.monotonic()
        finer = render(2 * steps)
        seconds = time.monotonic() - before
        change = metrics.rel_rmse(light(value), light(finer)) or 0.0
        steps, value = 2 * steps, finer
        spent = time.monotonic() - begin
        if progress:
            progress(min(1.0, max(tolerance / change if change else 1.0, spent / budget_s if budget_s else 0.0)))
        out_of_time = budget_s is not None and spent + 2 * seconds > budget_s
        if change < tolerance or 2 * steps > limit or out_of_time:
            return Converged(value, steps, change, change < tolerance, seconds)
