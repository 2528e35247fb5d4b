"""Shadows by projective textures (Segal and others 1992).

The outline of the casters is drawn in black from the light, without depth: a photograph of them against the sky, as a
slide that the light then projects onto its receivers. A point is looked up where the light sees it,

    T = bias · P · V · M

with the light's projection P and view V, the point's place M and the bias from clip space to texture coordinates; the
texture's filter smooths the edge over a texel. Directional and spot lights have one such texture, point lights a cube
of six. The light is a point or a direction: one with a size is taken for its centre.

An outline without depth cannot tell what lies before a receiver from what lies behind it, so that in the papers' form
receivers do not cast, and a receiver behind which a caster stands is wrong. Here a texel has a channel for each
receiver, and a fragment darkens those that it is in front of; so floors, walls and what is between them shade each
other.

What touches a receiver loses the texel's height nearest to it, or the filter would spread a wall's texels onto the
floor that it stands on; a thin caster's shadow begins up to a texel off its foot.

Only flat receivers are served, the largest (:mod:`~tyndall.techniques.shadow.planes`); everything else is lit as if
nothing cast a shadow on it, its sides that face away from a light aside. Points in the air are answered by shadow maps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from tyndall.content.contract import SHADE_TARGET
from tyndall.gpu.params import param
from tyndall.techniques.contract import Technique, View, Visibility
from tyndall.techniques.shadow.depth_maps import first_layers, layer_count, light_layers
from tyndall.techniques.shadow.masks import with_air
from tyndall.techniques.shadow.planes import MOST, Plane, bind_planes, check_planes, flatness, lit_by, planes_of
from tyndall.techniques.shadow.shadow_map import ShadowMap

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tyndall.content.contract import Content
    from tyndall.scene.model import Scene

_SILHOUETTE = "package::content::casting::Silhouette"


@dataclass(frozen=True)
class Projective(Technique):
    """The casters' outline, thrown onto the scene's largest planes like a slide."""

    name: ClassVar[str] = "projective"
    paper: ClassVar[str] = "Segal 1992, Fast shadows and lighting effects using texture mapping"
    advice: ClassVar[str] = (
        "Smooth edges on floors and walls at the cost of a map without depth; curved and small surfaces get no shadow."
    )
    receivers: ClassVar[Literal["all", "planes"]] = "planes"

    size: int = param(1024, 16, 16384, "width and height of an outline's texture", unit="texel", rebuild=True)
    planes: int = param(8, 1, MOST, "planes at most that get shadows; four share a texture", rebuild=True)
    share: float = param(0.02, 0, 1, "part of the scene's area that such a plane has at least", rebuild=True)
    map_size: int = param(1024, 16, 16384, "width and height of a map, for the air", unit="texel", rebuild=True)

    def supports(self, scene: Scene) -> None:
        """Raise :class:`~tyndall.techniques.contract.Unsupported` where no plane is large enough."""
        check_planes(self.name, scene, self.share)

    def render(self, view: View, content: Sequence[Content]) -> Visibility:
        """Draw the outline of all casters from each light."""
        gpu = view.gpu
        planes = planes_of(view.scene, self.planes, self.share)
        images = max(1, -(-len(planes) // 4))
        count = sum(layer_count(light) for light in view.scene.lights)
        outlines = view.texture(
            "outlines", (self.size, self.size, max(1, count * images)), SHADE_TARGET[0], dimension="2d-array",
            usage="sampled target",
        )  # fmt: skip
        table = view.fitted("silhouettes", lambda: self._rows(view, planes), element=_SILHOUETTE).read()
        for layer in range(count):
            targets = [(outlines.view(layer=layer * images + image), (1.0, 1.0, 1.0, 1.0)) for image in range(images)]
            scope = {"silhouettes": table, "layer": gpu.constant(layer)}
            for kind in content:
                kind.prepare("silhouette", scope, (self.size, self.size), view.owner)
            with gpu.render(f"{view.owner}.outline", targets) as native:
                for kind in content:
                    kind.draw_silhouette(native, scope, images)
        bindings = {
            **bind_planes(view, planes),
            "silhouettes": table,
            "outlines": outlines,
            "outline_sampler": gpu.sampler(),
            "outline_images": gpu.constant(images),
        }
        return with_air(view, content, self.shader(), bindings, ShadowMap(size=self.map_size))

    def _rows(self, view: View, planes: tuple[Plane, ...]) -> NDArray[Any]:
        scene, near = view.scene, flatness(view.scene)
        layers = light_layers(scene, self.size)
        rows = np.zeros(max(1, len(layers)), view.gpu.dtype(_SILHOUETTE))
        for row, layer in zip(rows, layers, strict=False):
            row["view_proj"], row["inverse"] = layer.matrix.T, np.linalg.inv(layer.matrix).T
        first = first_layers(scene)
        for pair in lit_by(scene, planes):
            its = slice(first[pair.light], first[pair.light] + layer_count(scene.lights[pair.light]))
            rows["planes"][its, pair.plane] = pair.row - (0, 0, 0, near)
        return rows
