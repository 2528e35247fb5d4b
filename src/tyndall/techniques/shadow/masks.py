"""Masks: a byte a light and pixel, for techniques whose answer is an image and holds on surfaces only.

The bytes of four lights share a texel, so a mask costs a byte a light. Where the air asks too, it is answered by shadow
maps, which are drawn only then. ``masks.wesl`` is the shader's side: it writes masks and answers from them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tyndall.gpu.resources import Texture
from tyndall.techniques.contract import View, Visibility
from tyndall.techniques.shadow.shadow_map import ShadowMap

SHADER = "package::techniques::shadow::masks"


def mask_image(view: View) -> Texture:
    """The masks of all lights, (width, height, ⌈lights / 4⌉) r32uint; bind as ``masks_out=….read_write()``."""
    layers = max(1, -(-len(view.scene.lights) // 4))
    return view.texture("masks", (*view.size, layers), "r32uint", dimension="2d-array")


def answered_by_masks(view: View, content: Sequence[Any], masks: Texture, maps: ShadowMap) -> Visibility:
    """Surfaces by the masks, the air by ``maps``."""
    return with_air(view, content, SHADER, {"shadow_masks": masks}, maps)


def with_air(
    view: View, content: Sequence[Any], surfaces: str, bindings: Mapping[str, Any], maps: ShadowMap
) -> Visibility:
    """Surfaces by a module of the technique's own, the air by ``maps``, which are drawn where it asks."""
    if not (view.air_wanted or view.maps_wanted):
        return Visibility(maps.shader(), surfaces, bindings)
    drawn = maps.render(view.part(maps), content)
    return Visibility(drawn.module, surfaces, {**bindings, **drawn.bindings}, drawn.maps, drawn.overlay)
