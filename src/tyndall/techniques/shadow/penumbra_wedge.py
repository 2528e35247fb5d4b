"""Soft shadow volumes: penumbra wedges (Assarsson and Akenine-Möller 2003, *A geometry-based soft shadow volume
algorithm using graphics hardware*).

A light with a size leaves the shadow of its centre (:mod:`~tyndall.techniques.shadow.shadow_volume`) at each edge of
the outline of what casts: the *wedge* of an edge is where the edge covers a part of the light. In it, the share of
the light that is hidden is that of the centre, 0 or 1, corrected by the area between the edge, as a point sees it
before the light, and the light's rim::

    hidden = count + Σ_edges (area(centre, a, b) − area(rim between a and b)) / area(light)

with a and b the ends of what of the edge lies before the light. For one outline this is the area of a polygon cut by
the light's shape, so that umbra, penumbra and their meeting are exact for the outline that the centre sees, on any
receiver. The light's shape is a disk for spheres and for directional lights with an angle, a rectangle for
:class:`~tyndall.scene.model.RectLight`; both areas have closed forms (the paper tabulates them).

What differs from the paper: wedges are not drawn. A workgroup takes a tile of the picture, encloses what it shows in
a box, and keeps the edges that may stand between this box and the light; its pixels then integrate over these alone.
No fragment is shaded, nothing is blended, and sums are in 32-bit floats.

What the method cannot know, as in the paper: outlines are those of the light's centre; shadows that overlap in their
penumbrae are added, not united; and light is weighted by the light's area, not by the cosine of the receiver. An open
mesh is two sheets, of which the darker one counts (:mod:`~tyndall.techniques.shadow.silhouettes`). As the light
shrinks, wedges close and the hard shadow is left.

Surfaces with holes have no outline; their hard shadow comes from a shadow map and is multiplied in. The air is
answered by shadow maps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from tyndall.content.contract import Content
from tyndall.gpu.params import param
from tyndall.techniques.contract import Technique, Unsupported, View, Visibility
from tyndall.techniques.shadow.masks import with_air
from tyndall.techniques.shadow.shadow_map import ShadowMap
from tyndall.techniques.shadow.shadow_volume import Counter
from tyndall.techniques.shadow.silhouettes import Sheet, has_turned


@dataclass(frozen=True)
class PenumbraWedge(Technique):
    """Penumbrae from the outline's edges, integrated in each pixel."""

    name: ClassVar[str] = "penumbra_wedge"
    paper: ClassVar[str] = "Assarsson and Akenine-Möller 2003, A geometry-based soft shadow volume algorithm"
    advice: ClassVar[str] = (
        "Soft shadows without noise or texels, near exact for solid casters; its cost grows with outline and light."
    )
    tests_depth: ClassVar[bool] = True

    map_size: int = param(1024, 16, 16384, "maps for the air and for surfaces with holes", unit="texel", rebuild=True)

    def render(self, view: View, content: Sequence[Content]) -> Visibility:
        """Integrate each light, of its two sheets one after the other."""
        maps = ShadowMap(size=self.map_size)
        counter = Counter(view, "zfail", maps, content)
        if len(counter.outlines) > 1:
            raise Unsupported(
                f"{self.name}: outlines of more than one kind of content; use shadow_volume or ray_traced"
            )
        size = (*view.size, max(1, len(view.scene.lights)))
        visible = view.texture("visible", size, "r32float", dimension="2d-array")
        sheets: list[Sheet] = ["facing", "turned"] if has_turned(view, counter.outlines) else ["facing"]
        for sheet in sheets:
            for light, counts, found in counter.each(segments=True, sheet=sheet):
                bound: dict[str, Any] = {
                    **counter.beside,
                    "volume_count": counts.stencil(),
                    "light_index": view.gpu.constant(light),
                    "visible_out": visible.read_write(),
                }
                for silhouette in found:
                    bound["segments"] = silhouette.segments
                    bound["first_side"] = silhouette.first_side
                    bound["side_arguments"] = silhouette.arguments.split("u32")
                    bound["argument"] = view.gpu.constant(silhouette.offset // 4)
                view.compute("integrate").bind(bound).features(
                    has_outline=bool(found),
                    has_maps=bool(counter.beside) and sheet == sheets[0],
                    goes_on=sheet != sheets[0],
                ).dispatch(*view.size)
        return with_air(view, content, self.shader(), {"wedge_visible": visible}, maps)
