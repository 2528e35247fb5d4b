"""Media inside implicit surfaces, by a march of even steps (Perlin and Hoffert 1989, *Hypertexture*).

A :class:`~tyndall.scene.model.Volume` is the inside of a shape, filled with a medium. Along each pixel's ray, from
where it enters the shape to where it leaves it or meets what the pixel shows, the density is looked up at ``steps``
places: the part of the medium's coefficients that is there, which grows from 0 at the surface to 1 at a depth of the
volume's ``edge``. Each step is taken for even: it lets ``e^(−σt·ρ·h)`` of the light behind it through, and adds
``σs/σt·(1 − e^(−σt·ρ·h))`` of the light that its middle scatters towards the camera, that of all lights and the ambient
light. In a medium with a sharp edge under even light the sum is exact with any number of steps.

The lights are seen through the shadow technique's answer for the air, so surfaces cast their shadows into the medium;
the medium itself shades neither them nor itself. It is drawn after the surfaces' own light and before the scene's air,
which then lies before and not in it, and several volumes one after the other, the farther one first: where they overlap
one covers the other. Reflections do not see it.

``jitter`` moves a pixel's places by a part of a step, another one in each frame, so that antialiasing hides the steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tyndall.gpu.params import param
from tyndall.gpu.resources import Bound, Texture
from tyndall.scene.model import Volume
from tyndall.sdf.field import Field
from tyndall.techniques.contract import Technique, View

_PACKED = 4  # densities in a word


@dataclass(frozen=True, eq=False)
class Filled:
    """A volume on the device.

    Attributes:
        volume: as the scene has it.
        field: its shape.
        medium: what fills it, as a uniform.
        edge: a uniform of one number.
    """

    volume: Volume
    field: Field
    medium: Bound
    edge: Bound


@dataclass(frozen=True)
class UniformMarch(Technique):
    """Even steps through each volume."""

    name: ClassVar[str] = "uniform_march"
    paper: ClassVar[str] = "Perlin and Hoffert 1989, Hypertexture"
    advice: ClassVar[str] = "Clouds and smoke in any implicit shape; soft edges want more steps."

    steps: int = param(32, 1, 512, "places along a ray through a volume", rebuild=True)
    jitter: float = param(1.0, 0, 1, "part of a step by which places differ between pixels and frames")

    def render(self, view: View, base: Texture, volumes: Sequence[Filled]) -> Texture:
        """Draw all volumes over the surfaces' light, and return that."""
        eye = np.asarray(view.camera.position)

        def distance(filled: Filled) -> float:
            low, high = filled.volume.surface.bounds or (eye, eye)
            return float(np.linalg.norm(0.5 * (low + high) - eye))

        words = -(-self.steps // _PACKED)
        for number, filled in enumerate(sorted(volumes, key=distance, reverse=True)):
            filled.field.update()
            spans = view.texture("spans", view.size, "rg32float")
            densities = view.texture("densities", (*view.size, words), "r32uint", dimension="2d-array")
            out = view.texture(f"light{number % 2}", view.size, "rgba16float")
            view.compute("density").bind(
                filled.field.bindings, volume_edge=filled.edge, spans_out=spans.write(), densities_out=densities.write()
            ).dispatch(*view.size)
            view.compute("light").bind(
                volume_medium=filled.medium,
                spans=spans.sampled(),
                densities=densities.sampled(),
                base=base.sampled(),
                light_out=out.write(),
            ).dispatch(*view.size)
            base = out
        return base
