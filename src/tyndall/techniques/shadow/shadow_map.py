"""Shadow maps (Williams 1978).

The scene's depth is drawn from each light; a point is in shadow where something nearer was drawn:
``V(p) = 1 if z(p) ≥ depth(p) else 0`` in reversed-Z. The maps, their bias and their finer maps near the camera are
those of :mod:`tyndall.techniques.shadow.depth_maps`. With ``filtering="linear"`` the four nearest texels' answers are
weighted (Reeves 1987 with the smallest kernel).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from tyndall.content.contract import Casters, Content
from tyndall.gpu.params import param
from tyndall.techniques.contract import View, Visibility
from tyndall.techniques.shadow.depth_maps import DepthMaps

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True)
class ShadowMap(DepthMaps):
    """One depth map a light."""

    name: ClassVar[str] = "shadow_map"
    paper: ClassVar[str] = "Williams 1978, Casting curved shadows on curved surfaces"
    advice: ClassVar[str] = (
        "The default: hard shadows for any scene and light; edges show texels when the map is too small."
    )

    filtering: Literal["nearest", "linear"] = param("linear", doc="one texel's answer, or four weighted")

    def render(self, view: View, content: Sequence[Content], casters: Casters = "all") -> Visibility:
        """Draw all maps of what casts."""
        return self.draw(view, content, casters)
