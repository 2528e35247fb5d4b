"""A reference that has converged, and says so.

A technique with a number of steps is rendered with ``n``, ``2n``, ``4n`` … steps until doubling changes its
in-scattered light ``L_v`` by less than a tolerance, measured as :func:`~tyndall.lab.metrics.rel_rmse` of one
against the next. The error of a ray march is at least of first order in the step, also where a ray crosses a
shadow's edge, so the change on doubling is at least half of the error that is left.

How many steps a view needs hardly depends on the number of pixels: where a full-size picture takes long, the search
runs on a small picture of the same view, and one full-size picture is rendered with the number that it found.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.params import ParameterError, fields_of, replace
from tyndall.lab import metrics
from tyndall.lab.stage import Stage, Still, make
from tyndall.techniques.contract import Technique

LIMIT = 8192
PROBE_PIXELS = 10_000


@dataclass(frozen=True)
class Converged[T]:
    """What :func:`converge` found.

    Attributes:
        value: what was rendered with ``steps``.
        steps: the least number tried whose doubling changes ``L_v`` by less than the tolerance, or the last one tried.
        change: relative RMSE of ``L_v`` between ``steps`` and twice as many; 0 where there is no light at all.
        within: whether ``change`` is below the tolerance.
        seconds: what the last picture, of twice as many steps, took.
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
    limit: int = LIMIT,
    tolerance: float = 1e-3,
    progress: Callable[[float], object] | None = None,
) -> Converged[T]:
    """Render with twice the steps until the light no longer changes.

    Args:
        render: makes a result with a number of steps.
        light: the result's ``L_v``, (H, W, 3).
        start, limit: first number of steps, and the largest to be held against its double.
        tolerance: relative change of ``L_v`` on doubling that counts as none.
        progress: hears a fraction of 1.
    """
    steps, value = start, render(start)
    while True:
        before = time.monotonic()
        finer = render(2 * steps)
        seconds = time.monotonic() - before
        change = metrics.rel_rmse(light(finer), light(value)) or 0.0
        if progress:
            progress(min(1.0, tolerance / change if change else 1.0))
        if change < tolerance or 2 * steps > limit:
            return Converged(value, steps, change, change < tolerance, seconds)
        steps, value = 2 * steps, finer


@dataclass(frozen=True, eq=False)
class Reference:
    """A converged technique on a stage.

    Attributes:
        made: the technique, with its parameters.
        steps, change, within: as in :class:`Converged`.
        still: the frame that errors are measured against.
        probe: size in pixels of the picture that the search ran on.
        seconds: what one full-size frame takes.
    """

    made: Technique
    steps: int
    change: float
    within: bool
    still: Still
    probe: tuple[int, int]
    seconds: float

    @property
    def technique(self) -> str:
        """The technique's name."""
        return self.made.name

    def to_json(self) -> dict[str, Any]:
        """How it was found, and the mean of its ``L_v`` that errors are relative to."""
        return {
            "technique": self.technique,
            "steps": self.steps,
            "change_on_doubling": round(self.change, 6),
            "converged": self.within,
            "probe": list(self.probe),
            "mean": float(self.still.light.mean(dtype=np.float64)),
        }


def find(
    stage: Stage,
    name: str = "march",
    *,
    budget_s: float = 90.0,
    patience_s: float = 0.25,
    progress: Callable[[float], object] | None = None,
) -> Reference:
    """The reference of a stage's view: technique ``name`` without jitter, converged.

    Args:
        budget_s: the longest that one full-size frame may take. Where convergence asks for more, fewer steps are used,
            and the result says by how much the light would still change.
        patience_s: where the first full-size frame takes longer, the search runs on a small picture.
        progress: hears a fraction of 1.

    Raises:
        ParameterError: no such technique, or one without a number of steps.
    """
    base = make("volumetric", name, stage.scene)
    names = {f.name for f in fields_of(type(base))}
    if "steps" not in names:
        raise ParameterError(f"reference: '{name}' has no number of steps to converge with; 'march' has")
    if "jitter" in names:
        base = replace(base, {"jitter": 0})

    def search(where: Stage, limit: int) -> Converged[Still]:
        def render(steps: int) -> Still:
            return where.still(replace(base, {"steps": steps}))

        start = min(128, limit)
        return converge(render, lambda still: still.light, start=start, limit=limit, progress=progress)

    stage.still(replace(base, {"steps": 1}))  # pipelines are compiled here, not in the time that decides
    before = time.monotonic()
    stage.still(replace(base, {"steps": 64}))
    seconds = time.monotonic() - before
    width, height = stage.size
    shrink = (PROBE_PIXELS / (width * height)) ** 0.5
    affordable = max(1, 2 ** int(np.log2(max(1.0, 64 * budget_s / seconds))))
    if seconds < patience_s or shrink >= 1:
        found = search(stage, min(LIMIT, affordable))
        made = replace(base, {"steps": found.steps})
        return Reference(made, found.steps, found.change, found.within, found.value, stage.size, found.seconds / 2)

    probe = (max(1, round(width * shrink)), max(1, round(height * shrink)))
    with stage.resized(probe) as small:
        found = search(small, min(LIMIT, affordable))
    before = time.monotonic()
    made = replace(base, {"steps": found.steps})
    still = stage.still(made)
    return Reference(made, found.steps, found.change, found.within, still, probe, time.monotonic() - before)
