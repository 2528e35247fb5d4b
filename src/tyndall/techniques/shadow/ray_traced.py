"""Shadows by rays.

A ray from what a pixel shows towards a light says whether the light reaches it (Appel 1968): exact for the scene's
triangles, with no map whose texels or depth could be too coarse. A light with a radius is seen as a cone of directions,
``sin θ = r/d``, and visibility is the part of its irradiance that nothing hides. It is estimated by ``samples`` rays a
frame whose density is the cosine to the surface's normal (``wesl/horizon.wesl``), and their mean over frames is kept
(:mod:`tyndall.techniques.accumulation`). The samples are low-discrepancy points in time and across the picture
(``wesl/screen_sequence.wesl``). As the light shrinks to a point, the rays close up to the single ray of a hard shadow.

The answer for a pixel is weighted by the light's irradiance and its reflection from one direction, that of the light's
centre, as for every shadow technique; so a light's radius softens shadows, but not highlights. Where the horizon cuts
the light, the direction lies above the centre's by as much as makes the irradiance right (Snyder 1996): a matte surface
fades over the whole width of the light, as in the traced reference, and not to nothing as the centre sets. Only a light
that the horizon cuts and that is hidden in part besides is not exact: the samples are not quite even along the horizon,
which is at most 1 % of the irradiance of a surface that faces the light, and 2.5 % if the light fills much of the sky.
Of a rectangular light, points are chosen by the cosine exactly, also where the horizon cuts it: some that are even in
angle are refused (``wesl/rect.wesl``).
Where shading normals bend far from the facets, the facets' own shade shows at the terminator, as it does in the traced
reference.

Points in the air are answered by a ray as well (``air="rays"``): exact, one ray for each of a volumetric technique's
samples, for a light with a size to a random point of it. ``air="map"`` leaves the air to shadow maps
(:class:`~tyndall.techniques.shadow.shadow_map.ShadowMap`), which is faster where many points are asked for. Maps are
drawn only then, or when the volumetric technique walks through them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from tyndall.gpu.params import param
from tyndall.techniques.accumulation import accumulated
from tyndall.techniques.contract import Technique, View, Visibility
from tyndall.techniques.shadow.shadow_map import ShadowMap

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True)
class RayTraced(Technique):
    """A ray a light and pixel; several for a light with a radius."""

    name: ClassVar[str] = "ray_traced"
    paper: ClassVar[str] = "Appel 1968, Some techniques for shading machine renderings of solids; Cook 1984 (soft)"
    casts_rays: ClassVar[bool] = True
    advice: ClassVar[str] = "Exact for any light, scene and scale, and soft where a light has a size; costs rays."
    reads_motion: ClassVar[bool] = True

    samples: int = param(1, 1, 256, "rays a pixel, frame and light with a size")
    fresh: int = param(8, 1, 64, "times as many rays, to 64, where a soft shadow remembers nothing")
    history: int = param(32, 1, 2047, "frames that a soft shadow remembers while the camera moves", unit="frame")
    air: Literal["rays", "map"] = param("rays", doc="what answers for points in the air", rebuild=True)
    map_size: int = param(1024, 16, 16384, "width and height of a map, if maps are drawn", unit="texel", rebuild=True)

    def render(self, view: View, content: Sequence[Any]) -> Visibility:
        """Trace every light, and draw maps where they are read. Without content all light passes, as through an
        empty map.
        """
        if not content:
            empty = ShadowMap(size=16)
            return empty.render(view.part(empty), content)
        lights = view.scene.lights
        world = view.world.bindings
        soft = [light.extent > 0 for light in lights]
        if any(soft):
            means, images = accumulated(view, len(lights))
            view.compute("soft").bind(world, **images).dispatch(*view.size, len(lights))
        else:
            size = (*view.size, max(1, len(lights)))
            means = view.texture("means0", size, "r32uint", dimension="2d-array")
        if not all(soft):
            view.compute("hard").bind(world, means_out=means.write()).dispatch(*view.size, len(lights))
        bindings = {**world, "shadow_means": means}
        if self.air == "rays" and not view.maps_wanted:
            return Visibility(self.shader(), self.shader(), bindings)
        maps = ShadowMap(size=self.map_size)
        drawn = maps.render(view.part(maps), content)
        air = drawn.module if self.air == "map" else self.shader()
        return Visibility(air, self.shader(), {**bindings, **drawn.bindings}, drawn.maps, drawn.overlay)
