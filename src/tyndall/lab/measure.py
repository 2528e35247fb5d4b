"""How long a frame takes on the GPU, pass by pass, on the host, and how many bytes it holds.

GPU times come from timestamp queries around every pass, so they exclude the host. A frame's queries are read back
before the next frame is drawn: the device never runs two measured frames at once, and the host's time is that of
encoding and submitting alone. The first frames (``warmup``) are drawn and thrown away: they compile pipelines, fill
caches and bring the device to its clock.

A technique's time is the sum of its own passes, named ``family.technique`` and ``family.technique.step``; its memory is
what its owner of that name holds. The median is the figure to quote; the minimum is the least disturbed frame, and the
95th percentile shows how steady it was. An adapter without timestamp queries gives no GPU times: None, not zero.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from tyndall.gpu.params import ParameterError


class Drawable(Protocol):
    """What :func:`measure` needs of a :class:`tyndall.frame.Renderer`."""

    def draw(self) -> float: ...
    def timings(self) -> dict[str, float]: ...
    def memory(self) -> dict[str, int]: ...


@dataclass(frozen=True)
class Times:
    """Milliseconds of some frames: median, least, and 95th percentile (linear between ranks)."""

    median: float
    min: float
    p95: float

    @classmethod
    def of(cls, samples: Iterable[float]) -> Times:
        """Raises ValueError where there are no samples."""
        values = np.fromiter(samples, np.float64)
        if not len(values):
            raise ValueError("no frames were measured")
        return cls(float(np.median(values)), float(values.min()), float(np.percentile(values, 95)))

    def to_json(self) -> dict[str, float]:
        """``{median, min, p95}`` in milliseconds, to a nanosecond-ish six digits after the point."""
        return {"median": round(self.median, 6), "min": round(self.min, 6), "p95": round(self.p95, 6)}


@dataclass(frozen=True)
class Measurement:
    """What :func:`measure` found.

    Attributes:
        passes: GPU milliseconds of each pass, and of the whole frame under "frame"; empty without timestamp queries.
        families: GPU milliseconds of each family's or content's passes together ("volumetric", "shadow", "mesh", …).
        host: host milliseconds to encode and submit a frame.
        memory: bytes on the device by owner.
        frames: how many frames were measured.
    """

    passes: dict[str, Times]
    families: dict[str, Times]
    host: Times
    memory: dict[str, int]
    frames: int

    @property
    def frame(self) -> Times | None:
        """GPU milliseconds of the whole frame; None without timestamp queries."""
        return self.passes.get("frame")

    def technique(self, family: str) -> Times | None:
        """GPU milliseconds of a family's passes; zeros where it draws none, None without timestamp queries."""
        return self.families.get(family, Times(0.0, 0.0, 0.0)) if self.passes else None

    def bytes_of(self, family: str) -> int:
        """Bytes that a family's technique holds."""
        return sum(size for owner, size in self.memory.items() if belongs(owner, family))

    def to_json(self) -> dict[str, Any]:
        """Everything, as plain data."""
        return {
            "passes": {name: times.to_json() for name, times in self.passes.items()},
            "host_ms": self.host.to_json(),
            "memory": dict(self.memory),
            "frames": self.frames,
        }


def belongs(name: str, family: str) -> bool:
    """Whether a pass or an owner of bytes is of a family: ``volumetric.froxel.scatter`` is of ``volumetric``."""
    return name == family or name.startswith(family + ".")


def measure(
    renderer: Drawable,
    *,
    frames: int = 64,
    warmup: int = 16,
    budget_s: float | None = None,
    progress: Callable[[float], object] | None = None,
    before: Callable[[], object] | None = None,
) -> Measurement:
    """Draw ``warmup`` frames, then measure ``frames`` more.

    ``before`` is called before each frame, outside of all times; :class:`~tyndall.lab.busy.Busy` is made for it.

    With ``budget_s`` it stops early, after at least one warm-up and two measured frames, so that both parts together
    end near that many seconds on a slow adapter; a fast one never notices. ``progress`` hears a fraction of 1.

    Raises:
        ParameterError: fewer than one frame.
    """
    if frames < 1:
        raise ParameterError(f"frames: {frames} is fewer than 1")
    start = time.monotonic()
    total = frames + warmup

    def spent() -> float:
        return (time.monotonic() - start) / budget_s if budget_s else 0.0

    for done in range(warmup):
        if done and spent() > 0.25:
            break
        if before:
            before()
        renderer.draw()
        renderer.timings()
        if progress:
            progress(min(1.0, max((done + 1) / total, spent())))

    host: list[float] = []
    samples: list[dict[str, float]] = []
    while len(samples) < frames and (len(samples) < 2 or spent() < 1):
        if before:
            before()
        host.append(renderer.draw())
        samples.append(renderer.timings())
        if progress:
            progress(min(1.0, max((warmup + len(samples)) / total, spent())))
    names = list(dict.fromkeys(name for sample in samples for name in sample))
    families = dict.fromkeys(name.split(".")[0] for name in names)
    return Measurement(
        passes={name: Times.of(sample.get(name, 0.0) for sample in samples) for name in names},
        families={
            family: Times.of(sum(ms for name, ms in sample.items() if belongs(name, family)) for sample in samples)
            for family in families
        },
        host=Times.of(host),
        memory=renderer.memory(),
        frames=len(samples),
    )


def wall_clock(
    draw: Callable[[], object],
    wait: Callable[[], object],
    *,
    frames: int = 64,
    warmup: int = 2,
    budget_s: float | None = None,
) -> Times:
    """Milliseconds that whole frames take by the clock, from the call of ``draw`` until ``wait`` says that it is drawn.

    Host and device are both in it, one after the other: the time after which a picture is there. With ``budget_s`` it
    stops early, after at least two frames.

    Raises:
        ParameterError: fewer than one frame.
    """
    if frames < 1:
        raise ParameterError(f"frames: {frames} is fewer than 1")
    start = time.monotonic()
    samples: list[float] = []
    for index in range(warmup + frames):
        begin = time.perf_counter()
        draw()
        wait()
        taken = (time.perf_counter() - begin) * 1e3
        if index >= warmup:
            samples.append(taken)
        if budget_s and len(samples) >= 2 and time.monotonic() - start > budget_s:
            break
    return Times.of(samples)
