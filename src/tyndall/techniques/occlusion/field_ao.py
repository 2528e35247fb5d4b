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

``cones=1`` is the cheapest form, five values along the normal, with weights that follow from the corner instead of
taste. There the value at ``h`` above the floor is ``min(h, x)``, and the closed form is ``1/2 + ∫ 2/π·√(1 − t²) dt``
from 0 to ``k``. So with ``r`` the value as a part of ``h``, 1/2 and the integral of ``r`` over ``h/radius = sin φ``
with the weight ``2/π·sin² φ`` dφ is exactly that; the taps are the middles of equal parts of φ, and each has its part's
integral as its weight: five of them are within 0.004, three within 0.01, and an open plane is exactly open. Values go
down to ``−h``, so that what is closed above is dark. Balls beside and above the floor say (by least squares against
their form factors) that half of what a tap finds stays hidden for those that are farther; they are still missed by 0.19
(rms, from 0.1 below to 0.4 for what hangs overhead or is much smaller than the radius). The taps are at 4/3 of the
distances that they stand for, which changes nothing in the corner, and most of them above open ground are then known to
be open from the cells alone.

Meshes receive it, but only implicit surfaces occlude.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from tyndall.gpu.params import param
from tyndall.scene.model import Scene
from tyndall.techniques.contract import Occlusion, Technique, Unsupported, View


@dataclass(frozen=True)
class FieldAo(Technique):
    """Seven cones through the distance field, or values along the normal."""

    name: ClassVar[str] = "field_ao"
    paper: ClassVar[str] = "Evans 2006, Fast approximations for global illumination on dynamic scenes; Quilez"
    advice: ClassVar[str] = (
        "Corners and contacts of implicit surfaces, smooth and at once; meshes darken nothing: there, ray_traced_ao."
    )

    radius: float = param(1.0, 1e-6, None, "distance within which surfaces block the ambient light", unit="m")
    cones: Literal[1, 7] = param(
        7, doc="7: as near the truth as they get; 1: a few values along the normal", rebuild=True
    )
    steps: int = param(16, 1, 256, "most samples of the field along each of seven cones")
    taps: int = param(5, 1, 8, "values along the normal in place of cones")
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
        told = view.keep("told", (image, self.cones), lambda: image.write().declaring(AO_TAPS=self.cones == 1))
        view.compute("gather").bind(view.fields.bindings, ambient_out=told).dispatch(*view.size)
        return Occlusion(self.shader(), {"ambient_image": image.sampled()})
