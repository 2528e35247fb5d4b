"""Ambient occlusion by rays.

The part of the ambient light that reaches a surface is the part of the hemisphere above it, weighed by the cosine, in
which nothing lies within ``radius`` (Zhukov 1998; Landis 2002): ``1/π ∫ V(ω) (n·ω) dω``. It is estimated by ``samples``
rays a frame whose density is the cosine's, and their mean over frames is kept
(:mod:`tyndall.techniques.accumulation`). Nothing fades towards the radius: a surface counts whole or not at all. Where
it is infinite against the scene, a uniform sky's light is exact for one bounce.

Bumps of a normal map hide nothing: the hemisphere is that of the shading normal, and what of it lies below the triangle
is mirrored up by it. So an open surface is open whatever its normals, as a facet of a smooth solid is.

It multiplies the ambient light only; the lights' own shadows are the shadow technique's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tyndall.gpu.params import param
from tyndall.techniques.accumulation import accumulated
from tyndall.techniques.contract import Occlusion, Technique, View


@dataclass(frozen=True)
class RayTracedAo(Technique):
    """Cosine-weighted rays over the hemisphere, gathered over frames."""

    name: ClassVar[str] = "ray_traced_ao"
    paper: ClassVar[str] = "Zhukov 1998, An ambient light illumination model; Landis 2002"
    casts_rays: ClassVar[bool] = True
    advice: ClassVar[str] = "Corners and contacts darken as under a grey sky; noisy for some frames after each change."
    reads_motion: ClassVar[bool] = True

    radius: float = param(1.0, 1e-6, None, "distance within which surfaces block the ambient light", unit="m")
    samples: int = param(1, 1, 256, "rays a pixel and frame")
    fresh: int = param(8, 1, 64, "times as many rays, to 64, where nothing is remembered")
    history: int = param(32, 1, 2047, "frames that are remembered while the camera moves", unit="frame")

    def render(self, view: View) -> Occlusion:
        """Trace the frame's rays and add them to the mean."""
        means, images = accumulated(view, 1)
        view.compute("trace").bind(view.world.bindings, **images).dispatch(*view.size)
        return Occlusion(self.shader(), {"ambient_means": means})
