"""Percentage-closer filtering (Reeves, Salesin and Cook 1987).

A depth map must not be blurred before the comparison, but its answers may be averaged after it: the visibility of a
place is the mean over places around it, ``V(p) = 1/n · Σ [z(pᵢ) ≥ depth(pᵢ)]``, each of which asks four texels and
weights their answers. Edges become smooth over about ``radius`` texels, everywhere alike; this hides texels, and is no
penumbra.

The places lie on a disk across the light's rays in a golden-angle spiral (Vogel 1979), turned by another angle in each
pixel and frame, so that too few of them make noise and no bands. Unlike in the paper, they are not places of the map
but of the receiver's plane, each brought back to the map: the plane is then compared with its own depth everywhere, and
shades itself at no radius; and around a point light each place finds its own face of the cube, so that no seam shows.
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
class Pcf(DepthMaps):
    """A depth map a light, whose answers are averaged over a disk."""

    name: ClassVar[str] = "pcf"
    paper: ClassVar[str] = "Reeves, Salesin and Cook 1987, Rendering antialiased shadows with depth maps"
    advice: ClassVar[str] = (
        "Smooth edges without texels, everywhere as wide; cheap at small radii, grainy at large ones."
    )

    radius: float = param(2.5, 0, 256, "radius of the disk around a place", unit="texel")
    samples: int = param(16, 1, 64, "places on the disk")

    def render(self, view: View, content: Sequence[Content], casters: Casters = "all") -> Visibility:
        """Draw all maps of what casts."""
        return self.draw(view, content, casters)
