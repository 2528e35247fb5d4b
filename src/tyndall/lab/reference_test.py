"""Convergence on an integral whose value is known."""

from __future__ import annotations

import numpy as np
import pytest

from tyndall.lab.reference import converge

SHADOW = np.linspace(0.1, 0.9, 97)  # where each ray of unit length leaves the light


def march(steps: int) -> np.ndarray:
    """Midpoint sums of a unit ray that is lit as far as SHADOW: an error of first order, as in a shadowed medium."""
    t = (np.arange(steps) + 0.5) / steps
    lit = (t[None] < SHADOW[:, None]).mean(axis=1)
    return np.repeat(lit[None, :, None], 3, axis=2).astype(np.float32)


def test_it_stops_where_doubling_no_longer_matters() -> None:
    found = converge(march, lambda image: image, start=4, tolerance=1e-3)
    assert found.within
    assert found.change < 1e-3
    assert found.value.shape == (1, 97, 3)
    exact = SHADOW.mean()
    assert np.sqrt(((found.value[0, :, 0] - SHADOW) ** 2).mean()) / exact < 2e-3
    coarser = converge(march, lambda image: image, start=4, tolerance=1e-2)
    assert coarser.steps < found.steps


def test_it_says_when_it_has_not_converged() -> None:
    found = converge(march, lambda image: image, start=4, limit=16, tolerance=1e-6)
    assert (found.steps, found.within) == (16, False)
    assert found.change > 1e-6


def test_without_light_nothing_changes() -> None:
    found = converge(lambda steps: np.zeros((2, 2, 3), np.float32), lambda image: image)
    assert found.change == 0
    assert found.within


def test_progress_is_heard() -> None:
    heard: list[float] = []
    converge(march, lambda image: image, start=4, progress=heard.append)
    assert heard[-1] == 1
    assert all(0 < fraction <= 1 for fraction in heard)


@pytest.mark.parametrize("start", [2, 8])
def test_the_answer_does_not_depend_on_the_start(start: int) -> None:
    found = converge(march, lambda image: image, start=start)
    assert found.value.mean() == pytest.approx(SHADOW.mean(), rel=2e-3)
