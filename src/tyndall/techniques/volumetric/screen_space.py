"""Light shafts as a blur of the sky towards the light (Mitchell 2007).

One pass over the picture: from each pixel, N samples towards the light's place on the screen ask whether the sky is
seen there; what they see stands for the light that reaches the air in front of the pixel. Occluders outside the
picture, in front of the light but not in front of the sky, or off the line to the light are missed.

``model="paper"`` is S1's equations 6–8: ``L_v = exposure · Σ_i decay^i · weight · L_c·V(p_i)/N`` with
``p_i = p + i·(p_l − p)/N`` for i = 1 … N and ``V = 1`` where the depth is the sky's and ``p_i`` lies in the picture. It
is added to an unattenuated base image. Lights other than directional are refused.

``model="physical"`` scatters in the scene's medium: the mean visibility ``V̄ = Σ decay^i·V / Σ decay^i`` multiplies
the airlight of the unshadowed ray, ``σs·p·E·(1 − e^(−σt·d))/σt`` for a directional light, and its quadrature for a
point or spot light; the base image is attenuated. Towards a light outside the picture the samples end at its edge: what
lies beyond says nothing. For point and spot lights a sample sees the light if what it shows lies farther than the
light.

With few samples the edge of a shaft shows them as stairs. ``jitter`` shifts them by noise that temporal antialiasing
averages out; neighbouring pixels then read farther apart, which costs some 15 % on the GPU that it was measured on.

A light behind the camera has no place on the screen: it makes no shafts (S1's formula would mirror it).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from tyndall.gpu.params import param
from tyndall.scene.model import Scene
from tyndall.techniques.contract import Technique, View
from tyndall.techniques.volumetric.paper import refuse_near_lights


@dataclass(frozen=True)
class ScreenSpace(Technique):
    """A radial blur of the visible sky."""

    name: ClassVar[str] = "screen_space"
    paper: ClassVar[str] = "Mitchell 2007, Volumetric light scattering as a post-process"
    advice: ClassVar[str] = (
        "Cheap shafts when the light is in the picture against an open sky; right only up to a scale."
    )

    samples: int = param(64, 1, 4096, "samples from a pixel towards the light")
    model: Literal["physical", "paper"] = param("physical", doc="the scene's medium, or S1's equation")
    jitter: float = param(0.0, 0, 1, "random shift of the samples, changing every frame (physical)", unit="step")
    decay: float = param(1.0, 0, 1, "weight of a sample relative to the one before")
    exposure: float = param(1.0, 0, None, "strength of the effect (paper)")
    weight: float = param(0.01, 0, None, "strength of a sample (paper)")

    @property
    def up_to_scale(self) -> bool:
        """Always: how much of the picture is sky stands for how much of the air is lit."""
        return True

    def supports(self, scene: Scene) -> None:
        """Raise :class:`Unsupported` for a light that the paper's equations cannot describe."""
        if self.model == "paper":
            refuse_near_lights(self, scene)

    def render(self, view: View) -> None:
        """One pass; a batch of lights a dispatch would not be faster."""
        view.compute("blur").dispatch(*view.size)
