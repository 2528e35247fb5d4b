"""Shadow volumes (Crow 1977; stencil counting: Heidmann 1991).

The outline of what casts, as the light sees it, is extruded away from the light to infinity; what lies inside of the
volume that this encloses is in shadow. Whether a visible point does is counted in the stencil buffer, exactly and
without any texel of the light's:

- ``zpass``: on the way from the eye to the point, faces of volumes that are entered count +1, faces that are left −1.
  The count is wrong where the eye is inside of a volume, or where the near plane cuts one.
- ``zfail`` (Bilodeau and Songy 1999; Carmack 2000): the same count beyond the point, where faces that are left count
  +1. It needs the volumes' caps, triangles that face the light where they are and the same at infinity, and holds for
  any place of the eye. With a directional light all volumes meet in one point at infinity, and no cap is there.

The outline is found by :mod:`~tyndall.techniques.shadow.silhouettes`, so that open meshes, edges of many triangles,
duplicated vertices and lights inside of meshes are right too. Volumes are drawn by indirect draws, both faces in one,
with wrapping counters, so that the order of faces does not matter. A counter has eight bits: a point in exactly 256
(512, …) volumes at once would be lit. An open mesh casts with each of its triangles, and counts twice.

With ``darken_by_count`` each volume that a point is in takes that share of the light, as the thesis *Comparison of
shadow techniques* (2013) shows it with 0.1; the default is physical: one is enough.

Surfaces with holes have no outline; their shadow comes from a shadow map and is multiplied in. The air is answered by
shadow maps. Lights with a size cast the hard shadow of their centre.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

from tyndall.content.contract import Content
from tyndall.gpu.device import Raster, Stencil
from tyndall.gpu.params import param
from tyndall.gpu.resources import Texture
from tyndall.scene.model import DirectionalLight
from tyndall.techniques.contract import Technique, Unsupported, View, Visibility
from tyndall.techniques.shadow.masks import answered_by_masks, mask_image
from tyndall.techniques.shadow.shadow_map import ShadowMap
from tyndall.techniques.shadow.silhouettes import Sheet, Silhouette, silhouettes

MODULE = "package::techniques::shadow::shadow_volume"
_COUNT = {
    "zpass": Stencil(front_pass="increment-wrap", back_pass="decrement-wrap"),
    "zfail": Stencil(front_fail="decrement-wrap", back_fail="increment-wrap"),
}


@dataclass(frozen=True)
class ShadowVolume(Technique):
    """Outlines extruded to infinity, counted in the stencil buffer."""

    name: ClassVar[str] = "shadow_volume"
    paper: ClassVar[str] = "Crow 1977, Shadow algorithms for computer graphics; Heidmann 1991, Real shadows, real time"
    advice: ClassVar[str] = (
        "Hard shadows exact to the pixel, without texels or bias; its cost is the area that volumes cover."
    )
    tests_depth: ClassVar[bool] = True

    method: Literal["zpass", "zfail"] = param("zfail", doc="count before the point, or beyond it: right from anywhere")
    darken_by_count: float = param(0.0, 0, 1, "light that each volume takes; 0: one takes all")
    map_size: int = param(1024, 16, 16384, "maps for the air and for surfaces with holes", unit="texel", rebuild=True)

    def render(self, view: View, content: Sequence[Content]) -> Visibility:
        """Count the volumes of each light into the masks."""
        maps = ShadowMap(size=self.map_size)
        counted = Counter(view, self.method, maps, content)
        masks = mask_image(view)
        for light, stencil, _ in counted.each():
            view.compute("resolve").bind(
                counted.beside,
                volume_count=stencil.stencil(),
                light_index=view.gpu.constant(light),
                masks_out=masks.read_write(),
            ).features(has_maps=bool(counted.beside)).dispatch(*view.size)
        return answered_by_masks(view, content, masks, maps)


class Counter:
    """Counts volumes; for techniques that start from the hard shadow.

    Attributes:
        outlines: of what casts by them.
        beside: what the module of :class:`ShadowMap` needs, for what casts beside all outlines; empty without such.
    """

    def __init__(self, view: View, method: str, maps: ShadowMap, content: Sequence[Content]) -> None:
        self._view, self._method = view, method
        self.outlines = [outline for kind in content if (outline := kind.outline()) is not None]
        self.beside: dict[str, Any] = {}
        if any(kind.casts_beside_outline() for kind in content):
            self.beside = dict(maps.render(view.part(maps, "beside"), content, "beside_outline").bindings)

    def each(self, *, segments: bool = False, sheet: Sheet = "both") -> Iterator[tuple[int, Texture, list[Silhouette]]]:
        """(light, texture whose stencil values are the counts, the light's silhouettes) for each light in turn."""
        view, gpu = self._view, self._view.gpu
        depth = view.images["depth"]
        if not depth.has_stencil:
            raise Unsupported(
                f"{view.technique.name}: this adapter has no stencil beside a 32-bit depth; use shadow_map"
            )
        caps = self._method == "zfail"
        lights = range(len(view.scene.lights))
        found = (
            silhouettes(view, self.outlines, caps=caps, segments=segments, sheet=sheet)
            if self.outlines
            else iter([[]] * len(lights))
        )
        for light, outlines in zip(lights, found, strict=True):
            with gpu.render(
                f"{view.owner}.volumes", depth=(depth.view(), None), depth_read_only=True, stencil=0
            ) as native:
                for silhouette in outlines:
                    self._draw(native, silhouette, caps)
            yield light, depth, outlines

    def _draw(self, native: Any, silhouette: Silhouette, caps: bool) -> None:
        view, gpu = self._view, self._view.gpu
        scope = {
            **view.scope,
            **silhouette.outline.bindings,
            "light_index": gpu.constant(silhouette.light),
            "sides": silhouette.sides.read(),
            "caps": silhouette.caps.read(),
            "first_side": silhouette.first_side,
            "first_cap": silhouette.first_cap,
        }
        key = (silhouette.sides.read().key, silhouette.caps.read().key, caps, self._method)
        label = f"volumes of {silhouette.light} in {silhouette.sides.label}"
        native.execute_bundles([view.keep(label, key, lambda: self._recorded(scope, silhouette, caps))])

    def _recorded(self, scope: Mapping[str, Any], silhouette: Silhouette, caps: bool) -> Any:
        """The draws of a silhouette, which is in the same buffers in each frame."""
        view, gpu = self._view, self._view.gpu
        state = Raster(depth=gpu.depth_format, depth_write=False, stencil=_COUNT[self._method])
        draws = [("side", 0, state)]
        if caps:
            # A cap lies in the surface that casts, which must not shade itself: it is moved behind by a few of the last
            # places, since a triangle that faces away is drawn with its corners in another order.
            draws.append(("near_cap", 16, replace(state, depth_bias=-8, depth_slope_bias=-0.001)))
            if not isinstance(view.scene.lights[silhouette.light], DirectionalLight):
                draws.append(("far_cap", 16, state))
        bundle = gpu.bundle("volumes", state, depth_read_only=True)
        for entry, offset, raster in draws:
            pipeline, group = gpu.raster(MODULE, raster, scope, vertex=entry, fragment=None)
            bundle.set_pipeline(pipeline)
            bundle.set_bind_group(0, group)
            bundle.draw_indirect(silhouette.arguments.native, silhouette.offset + offset)
        return bundle.finish()
