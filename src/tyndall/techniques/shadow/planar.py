"""Shadows by flattening (Blinn 1988).

A point of a caster p and its shadow on a plane lie in one line with the light. With the plane as a row ``P`` whose
product with a homogeneous point is the height over it, and the light as a homogeneous point ``L`` (w = 0 for a
directional one),

    M = (P·L)·I − L·Pᵀ

takes p to its shadow. All of the scene is drawn once for each light and plane through M and then the camera, and
darkens the pixels that show this plane; so edges are exact to the rasteriser's 1/256 of a pixel, at any distance and
without any map. The light is a point or a direction: one with a size is taken for its centre.

M alone also throws "anti-shadows", of what is behind the plane or beyond the light. Here the near plane of the camera's
clip space is replaced by the receiver, since the height over it is linear in p: what lies in or behind the plane is
clipped, also where a triangle goes through it. What is beyond the light has w ≤ 0, and its fragments are dropped.

Blinn drew the flattened triangles over the plane in the colour of the shadow, and had to lift them a little to be seen.
Here they go into an image of a byte a light. Which of the planes a pixel shows is told by its place and normal, written
as a depth, and the depth test lets through what is drawn for this plane.

Only flat receivers are served, the largest (:mod:`~tyndall.techniques.shadow.planes`); everything else is lit as if
nothing cast a shadow on it, its sides that face away from a light aside. Points in the air are answered by shadow maps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from tyndall.content.contract import PLANE_FORMAT, SHADE_TARGET
from tyndall.gpu.device import Raster
from tyndall.gpu.params import param
from tyndall.techniques.contract import Technique, View, Visibility
from tyndall.techniques.shadow.masks import with_air
from tyndall.techniques.shadow.planes import (
    MOST,
    Lit,
    bind_planes,
    check_planes,
    flatness,
    lit_by,
    planes_of,
    source_of,
)
from tyndall.techniques.shadow.shadow_map import ShadowMap

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tyndall.content.contract import Content
    from tyndall.scene.model import Scene

_FLATTENING = "package::content::casting::Flattening"
_WHICH = Raster(depth=PLANE_FORMAT, depth_compare="always")


@dataclass(frozen=True)
class Planar(Technique):
    """Casters flattened onto the scene's largest planes."""

    name: ClassVar[str] = "planar"
    paper: ClassVar[str] = "Blinn 1988, Me and my (fake) shadow"
    advice: ClassVar[str] = (
        "Sharp and exact on floors and walls, at any distance; curved and small surfaces get no shadow at all."
    )
    receivers: ClassVar[Literal["all", "planes"]] = "planes"

    planes: int = param(8, 1, MOST, "planes at most that get shadows", rebuild=True)
    share: float = param(0.02, 0, 1, "part of the scene's area that such a plane has at least", rebuild=True)
    map_size: int = param(1024, 16, 16384, "width and height of a map, for the air", unit="texel", rebuild=True)

    def supports(self, scene: Scene) -> None:
        """Raise :class:`~tyndall.techniques.contract.Unsupported` where no plane is large enough."""
        check_planes(self.name, scene, self.share)

    def render(self, view: View, content: Sequence[Content]) -> Visibility:
        """Tell the planes apart, then draw the casters of four lights in one pass."""
        gpu, lights = view.gpu, view.scene.lights
        planes = planes_of(view.scene, self.planes, self.share)
        pairs = lit_by(view.scene, planes)
        images = view.texture(
            "shade", (*view.size, max(1, -(-len(lights) // 4))), SHADE_TARGET[0], dimension="2d-array",
            usage="sampled target",
        )  # fmt: skip
        which = view.texture("which", view.size, PLANE_FORMAT, usage="sampled target")
        if content:
            scope = {**view.scope, **bind_planes(view, planes)}
            with gpu.render(f"{view.owner}.which", depth=(which.view(), 0.0)) as native:
                pipeline, group = gpu.raster(self.shader(), _WHICH, scope)
                native.set_pipeline(pipeline)
                native.set_bind_group(0, group)
                native.draw(3)
            for kind in content:
                kind.prepare("flattened", {**view.scope, "which": which.sampled()}, view.size, view.owner)
        table = view.buffer("flattenings", lambda: self._rows(view, pairs), element=_FLATTENING).read()
        width, height = view.size
        for image in range(images.size[2]):
            targets = [(images.view(layer=image), (1.0, 1.0, 1.0, 1.0))]
            with gpu.render(f"{view.owner}.flatten", targets, (which.view(), None if content else 0.0)) as native:
                for row, pair in enumerate(pairs):
                    if pair.light // 4 != image:
                        continue
                    scope = {
                        "camera": view.scope["camera"],
                        "flattenings": table,
                        "flattening": gpu.constant(row),
                        "light_index": gpu.constant(pair.light),
                    }
                    depth = (pair.plane + 1) / 32  # as planar.wesl numbers them
                    native.set_viewport(0, 0, width, height, depth, depth)
                    for kind in content:
                        kind.draw_flattened(native, scope)
        return with_air(view, content, self.shader(), {"shade_images": images}, ShadowMap(size=self.map_size))

    def _rows(self, view: View, pairs: Sequence[Lit]) -> NDArray[Any]:
        near = flatness(view.scene)
        rows = np.zeros(max(1, len(pairs)), view.gpu.dtype(_FLATTENING))
        for row, pair in zip(rows, pairs, strict=False):
            source = source_of(view.scene.lights[pair.light])
            # Divided by P·L, so that w is 1 on the plane.
            row["matrix"] = (np.eye(4) - np.outer(source, pair.row) / (pair.row @ source)).T
            row["plane"] = pair.row - (0, 0, 0, near)
            row["channel"][pair.light % 4] = 1
        return rows
