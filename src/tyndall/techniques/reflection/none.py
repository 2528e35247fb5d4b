"""No reflections: every material is lit as if it were rough, and clear ones are opaque."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from tyndall.gpu.resources import Texture
from tyndall.techniques.contract import Technique, View


@dataclass(frozen=True)
class NoReflections(Technique):
    """The surfaces' light as it is."""

    name: ClassVar[str] = "none"
    paper: ClassVar[str] = "none"
    advice: ClassVar[str] = "For measurements: polished and clear materials look matte; costs nothing."

    def render(self, view: View, base: Texture, surfaces: Any = None) -> Texture:
        """Draw nothing."""
        return base
