"""Depth maps that may be blurred: what variance and exponential shadow maps have in common.

A depth map's answers can be averaged, its depths cannot. These techniques keep functions of the depth whose mean over
many texels still says what part of them is nearer to the light than a place. So maps are blurred once a frame, by a
Gaussian of any radius in two passes over all maps at once, and a place costs four texels whatever the radius.

The depth is linear: metres along the ray from a point or spot light, or along a directional light, as part of the map's
reach; 1 where nothing was drawn. Each map is blurred by itself, its border repeated; maps show so much more than they
must cover that the blur of the part that is asked for knows it all, which is why a cube's faces meet (while the radius
is below a quarter of the map). Texels are interpolated in the shader, as 32-bit floats cannot be everywhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

from tyndall.content.contract import Casters, Content
from tyndall.gpu.params import param
from tyndall.techniques.contract import View, Visibility
from tyndall.techniques.shadow.depth_maps import DepthMaps

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True)
class MomentMaps(DepthMaps):
    """Abstract: depth maps, and a blurred map of each.

    A technique's shader has the passes ``across``, from depth to what is kept, and ``down``.

    Attributes:
        format: of the blurred maps.
    """

    format: ClassVar[str]

    radius: float = param(2.0, 0, 64, "radius of the blur, twice its standard deviation", unit="texel")

    @property
    def margin(self) -> int:
        """As far as the blur and the interpolation reach; a quarter of the map at most."""
        return min(2 + math.ceil(self.radius), self.size // 4)

    def render(self, view: View, content: Sequence[Content], casters: Casters = "all") -> Visibility:
        """Draw all maps of what casts, and blur them."""
        drawn = self.draw(view, content, casters)
        size = (self.size, self.size, max(1, self.map_count(view.scene)))
        half = view.texture("across", size, self.format, dimension="2d-array")
        full = view.texture("blurred", size, self.format, dimension="2d-array")
        across, down = (view.compute(entry).bind(drawn.bindings).overlay(drawn.overlay) for entry in ("across", "down"))
        across.bind(moments_out=half.write()).dispatch(*size)
        down.bind(shadow_moments=half, moments_out=full.write()).dispatch(*size)
        return replace(drawn, bindings={**drawn.bindings, "shadow_moments": full})
