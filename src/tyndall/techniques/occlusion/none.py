"""No ambient occlusion: the ambient light reaches everything, as in the reference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tyndall.techniques.contract import Occlusion, Technique, View


@dataclass(frozen=True)
class NoOcclusion(Technique):
    """The same ambient light everywhere."""

    name: ClassVar[str] = "none"
    paper: ClassVar[str] = "none"
    advice: ClassVar[str] = "For measurements, and for scenes whose ambient light is 0: costs nothing."

    def render(self, view: View) -> Occlusion:
        """Draw nothing."""
        return Occlusion(self.shader())
