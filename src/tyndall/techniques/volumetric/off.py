"""No volumetric light: ``L_v = 0``, ``T = 1``, as if there were a vacuum before the camera.

The base image is that of all techniques: the medium still dims point and spot lights on their way to a surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tyndall.techniques.contract import Technique, View


@dataclass(frozen=True)
class Off(Technique):
    """The medium is left out."""

    name: ClassVar[str] = "off"
    paper: ClassVar[str] = "none"
    lights_air: ClassVar[bool] = False
    advice: ClassVar[str] = "The base image alone, to see what the air adds and costs."

    def render(self, view: View) -> None:
        """Clear both images, once: no other technique writes them while this one is in use."""
        view.keep("cleared", None, lambda: view.compute("clear").dispatch(*view.size))
