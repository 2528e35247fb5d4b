"""Percentage-closer soft shadows (Fernando 2005).

A light with a size throws a penumbra that widens with the caster's distance from the receiver. Three steps find it in
one depth map: **search** the map around the place for what stands before it; from the blockers' distance the
**penumbra's** width, by similar triangles; and percentage-closer **filtering** (:mod:`tyndall.techniques.shadow.pcf`)
over a disk as wide. Of a light of radius ``r`` at distance ``d`` that is blocked at ``b`` from the light, the disk's
radius at the receiver is ``r·(d − b)/b``; of a directional light blocked at height ``h`` it is ``h·tan(α/2)``, α its
angular diameter. So the disk is the light's own image through the caster, and behind the straight edge of one caster
the visibility is exactly the part of the light's disk that is seen.

What differs from the paper: the light's size is that of the scene's light, in metres or radians, not a parameter; a
sphere is the disk that hides the same cone, ``r/√(1 − r²/d²)``; blockers count only where they stand in the cone
between the place and the light, so that what is beside it does not widen the penumbra; and disks lie on the receiver's
plane.

The map shows only what is nearest to the light, and all blockers are taken for one at their mean: where casters overlap
the penumbra is too narrow or too wide. Blockers are searched as far around as any caster in the scene's box could
matter, but no farther than four of the light's radii: what is within a fifth of the way to the light is taken for
smaller than it is. Where the light has no size, or so little that it is less than ``min_radius`` texels, edges are
smooth over those.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from tyndall.content.contract import Casters, Content
from tyndall.gpu.params import param
from tyndall.techniques.contract import View, Visibility
from tyndall.techniques.shadow.depth_maps import DepthMaps

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True)
class Pcss(DepthMaps):
    """A depth map a light, whose answers are averaged over the penumbra."""

    name: ClassVar[str] = "pcss"
    paper: ClassVar[str] = "Fernando 2005, Percentage-closer soft shadows"
    advice: ClassVar[str] = (
        "Soft shadows of lights with a size from one map, right behind single casters; too light or wide where several "
        "overlap."
    )

    search_samples: int = param(24, 1, 64, "places at which blockers are searched")
    samples: int = param(32, 1, 64, "places that are averaged over the penumbra")
    min_radius: float = param(1.0, 0, 64, "least radius of the disk", unit="texel")

    def render(self, view: View, content: Sequence[Content], casters: Casters = "all") -> Visibility:
        """Draw all maps of what casts."""
        return self.draw(view, content, casters)
