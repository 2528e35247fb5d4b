"""Shadows from the distance field.

The field of implicit surfaces says at each place how far the nearest of them is. Along a ray towards a light these
distances are the room around the ray; where it is less than the light's cone is wide, part of the light is hidden
(Quilez 2010, *Soft shadows in raymarched SDFs*; Aaltonen 2018 for what lies between the samples). A light of radius
``r`` at distance ``D`` fills a cone of ``sin θ = r/D``; with ``d(t)`` the distance at ``t``, the nearest edge leaves
``s = min d(t) / (t·tan θ)`` of the cone's radius free, and of a disk that a straight edge cuts at ``s`` ``1/2 + (s·√(1
− s²) + arcsin s)/π`` is seen. As the light shrinks to a point the cone closes to the single ray of a hard shadow.

What differs from the usual formula:

- The cone is the light's own, in metres or radians, not a factor of sharpness.
- Between samples, ``(d/t)²`` of a plane, an edge or a point is a quadratic function of ``1/t``; its least value is
  taken from the last three samples, so that a few steps find the nearest place.
- The usual penumbra lies wholly outside of the hard shadow, since a ray that hits something is dark; shadows grow with
  the light. Here six more rays through a ring of the cone tell how far the edge is on the other side, so that the
  penumbra lies around the hard shadow's edge, also behind things that are thinner than it is wide. They are marched
  only where the first ray lacks room.
- Of a light that a surface's horizon cuts, the cone is that of the part above.

Behind a straight edge the answer is within 0.065 of the light's share, and within 0.1 where less than 0.15 of it is
left; its mean over the penumbra is right to 0.012. Where several edges cut the light it is that of seven smaller cones
with an edge each. A rectangle is taken for a disk of the same area.

With ``cones=1`` there is only the first ray, for lights of any size: what it leaves open is the part beside one
straight edge, at the room outside of what hides the light, or at the depth that the ray goes in. Of what is thinner
than the light's cone is wide only the half of the penumbra outside of the hard shadow is seen. It looks no closer than
a part of a pixel's width at the receiver: it starts a quarter of one above the surface, two away, and meets what is
nearer than an eighth of one. Its steps are longer than the usual ones, and cells far from all surfaces cost it nothing
but a look; see ``field_one.wesl``.

Meshes receive these shadows as well. What they cast comes from a shadow map
(:class:`~tyndall.techniques.shadow.shadow_map.ShadowMap`) of the meshes alone, which is multiplied in; without
implicit surfaces the scene's shadows are that map's. The same marches answer for the air.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from tyndall.content.mesh import Meshes
from tyndall.gpu.params import param
from tyndall.techniques.contract import Technique, View, Visibility
from tyndall.techniques.shadow.masks import mask_image
from tyndall.techniques.shadow.shadow_map import ShadowMap

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tyndall.content.contract import Content


@dataclass(frozen=True)
class FieldShadows(Technique):
    """Rays through the distance field, soft by the room around them."""

    name: ClassVar[str] = "field"
    paper: ClassVar[str] = "Quilez 2010, Soft shadows in raymarched SDFs; Aaltonen 2018"
    advice: ClassVar[str] = (
        "For implicit surfaces: soft by the light's size, without noise or texels; meshes cast as in shadow_map."
    )

    cones: Literal[1, 7] = param(7, doc="rays to a light with a size: 1 is fast, 7 are nearer the truth", rebuild=True)
    steps: int = param(96, 4, 1024, "most steps of a ray towards a light with a size; of the only one, a quarter of it")
    map_size: int = param(1024, 16, 16384, "width and height of the meshes' maps", unit="texel", rebuild=True)

    def render(self, view: View, content: Sequence[Content]) -> Visibility:
        """March towards each light from what each pixel shows, and draw the meshes' maps."""
        maps: ShadowMap = view.keep("maps", None, lambda: ShadowMap(size=self.map_size))
        meshes = [kind for kind in content if isinstance(kind, Meshes)] if view.scene.instances else []
        if view.fields is None or not content:
            return maps.render(view.part(maps), content)
        walked = maps.render(view.part(maps, "walked"), content) if view.maps_wanted else None
        if meshes:
            cast = maps.render(view.part(maps), meshes)
        else:
            cast = walked or view.keep("empty", None, lambda: _no_meshes(view))
        answers = mask_image(view)
        soft = [light.extent > 0 for light in view.scene.lights]
        known = {
            "FIELD_WITH_MESHES": bool(meshes),
            "FIELD_HARD": not all(soft),
            "FIELD_SOFT": any(soft),
            "FIELD_ONE": self.cones == 1,
        }
        told = view.keep("masks", (answers, *known.values()), lambda: answers.sampled().declaring(**known))
        bindings = {**view.fields.bindings, **cast.bindings, "field_params": view.params, "shadow_masks": told}
        march = view.compute("surfaces").bind(bindings, answers_out=answers.write()).overlay(cast.overlay)
        march.dispatch(*view.size, answers.size[2])
        if walked:  # those who walk through maps find these, and the few other points of the air ask them as well
            cast = walked
        return Visibility(self.shader(), self.shader(), {**bindings, **cast.bindings}, cast.maps, cast.overlay)


def _no_meshes(view: View) -> Visibility:
    """A map in which nothing is drawn; it stays as it is."""
    empty = ShadowMap(size=16)
    return empty.render(view.part(empty, "empty"), [])
