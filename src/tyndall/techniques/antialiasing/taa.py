"""Temporal antialiasing (Korein and Badler 1983; Karis 2014).

Each frame's samples are shifted inside their pixels (Halton sequence in bases 2 and 3, Halton 1964). The history is
read where the surface was in the last frame, with a Catmull–Rom filter, clipped to the colours around the pixel
(Karis 2014's box in YCoCg, from mean and deviation as Salvi 2016, no larger than the colours themselves), and blended
with the new sample. Where something in the scene moves and the history has nothing as deep around the place, it is left
out: an object has uncovered what the pixel shows. While the camera stands still, nothing is clipped and the blend
weight falls as 1/n until ``blend``, so that a still picture converges fast.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tyndall.gpu.params import param
from tyndall.gpu.resources import Texture
from tyndall.techniques.contract import Technique, View


def halton(index: int, base: int) -> float:
    """Element ``index`` ≥ 1 of the van der Corput sequence in ``base``, in (0, 1)."""
    result, fraction = 0.0, 1.0
    while index > 0:
        fraction /= base
        result += fraction * (index % base)
        index //= base
    return result


@dataclass(frozen=True)
class Taa(Technique):
    """Sub-pixel samples gathered over frames."""

    name: ClassVar[str] = "taa"
    paper: ClassVar[str] = "Karis 2014, High-quality temporal supersampling"
    advice: ClassVar[str] = "The default: smooth edges for the price of one sample a pixel, after a few frames."
    reads_motion: ClassVar[bool] = True

    blend: float = param(0.06, 0.001, 1, "smallest weight of the new frame")
    clip: float = param(1.25, 0.1, 16, "half width of the box that history is clipped to", unit="standard deviation")
    period: int = param(16, 1, 1024, "length of the sequence of shifts", unit="frame")

    def jitter(self, frame: int) -> tuple[float, float]:
        """Sub-pixel offset of a frame's samples, in pixels, each in ±0.5."""
        index = frame % self.period + 1
        return (halton(index, 2) - 0.5, halton(index, 3) - 0.5)

    def render(self, view: View, image: Texture) -> Texture:
        """Blend ``image`` into the history and return the result."""
        history = [view.texture(f"history{i}", view.size, "rgba16float") for i in range(2)]
        target, source = history[view.frame % 2], history[(view.frame + 1) % 2]
        view.compute("resolve").bind(
            image=image, history=source, linear_sampler=view.gpu.sampler(), resolved_out=target.write()
        ).dispatch(*view.size)
        return target
