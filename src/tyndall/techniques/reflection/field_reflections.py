"""Reflection and refraction by rays through the field of implicit surfaces (Whitted 1980).

Where a material has ``reflections`` or ``transmission``, the pixel's light is gathered anew, along a tree of rays that
splits at each polished or clear surface: a part ``F`` of the light comes from the mirrored direction, of the rest a
part ``transmission`` from the refracted one, and what is left is the surface's own matte light::

    L = F·L_mirrored + (1 − F)·(transmission·L_refracted + (1 − transmission)·L_matte) + L_lights'_highlights

F is Fresnel's of a dielectric with the material's ``ior`` (0.04 at normal incidence for 1.5, and 1 beyond the angle of
total reflection), of a metal Schlick's with its colour. A white surface in even light stays as bright as it is: what
is mirrored and refracted takes the place of the ambient light, in the same measure. Inside, a ray is marched through
the negative field and dimmed by Beer's law, so that after ``attenuation_distance`` the base colour is left of white
light.

What a ray meets is lit by the scene's lights, with the visibility of the shadow technique, by the ambient light, and
by what it emits; a ray that meets nothing brings the background. Rays end after ``bounces`` surfaces with the
background's light, or where less than 1/500 of it would arrive.

Limits. Reflections are sharp, whatever the roughness: they are meant for what is polished. Rays see implicit surfaces
only, not meshes nor air; meshes reflect nothing. Clear things cast shadows as opaque ones do. A clear thing inside
another takes its own index of refraction against air.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from tyndall.content.implicit import materials_of
from tyndall.gpu.params import param
from tyndall.gpu.resources import Texture
from tyndall.scene.model import Scene
from tyndall.techniques.contract import Technique, View


@dataclass(frozen=True)
class FieldReflections(Technique):
    """A tree of rays from each pixel that shows a polished or clear implicit surface."""

    name: ClassVar[str] = "field_reflections"
    paper: ClassVar[str] = "Whitted 1980, An improved illumination model for shaded display"
    advice: ClassVar[str] = (
        "Mirrors, water and glass among implicit surfaces; sharp, and without meshes. Costs only where there are any."
    )

    bounces: int = param(4, 1, 8, "surfaces that a ray meets at most, the one that is seen among them")

    def render(self, view: View, base: Texture, surfaces: Any = None) -> Texture:
        """Gather what polished and clear surfaces show.

        Args:
            base: the surfaces' light.
            surfaces: what the implicit surfaces bind of the picture: which of them each pixel shows.

        Returns:
            The surfaces' light with that.
        """
        if view.fields is None or not view.keep("wanted", None, lambda: shows_surroundings(view.scene)):
            return base
        out = view.texture("light", view.size, "rgba16float")
        march = view.compute("gather").bind(view.fields.bindings, **surfaces)
        march.bind(base=base.sampled(), light_out=out.write()).dispatch(*view.size)
        return out


def shows_surroundings(scene: Scene) -> bool:
    """Whether a material of an implicit surface is polished or clear."""
    return any(m.reflections or m.transmission > 0 for one in scene.implicits for m in materials_of(one))
