"""Blurred shadows: S4's "fake soft shadows".

The answers of a shadow map are drawn as a black and white image of what the camera sees, the image is blurred by a
Gaussian, and the light is multiplied by it. S4 has one image for all lights and multiplies the finished picture; here
each light has its own image, a byte a pixel, and only its own light is dimmed, so that shadows of several lights
overlap rightly. The Gaussian is separable: two passes of 2·radius + 1 taps, normalised over the taps, so that even
light stays as it is.

It looks soft and is not right: the width is one of the screen, the same near and far from the caster and the camera,
and knows nothing of the light's size; a foot that touches the floor lets go of its shadow; light and shade leak over
the outlines of what is in front. ``depth_aware`` is against the leaks: a tap counts less the farther it is from the
tangent plane of what the pixel shows, and the more its normal differs (a bilateral filter, Tomasi and Manduchi 1998, on
the G-buffer as Petschnigg 2004 on a second picture). It is no longer exactly separable, which shows at corners only.

Points in the air are answered by the shadow map as it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from tyndall.gpu.params import param
from tyndall.techniques.contract import Technique, View, Visibility
from tyndall.techniques.shadow.shadow_map import ShadowMap

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tyndall.content.contract import Content


@dataclass(frozen=True)
class Blurred(Technique):
    """A shadow map's black and white image, blurred on the screen."""

    name: ClassVar[str] = "blurred"
    paper: ClassVar[str] = "S4's fake soft shadows; depth_aware: Tomasi and Manduchi 1998, Bilateral filtering"
    advice: ClassVar[str] = (
        "Hides a map's texels cheaply; the softness is of the screen, the same everywhere, and no light's."
    )

    radius: int = param(8, 0, 64, "taps of the blur to each side; 0 leaves the map's answer", unit="pixel")
    sigma: float = param(4.0, 0.25, 64, "standard deviation of the Gaussian", unit="pixel")
    depth_aware: bool = param(False, doc="whether the blur stops at edges of depth and normal")
    size: int = param(1024, 16, 16384, "width and height of a map", unit="texel", rebuild=True)

    def render(self, view: View, content: Sequence[Content]) -> Visibility:
        """Draw the maps, then the image of each light, and blur it."""
        maps = ShadowMap(size=self.size)
        drawn = maps.render(view.part(maps), content)
        if self.radius == 0:
            return drawn
        groups = max(1, -(-len(view.scene.lights) // 4))  # of four lights, a channel each
        shade, across = (
            view.texture(label, (*view.size, groups), "rgba8unorm", dimension="2d-array")
            for label in ("shade", "across")
        )
        size = (*view.size, groups)
        answers = view.compute("black_white").overlay(drawn.overlay)
        answers.bind(drawn.bindings, shade_out=shade.write()).dispatch(*size)
        view.compute("blur_across").bind(shade_images=shade, shade_out=across.write()).dispatch(*size)
        view.compute("blur_down").bind(shade_images=across, shade_out=shade.write()).dispatch(*size)
        bindings = {**drawn.bindings, "shade_images": shade}
        return Visibility(drawn.module, self.shader(), bindings, drawn.maps, drawn.overlay)
