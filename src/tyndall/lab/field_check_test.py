"""The check finds that cells and whole programs agree, and would find that they do not."""

from __future__ import annotations

import numpy as np
import pytest

from tyndall.gpu.device import Gpu
from tyndall.lab import field_check
from tyndall.lab.field_check import agreement, values
from tyndall.scene.model import Implicit
from tyndall.sdf import box, sphere, union
from tyndall.sdf.field import Field


def blob(count: int = 40, smooth: float = 0.1) -> Implicit:
    rng = np.random.default_rng(3)
    return Implicit(union(*(sphere(0.2).at(*rng.uniform(-1, 1, 3)) for _ in range(count)), smooth=smooth))


def test_cells_agree_with_the_whole(gpu: Gpu) -> None:
    implicits = [blob(), Implicit(box(1))]
    with Field(gpu, implicits) as field:
        found = agreement(gpu, field, implicits, 4000)
        points = np.random.default_rng(1).uniform(-1, 1, (500, 3))
        whole = values(gpu, field, 0, points)[:, 0]
    assert found.points == 4000
    assert 2000 < found.near <= 4000
    assert found.difference < 1e-5
    assert found.excess < 1e-5
    assert found.flipped == 0
    assert found.to_json()["points"] == 4000
    np.testing.assert_allclose(whole, implicits[0].shape(points), atol=1e-5)


def test_a_difference_would_be_found(gpu: Gpu, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = np.array([[1, 1.5, 1, 1], [1, 9, 0, 1.25], [0.5, 9, 0, -0.25], [-0.5, 9, 0, -0.25]], np.float32)
    monkeypatch.setattr(field_check, "values", lambda gpu, field, index, points: np.resize(rows, (len(points), 4)))
    implicits = [blob()]
    with Field(gpu, implicits) as field:
        found = agreement(gpu, field, implicits, 40)
    assert (found.near, found.difference, found.excess, found.flipped) == (10, 0.5, 0.25, 10)
