"""No volumes: what fills implicit surfaces is not drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from tyndall.gpu.resources import Texture
from tyndall.techniques.contract import Technique, View


@dataclass(frozen=True)
class NoVolumes(Technique):
    """The surfaces' light as it is."""

    name: ClassVar[str] = "none"
    paper: ClassVar[str] = "none"
    advice: ClassVar[str] = "For measurements: clouds are left out; costs nothing."

    def render(self, view: View, base: Texture, volumes: Sequence[Any]) -> Texture:
        """Draw nothing."""
        return base
