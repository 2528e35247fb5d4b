"""Ambient occlusion from the distance field.

How much of the sky a surface sees is asked of the field in a few directions: along each of them, the least distance to
anything as a part of the way gone says how wide a cone is free (Evans 2006, *Fast approximations for global
illumination on dynamic scenes*; Quilez's five taps along the normal are the cheapest form of it). Here the numbers
have a meaning: the hemisphere, weighed by the cosine, is the unit disk in the surface's plane (Nusselt's analogon),
and seven smaller disks stand for it, one in its middle and six around it, which have together its centre and spread.
Each is a cone of directions with as much of the ambient light; in it a wall is a straight line, and what it leaves of
the disk is ``1/2 + (s·√(1 − s²) + arcsin s)/π``, with ``s`` the distance to the line in the disk's radii.

So an open plane is exactly open. In the corner of a floor and a wall that is ``x`` away it is within 0.02 of the
closed form ``1 − (arccos k − k·√(1 − k²))/π, k = x/radius``, with no noise and no factor to be tuned; nothing fades
towards the radius, as in :mod:`~tyndall.techniques.occlusion.ray_traced_ao`. Where a cone's axis meets something, how
deep it goes in says how much of the cone is hidden besides, and a wall is taken to go on to the radius behind where it
was met. Where a floor meets two walls, a quarter is open, and seven cones say up to 0.33; below a ball that all but
rests on the floor they say 0.15 less than the form factor.

Meshes receive it, but only implicit surfaces occlude.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tyndall.gpu.params import param
from tyndall.scene.model import Scene
from tyndall.techniques.contract import Occlusion, Technique, Unsupported, View


@dataclass(frozen=True)
class FieldAo(Technique):
    """Seven cones through the distance field."""

    name: ClassVar[str] = "field_ao"
    paper: ClassVar[str] = "Evans 2006, Fast approximations for global illumination on dynamic scenes; Quilez"
    advice: ClassVar[str] = (
        "Corners and contacts of implicit surfaces, smooth and at once; meshes darken nothing: there, ray_traced_ao."
    )

    radius: float = param(1.0, 1e-6, None, "distance within which surfaces block the ambient light", unit="m")
    steps: int = param(16, 1, 256, "most samples of the field along a cone")
    strength: float = param(1.0, 0, 1, "part of the darkening that is applied; 1 is what a grey sky gives")

    def supports(self, scene: Scene) -> None:
        """Raise :class:`~tyndall.techniques.contract.Unsupported` where nothing could occlude."""
        if not scene.implicits:
            raise Unsupported(
                f"{self.name}: only implicit surfaces occlude here, and this scene has none; use ray_traced_ao"
            )

    def render(self, view: View) -> Occlusion:
        """Gather what is open above each pixel's surface."""
        assert view.fields is not None, "supports() saw implicit surfaces"
        image = view.texture("open", view.size, "r32float")
        view.compute("gather").bind(view.fields.bindings, ambient_out=image.write()).dispatch(*view.size)
        return Occlusion(self.shader(), {"ambient_image": image.sampled()})
