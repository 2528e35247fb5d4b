"""The lit volume as a mesh (Billeter 2010; Hoobler 2016).

A mesh with one vertex at each texel of a light's shadow map parts the lit air from the shaded. The light that the air
scatters up to a distance along a view ray is known when nothing shades it, so each face that the ray crosses adds or
subtracts one such term: no samples, no steps, all detail of the map. Vertices are pulled from the map itself; the
mesh takes no memory.

``model="physical"`` sums over the shaded air instead of the lit: ``L_v = Σ_lights lit·G(0) ∓ Σ_faces G(t)``, where
``G(t)`` is the airlight between a face and the surface behind it, minus where the ray enters the shadow and plus
where it leaves it. Faces behind the surface have ``G = 0``, so the depth test drops them before they are shaded; the
light's near plane needs no cap, as the air around the map is lit; and the first term knows whether the ray begins in
shadow. For directional lights ``G`` is a closed form; for point lights (six maps) and spot lights it is a quadrature
in every fragment, several times as dear.

There are two ways to find the faces that a ray meets (``evaluate``). ``"faces"`` draws the mesh with additive
blending, as the papers do: for every light, but each of many overlapping faces is a fragment of every pixel behind
it, so fine structure between the light and the air costs tens of milliseconds. ``"walk"`` follows each pixel's ray
through the map in compute, each texel a flat face with upright sides; blocks of 4², 16² and 64² texels that the ray
passes wholly above or below are one step (after the min–max maps of Chen 2011; they take 0.53 MiB a light for a map
of 1024²). It serves directional lights; point and spot lights are drawn.

``model="paper"`` is S1's equation 9: ``L_c·ρ(g)·(1 − e^(−τd))/τ``, without σs, for every face of the mesh, far plane
included, without depth test, added where the ray leaves the lit volume and subtracted where it enters it, ``d``
clamped at the surface behind the pixel; the base image is not attenuated. The paper's mesh is a sheet; here its
border stands up to the near plane and a cap closes it there, without which most rays would leave the volume unseen
and their sums be negative. The equation is one of parallel light: other lights are refused.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from tyndall.gpu.device import ADD, Raster
from tyndall.gpu.params import param
from tyndall.gpu.resources import Texture
from tyndall.scene.model import DirectionalLight, Scene
from tyndall.techniques.contract import Technique, Unsupported, View
from tyndall.techniques.shadow.depth_maps import first_layers, layer_count
from tyndall.techniques.volumetric.paper import refuse_near_lights

_STATE = Raster(targets=(("rgba32float", ADD),), topology="triangle-strip")


@dataclass(frozen=True)
class Polygonal(Technique):
    """Exact integrals between the faces of the light volume."""

    name: ClassVar[str] = "polygonal"
    paper: ClassVar[str] = "Billeter 2010, Real time volumetric shadows using polygonal light volumes; Hoobler 2016"
    advice: ClassVar[str] = (
        "Sharp, noise-free shafts in a uniform medium, best for the sun; cost grows with map² × lights."
    )
    tests_depth: ClassVar[bool] = True
    reads_maps: ClassVar[bool] = True

    model: Literal["physical", "paper"] = param("physical", doc="the scene's medium, or S1's equation")
    evaluate: Literal["walk", "faces"] = param(
        "walk", doc="how a ray meets the volume's sides (physical)", rebuild=True
    )
    g: float = param(0.4, -0.99, 0.99, "mean cosine of the phase function (paper)")
    tau: float = param(0.3, 1e-9, None, "extinction coefficient (paper)", unit="1/m")

    def supports(self, scene: Scene) -> None:
        """Raise :class:`Unsupported` for a light that the paper's equation cannot describe."""
        if self.model == "paper":
            refuse_near_lights(self, scene)

    def render(self, view: View) -> None:
        """Walk the maps for directional lights, and draw every face of the other lights' meshes."""
        maps = view.images["shadow_maps"]
        walks = self.model == "physical" and self.evaluate == "walk"
        if walks:
            ranges = view.buffer("ranges", lambda: np.zeros((_blocks(maps), 2), np.float32), element="vec2f")
            across = -(-maps.size[0] // 64) * 16
            view.compute("blocks").bind(ranges_out=ranges.read_write()).dispatch(across, across, maps.size[2])
        else:
            ranges = view.buffer("ranges", lambda: np.zeros((1, 2), np.float32), element="vec2f")
        view.compute("begin").bind(ranges=ranges).dispatch(*view.size)
        lights = enumerate(zip(view.scene.lights, first_layers(view.scene), strict=True))
        drawn = [
            (index, layer)
            for index, (light, first) in lights
            if not (walks and isinstance(light, DirectionalLight))
            for layer in range(first, first + layer_count(light))
        ]
        if drawn:
            self._draw_faces(view, drawn)

    def _draw_faces(self, view: View, drawn: list[tuple[int, int]]) -> None:
        """Add the faces of (light, map) pairs."""
        gpu, physical = view.gpu, self.model == "physical"
        if "float32-blendable" not in gpu.features:
            raise Unsupported(
                "polygonal adds up 32-bit floats for this light, which this adapter cannot blend (float32-blendable): "
                "use froxel or march"
            )
        size = view.images["shadow_maps"].size[0]
        target = [(view.images["inscatter"].view(), None)]
        depth = (view.images["depth"].view(), None) if physical else None
        bindings = {**view.scope, "params": view.params}
        with gpu.render(f"{view.owner}.faces", target, depth, depth_read_only=True) as native:
            for index, layer in drawn:
                bindings["light_index"], bindings["layer"] = gpu.constant(index), gpu.constant(layer)
                # The mesh lies on the lit surfaces, where G = 0: pushed back a little, those faces fail the depth test.
                tested = replace(_STATE, depth=view.gpu.depth_format, depth_write=False, depth_bias=-64)
                state = tested if physical else _STATE
                pipeline, group = gpu.raster(self.shader(), state, bindings, overlay=view.overlay)
                native.set_pipeline(pipeline)
                native.set_bind_group(0, group)
                native.draw(2 * size, size - 1)  # a strip a row of texels


def _blocks(maps: Texture) -> int:
    """Blocks of 4², 16² and 64² texels of all maps."""
    across = -(-maps.size[0] // 64)
    return maps.size[2] * sum((across << 2 * level) ** 2 for level in range(3))
