"""Shadow maps (Williams 1978).

The scene's depth is drawn from each light; a point is in shadow where something nearer was drawn:
``V(p) = 1 if z(p) ≥ depth(p) else 0`` in reversed-Z. Directional lights use an orthographic map fitted to the scene's
box, spot lights a perspective one, point and rectangular lights a cube of six around their centre. All maps are layers
of one depth texture.

A surface's own texel would shade it in places ("acne"). Three remedies, each in texels of the map so that they hold
at any resolution and scale: a constant bias and one that grows with the slope, both towards the light, and an offset
along the normal (Holbert 2011). Drawing only back faces (``cull="front"``) is the fourth; it lets light leak under
thin casters. Points in the air get no bias. With ``filtering="linear"`` the four nearest texels' answers are weighted
(Reeves 1987 with the smallest kernel).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from tyndall.content.contract import Casters, Content
from tyndall.gpu.params import param
from tyndall.scene.model import DirectionalLight, Light, PointLight, RectLight, Scene, SpotLight, box_corners
from tyndall.techniques.contract import Technique, View, Visibility

if TYPE_CHECKING:
    from collections.abc import Sequence

_LAYER = "package::techniques::shadow::shadow_map::ShadowLayer"
_MARGIN = 2.0  # texels of the map that stay empty at its border


@dataclass(frozen=True)
class ShadowMap(Technique):
    """One depth map a light."""

    name: ClassVar[str] = "shadow_map"
    paper: ClassVar[str] = "Williams 1978, Casting curved shadows on curved surfaces"
    advice: ClassVar[str] = (
        "The default: hard shadows for any scene and light; edges show texels when the map is too small."
    )

    size: int = param(1024, 16, 16384, "width and height of a map", unit="texel", rebuild=True)
    bias: float = param(0.5, 0, 64, "constant bias towards the light", unit="texel")
    slope_bias: float = param(1.0, 0, 64, "bias towards the light for a slope of 1", unit="texel")
    normal_offset: float = param(0.5, 0, 64, "offset along the normal at grazing light", unit="texel")
    cull: Literal["none", "front", "back"] = param("none", doc="faces left out of the map", rebuild=True)
    filtering: Literal["nearest", "linear"] = param("linear", doc="one texel's answer, or four weighted")

    def render(self, view: View, content: Sequence[Content], casters: Casters = "all") -> Visibility:
        """Draw all maps of what casts."""
        count = sum(layer_count(light) for light in view.scene.lights)
        maps = view.texture(
            "maps", (self.size, self.size, max(1, count)), "depth32float", dimension="2d-array", usage="sampled target"
        )
        table = view.buffer("layers", lambda: self._layer_rows(view), element=_LAYER).read()
        for index in range(count):
            scope = {"shadow_layers": table, "layer": view.gpu.constant(index)}
            with view.gpu.render(view.owner, depth=(maps.view(layer=index), 0.0)) as native:
                for kind in content:
                    kind.draw_depth(native, scope, self.cull, casters)
        return Visibility(
            self.shader(),
            self.shader(),
            {
                "shadow_layers": table,
                "shadow_maps": maps,
                "shadow_sampler": view.gpu.sampler(compare="greater-equal"),
                "shadow_params": view.params,
            },
            maps,
        )

    def _layer_rows(self, view: View) -> NDArray[Any]:
        layers = light_layers(view.scene, self.size)
        rows = np.zeros(max(1, len(layers)), view.gpu.dtype(_LAYER))
        for row, layer in zip(rows, layers, strict=False):
            row["view_proj"], row["inverse"] = layer.matrix.T, np.linalg.inv(layer.matrix).T
            row["texel"], row["perspective"] = layer.texel, layer.perspective
        return rows


@dataclass(frozen=True, eq=False)
class Layer:
    """One map: world to reversed-Z clip space (4×4, column vectors), its texel's width (at 1 m if perspective)."""

    matrix: NDArray[np.float64]
    texel: float
    perspective: bool


def layer_count(light: Light) -> int:
    """Maps that a light needs: six for a point or rectangular light, one for the others."""
    return 6 if isinstance(light, (PointLight, RectLight)) else 1


def first_layers(scene: Scene) -> list[int]:
    """The first map of each light."""
    counts = [layer_count(light) for light in scene.lights]
    return [sum(counts[:i]) for i in range(len(counts))]


def light_layers(scene: Scene, size: int) -> list[Layer]:
    """The maps of all lights, in order, for maps of ``size`` texels."""
    corners = box_corners(*scene.bounds)
    layers: list[Layer] = []
    for light in scene.lights:
        if isinstance(light, DirectionalLight):
            layers.append(_orthographic(np.asarray(light.direction), corners, size))
        elif isinstance(light, SpotLight):
            tangent = math.tan(light.outer_angle) / (1 - 2 * _MARGIN / size)
            layers.append(_perspective(light.position, np.asarray(light.direction), tangent, corners, size))
        else:
            tangent = 1 / (1 - 2 * _MARGIN / size)
            for axis in range(3):
                for sign in (1.0, -1.0):
                    direction = np.zeros(3)
                    direction[axis] = sign
                    layers.append(_perspective(light.position, direction, tangent, corners, size))
    return layers


def _basis(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows right, up, back (-direction) of a right-handed frame."""
    forward = direction / np.linalg.norm(direction)
    helper = np.array([0.0, 1.0, 0.0]) if abs(forward[1]) < 0.99 else np.array([1.0, 0.0, 0.0])
    right = np.cross(forward, helper)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(right, forward), -forward])


def _orthographic(direction: NDArray[np.float64], corners: NDArray[np.float64], size: int) -> Layer:
    rotation = _basis(direction)
    local = corners @ rotation.T
    low, high = local.min(axis=0), local.max(axis=0)
    # One scale for both axes: square texels, so that a bias in texels means the same in both directions.
    extent = max(float((high - low)[:2].max()), 1e-6) / (1 - 2 * _MARGIN / size)
    centre = 0.5 * (low + high)
    depth = max(float(high[2] - low[2]), 1e-6)
    pad = 1e-3 * depth + 2 * extent / size
    near, far = high[2] + pad, low[2] - pad  # along "back": the light is at +z
    matrix = np.eye(4)
    matrix[0, :3], matrix[0, 3] = rotation[0] * 2 / extent, -centre[0] * 2 / extent
    matrix[1, :3], matrix[1, 3] = rotation[1] * 2 / extent, -centre[1] * 2 / extent
    matrix[2, :3], matrix[2, 3] = rotation[2] / (near - far), -far / (near - far)
    return Layer(matrix, extent / size, False)


def _perspective(
    position: Sequence[float], direction: NDArray[np.float64], tangent: float, corners: NDArray[np.float64], size: int
) -> Layer:
    rotation = _basis(direction)
    origin = np.asarray(position, np.float64)
    reach = float(np.linalg.norm(corners - origin, axis=1).max())
    near = 1e-4 * max(reach, 1e-6)
    view = np.eye(4)
    view[:3, :3], view[:3, 3] = rotation, -rotation @ origin
    projection = np.zeros((4, 4))
    projection[0, 0] = projection[1, 1] = 1 / tangent
    projection[2, 3], projection[3, 2] = near, -1.0  # reversed-Z, infinite far
    return Layer(projection @ view, 2 * tangent / size, True)
