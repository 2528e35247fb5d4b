"""No antialiasing: one sample at each pixel's centre."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tyndall.gpu.resources import Texture
from tyndall.techniques.contract import Technique, View


@dataclass(frozen=True)
class NoAntialiasing(Technique):
    """The picture as it was lit."""

    name: ClassVar[str] = "none"
    paper: ClassVar[str] = "none"
    advice: ClassVar[str] = "For measurements: every pixel is one sample, nothing is carried over from earlier frames."

    def jitter(self, frame: int) -> tuple[float, float]:
        """Sub-pixel offset of a frame's samples, in pixels: none."""
        return (0.0, 0.0)

    def render(self, view: View, image: Texture) -> Texture:
        """Return the image itself."""
        return image
