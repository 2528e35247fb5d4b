"""Brute-force ray march of single scattering against the shadow technique's visibility.

``L_v = Σ_lights Σ_steps σs · p(θ) · E · V · ∫ e^(−σt·s) ds``. For a directional light the light that reaches a step's
sample is taken as constant over the step and the extinction is integrated exactly, so an unshadowed uniform medium is
exact with any number of steps; steps have equal transmittance (equal length in thin air). For a point or spot light
the steps are even in the angle at the light (Kulla and Fajardo 2012). Converged, this is the reference that the other
techniques are held against.

The number of loop iterations of one dispatch is kept below 2^16: software adapters silently cut longer loops, so many
lights are marched in several dispatches.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tyndall.gpu.params import param
from tyndall.techniques.contract import Technique, View

_LOOP_LIMIT = 60_000


@dataclass(frozen=True)
class March(Technique):
    """Samples along every pixel's ray."""

    name: ClassVar[str] = "march"
    paper: ClassVar[str] = "Tóth and Umenhoffer 2009, Real-time volumetric lighting in participating media"
    advice: ClassVar[str] = "The truth to compare with, or for stills: cost grows with pixels × steps × lights."

    steps: int = param(128, 1, 30_000, "samples along a ray for each light")
    jitter: float = param(1.0, 0, 1, "random shift of the samples, changing every frame", unit="step")

    def render(self, view: View) -> None:
        """March, in as many dispatches as the loop limit asks for."""
        lights = len(view.scene.lights)
        batch = max(1, _LOOP_LIMIT // self.steps)
        ends = [min(first + batch, lights) for first in range(0, max(lights, 1), batch)]
        images = [view.images["inscatter"]]
        if len(ends) > 1:
            images.append(view.texture("partial", view.size, "rgba32float"))
        first = 0
        for index, end in enumerate(ends):
            target = images[(len(ends) - 1 - index) % 2] if len(ends) > 1 else images[0]
            previous = view.scope["black"] if index == 0 else images[(len(ends) - index) % 2]
            view.compute("march").bind(
                previous=previous,
                inscatter_out=target.write(),
                first_light=view.gpu.constant(first),
                light_end=view.gpu.constant(end),
            ).dispatch(*view.size)
            first = end
