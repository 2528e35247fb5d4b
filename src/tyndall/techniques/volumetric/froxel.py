"""Frustum-aligned voxels (Wronski 2015).

The view frustum is cut into ``W×H×D`` cells. Pass *scatter* finds, per froxel, the light scattered towards the viewer
per metre; pass *accumulate* integrates each column front to back; pass *apply* samples the sums at each pixel's
depth.

``model="physical"`` takes the scene's medium: a slab of a froxel adds ``T·J·(1 − e^(−σt·Δs))/σt`` (Hillaire 2015) and
the base image is attenuated by ``T``. Slices lie between the nearest and the farthest point of the medium (or of the
scene, or ``far``), clipped to the medium's box; what lies beyond the last slice counts as lit, as it does outside
a shadow map.

``model="paper"`` is S1's equations 10–12: ``L = L_c·V·ρ(g)·C_s·density·D(k)``, summed without extinction and added to
an unattenuated base image; light is not dimmed by the medium, lights other than directional are refused, and a pixel
takes the value of its froxel's layer. Slices are uniform in view depth, ``z_k = k·z_limit/D``: that is what equation
10 says, which scales a homogeneous vector. (Its prose says uniform in clip depth, which would put 127 of 128 slices
into the first 1.3 m of a view whose near plane is at 1 cm.) Where ``z_limit`` is 0 it is the far side of the scene.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from tyndall.gpu.params import param
from tyndall.scene.model import Scene
from tyndall.techniques.contract import Technique, View
from tyndall.techniques.volumetric.paper import refuse_near_lights


@dataclass(frozen=True)
class Froxel(Technique):
    """A 3-D grid over the view frustum."""

    name: ClassVar[str] = "froxel"
    paper: ClassVar[str] = (
        "Wronski 2015, Volumetric fog and lighting; Hillaire 2015, Physically based volumetric rendering"
    )
    advice: ClassVar[str] = (
        "The usual choice in games: cheap, any light, nearly independent of the scene; fine shafts blur."
    )

    grid: tuple[int, int, int] = param((190, 90, 128), 1, 1024, "froxels across, down and deep", rebuild=True)
    model: Literal["physical", "paper"] = param("physical", doc="the scene's medium, or S1's equations")
    far: float = param(
        0.0, 0, None, "view depth where the grid ends; 0: the far side of the medium (physical)", unit="m"
    )
    samples: int = param(2, 1, 16, "light samples along a froxel (physical)")
    jitter: float = param(0.0, 0, 1, "random shift of the samples, changing every frame (physical)", unit="froxel")
    z_limit: float = param(
        0.0, 0, None, "view depth where the grid ends; 0: the far side of the scene (paper)", unit="m"
    )
    g: float = param(0.4, -0.99, 0.99, "mean cosine of the phase function (paper)")
    density: float = param(1.0, 0, None, "density of the medium (paper)")
    c_s: float = param(0.1, 0, None, "scattering constant (paper)", unit="1/m")

    def supports(self, scene: Scene) -> None:
        """Raise :class:`Unsupported` for a light that the paper's equations cannot describe."""
        if self.model == "paper":
            refuse_near_lights(self, scene)

    def render(self, view: View) -> None:
        """Scatter, accumulate, apply."""
        scattering = view.texture("scattering", self.grid, "rgba16float", dimension="3d")
        accumulated = view.texture("accumulated", self.grid, "rgba16float", dimension="3d")
        linear = view.gpu.sampler()
        view.compute("scatter").bind(scattering_out=scattering.write()).dispatch(*self.grid)
        view.compute("accumulate").bind(scattering=scattering, accumulated_out=accumulated.write()).dispatch(
            *self.grid[:2]
        )
        view.compute("apply").bind(accumulated=accumulated, linear_sampler=linear).dispatch(*view.size)
