"""Depth maps of a scene's lights: what every technique that is built on shadow maps draws, and how it asks them.

Directional lights use an orthographic map fitted to the scene's box, spot lights a perspective one, point lights a cube
of six. All maps are layers of one depth texture (reversed-Z, 0 where nothing was drawn), a light's own one after
another; the finer maps of all directional lights come after them.

**Finer maps** (``cascades``; Zhang 2006, Engel 2006). One map over a large scene has too few texels near the camera.
The view's depth is cut into slices, and a finer map covers the bounding sphere of each. The scene's own map is the last
of them, and serves everything that no finer one covers: places beyond the slices, beside the picture, and behind the
camera. A place is looked up in the first map that shows it, and close to that map's border the next one takes over
smoothly. Cuts blend logarithmic with even ones (Zhang 2006) between a hundredth of the scene's size and all of it.

So that edges do not crawl as the camera moves, a sphere's size depends on the camera's field of view alone, not on
where the camera is or looks; and its map moves by whole texels (Valient 2007). Its depth reaches over the whole scene,
so what casts a shadow into the slice need not be inside it.

**Bias.** A surface's own texel would shade it in places ("acne"). Three remedies, each in texels of the map so that
they hold at any resolution and scale: a constant bias and one that grows with the slope, both towards the light, and an
offset along the normal (Holbert 2011). Drawing only back faces (``cull="front"``) is the fourth; it lets light leak
under thin casters. Points in the air get no bias.

**Rasterizer.** Maps are drawn by the hardware's rasteriser, one pass a map, or by compute passes for all maps at once
(:mod:`tyndall.content.rasterize`), which is faster on GPUs that mostly compute. Both give the same map, up to 1/256
texel. ``rasterizer="compute"`` leaves maps to the hardware where they must be a texture, since a volumetric technique
walks through them, and where something that casts is not made of solid triangles, as materials with holes are.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from tyndall.content.contract import Casters, Content
from tyndall.content.rasterize import DepthStack, Triangles, rasterize
from tyndall.gpu.params import param
from tyndall.scene.model import Camera, DirectionalLight, Light, PointLight, RectLight, Scene, SpotLight, box_corners
from tyndall.techniques.contract import Technique, View, Visibility

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tyndall.gpu.resources import Bound, Buffer

_LAYER = "package::techniques::shadow::depth_maps::ShadowLayer"
IN_WORDS = {"package::techniques::shadow::map_reads": "package::techniques::shadow::map_words"}
_MARGIN = 2  # texels at a map's border that show more than what it must cover
_NEAREST_CUT = 0.01  # of the scene's size: nothing is looked at from closer, so no slice begins there


@dataclass(frozen=True)
class DepthMaps(Technique):
    """Abstract: the parameters of depth maps, and their drawing."""

    size: int = param(1024, 16, 16384, "width and height of a map", unit="texel", rebuild=True)
    bias: float = param(0.5, 0, 64, "constant bias towards the light", unit="texel")
    slope_bias: float = param(1.0, 0, 64, "bias towards the light for a slope of 1", unit="texel")
    normal_offset: float = param(0.5, 0, 64, "offset along the normal at grazing light", unit="texel")
    cull: Literal["none", "front", "back"] = param("none", doc="faces left out of the map", rebuild=True)
    cascades: int = param(0, 0, 4, "finer maps of each directional light, for slices of the view", rebuild=True)
    cascade_split: float = param(0.7, 0, 1, "cuts of the view: 0 even, 1 logarithmic")
    rasterizer: Literal["hardware", "compute"] = param("hardware", doc="what draws solid triangles", rebuild=True)

    @property
    def margin(self) -> int:
        """Texels at a map's border beyond what it must cover, for filters that look around a place."""
        return _MARGIN

    def draw(self, view: View, content: Sequence[Content], casters: Casters) -> Visibility:
        """Draw all maps of what casts."""
        first_finer = sum(layer_count(light) for light in view.scene.lights)
        count = self.map_count(view.scene)
        table = view.fitted("layers", lambda: self._rows(view, max(1, count)), element=_LAYER)
        if count > first_finer:
            self._move_finer(view, table, first_finer)
        shared = {"shadow_layers": table.read(), "shadow_params": view.params}
        triangles = self._triangles(view, content, casters)
        if triangles is not None:
            words = self._draw_words(view, triangles, table.read(), count)
            return Visibility(self.shader(), self.shader(), {**shared, **words}, overlay=IN_WORDS)
        size = (self.size, self.size, max(1, count))
        maps = view.texture("maps", size, "depth32float", dimension="2d-array", usage="sampled target")
        for index in range(count):
            scope = {"shadow_layers": table.read(), "layer": view.gpu.constant(index)}
            for kind in content:
                kind.prepare("depth", scope, (self.size, self.size), view.owner)
            with view.gpu.render(view.owner, depth=(maps.view(layer=index), 0.0)) as native:
                for kind in content:
                    kind.draw_depth(native, scope, self.cull, casters)
        texture = {"shadow_maps": maps.sampled(), "shadow_sampler": view.gpu.sampler(compare="greater-equal")}
        return Visibility(self.shader(), self.shader(), {**shared, **texture}, maps)

    def map_count(self, scene: Scene) -> int:
        """Maps of all lights, the finer ones among them."""
        finer = self.cascades * sum(isinstance(light, DirectionalLight) for light in scene.lights)
        return sum(layer_count(light) for light in scene.lights) + finer

    def _triangles(self, view: View, content: Sequence[Content], casters: Casters) -> list[Triangles] | None:
        """What compute passes draw; None where the hardware is to draw all."""
        if self.rasterizer == "hardware" or view.maps_wanted or casters != "all":
            return None
        if any(kind.casts_beside_outline() for kind in content):
            return None
        return [triangles for kind in content if (triangles := kind.triangles()) is not None]

    def _draw_words(self, view: View, triangles: Sequence[Triangles], layers: Bound, count: int) -> dict[str, Any]:
        def buffer(label: str, size: int, element: str = "u32", usage: str = "storage") -> Buffer:
            return view.buffer(label, lambda: size, element=element, usage=usage)

        words = buffer("maps", DepthStack.bytes_of(self.size, max(1, count)))
        stack = DepthStack(self.size, count, words)
        rasterize(view.gpu, view.owner, triangles, layers, stack, self.cull, buffer)
        return {"shadow_words": words.split("u32"), "shadow_stride": view.gpu.constant(stack.stride)}

    def _rows(self, view: View, count: int) -> NDArray[Any]:
        scene = view.scene
        layers = light_layers(scene, self.size, self.margin)
        rows = np.zeros(count, view.gpu.dtype(_LAYER))
        _fill(rows, layers, self.margin)
        finer = len(layers)
        for light, first in zip(scene.lights, first_layers(scene), strict=True):
            if isinstance(light, DirectionalLight):
                rows["finer"][first], rows["finer_count"][first] = finer, self.cascades
                finer += self.cascades
        return rows

    def _move_finer(self, view: View, table: Buffer, first: int) -> None:
        """Bring the finer maps to where the camera looks now."""
        aspect = view.size[0] / view.size[1]
        layers = finer_layers(
            view.scene, view.camera, aspect, self.size, self.margin, self.cascades, self.cascade_split
        )
        rows = np.zeros(len(layers), table.dtype)
        _fill(rows, layers, self.margin)
        view.gpu.write(table, rows, first * table.dtype.itemsize)


@dataclass(frozen=True, eq=False)
class Layer:
    """One map.

    Attributes:
        matrix: world to reversed-Z clip space (4×4, column vectors).
        texel: a texel's width in metres; at 1 m from the light for a perspective map.
        perspective: whether rays meet in the light.
        near: distance of the near plane; 0 for an orthographic map.
        reach: metres of depth between the ends of an orthographic map; from the light to the scene's farthest corner
            for a perspective one.
        clearance: metres from the light to the scene's box, where no caster is; 0 for an orthographic map.
    """

    matrix: NDArray[np.float64]
    texel: float
    perspective: bool
    near: float
    reach: float
    clearance: float


def _fill(rows: NDArray[Any], layers: Sequence[Layer], margin: int) -> None:
    for row, layer in zip(rows, layers, strict=False):
        row["view_proj"], row["inverse"] = layer.matrix.T, np.linalg.inv(layer.matrix).T
        row["texel"], row["perspective"], row["margin"] = layer.texel, layer.perspective, margin
        row["near"], row["reach"], row["clearance"] = layer.near, layer.reach, layer.clearance


def layer_count(light: Light) -> int:
    """Maps of a light's own: six for a point or rectangular light, one for the others."""
    return 6 if isinstance(light, (PointLight, RectLight)) else 1


def first_layers(scene: Scene) -> list[int]:
    """The first map of each light."""
    counts = [layer_count(light) for light in scene.lights]
    return [sum(counts[:i]) for i in range(len(counts))]


def light_layers(scene: Scene, size: int, margin: int = _MARGIN) -> list[Layer]:
    """The maps of all lights, in order, of ``size`` texels with ``margin`` of them to spare at each side."""
    corners = box_corners(*scene.bounds)
    layers: list[Layer] = []
    for light in scene.lights:
        if isinstance(light, DirectionalLight):
            layers.append(_orthographic(_basis(np.asarray(light.direction)), corners, size, margin))
        elif isinstance(light, SpotLight):
            tangent = math.tan(light.outer_angle) / (1 - 2 * margin / size)
            layers.append(_perspective(light.position, np.asarray(light.direction), tangent, corners, size))
        else:
            tangent = 1 / (1 - 2 * margin / size)
            for axis in range(3):
                for sign in (1.0, -1.0):
                    direction = np.zeros(3)
                    direction[axis] = sign
                    layers.append(_perspective(light.position, direction, tangent, corners, size))
    return layers


def finer_layers(
    scene: Scene, camera: Camera, aspect: float, size: int, margin: int, count: int, split: float
) -> list[Layer]:
    """The finer maps of all directional lights: ``count`` for each, nearest slice first."""
    corners = box_corners(*scene.bounds)
    spheres = slice_spheres(camera, aspect, cuts(float(np.linalg.norm(corners[7] - corners[0])), count, split))
    layers: list[Layer] = []
    for light in scene.lights:
        if isinstance(light, DirectionalLight):
            rotation = _basis(np.asarray(light.direction))
            layers += [_orthographic(rotation, corners, size, margin, sphere) for sphere in spheres]
    return layers


def cuts(diagonal: float, count: int, split: float) -> list[float]:
    """View depths in metres at which ``count`` slices end, of a scene that is ``diagonal`` metres long.

    They depend on nothing that moves.
    """
    near = _NEAREST_CUT * diagonal
    parts = [(i + 1) / (count + 1) for i in range(count)]
    return [
        split * near * (diagonal / near) ** part + (1 - split) * (near + (diagonal - near) * part) for part in parts
    ]


def slice_spheres(camera: Camera, aspect: float, ends: Sequence[float]) -> list[tuple[NDArray[np.float64], float]]:
    """(centre, radius) of the least spheres around the view's slices between 0 and each end, in metres.

    A sphere through a slice's corners has its centre on the view's axis; from a wide view's far corners alone.
    """
    position = np.asarray(camera.position)
    forward = np.subtract(camera.target, position)
    forward /= np.linalg.norm(forward)
    tangent2 = math.tan(camera.fov / 2) ** 2 * (1 + aspect**2)  # of half the view's diagonal, squared
    spheres = []
    for begin, end in itertools.pairwise((0.0, *ends)):
        depth = min(0.5 * (begin + end) * (1 + tangent2), end)
        spheres.append((position + depth * forward, math.sqrt((end - depth) ** 2 + tangent2 * end**2)))
    return spheres


def _basis(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows right, up, back (-direction) of a right-handed frame."""
    forward = direction / np.linalg.norm(direction)
    helper = np.array([0.0, 1.0, 0.0]) if abs(forward[1]) < 0.99 else np.array([1.0, 0.0, 0.0])
    right = np.cross(forward, helper)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(right, forward), -forward])


def _orthographic(
    rotation: NDArray[np.float64],
    corners: NDArray[np.float64],
    size: int,
    margin: int,
    sphere: tuple[NDArray[np.float64], float] | None = None,
) -> Layer:
    """A map of the scene's box, or of a sphere in it, whose place is then rounded to whole texels."""
    local = corners @ rotation.T
    low, high = local.min(axis=0), local.max(axis=0)
    # One scale for both axes: square texels, so that a bias in texels means the same in both directions.
    inner = 1 - 2 * margin / size
    whole = max(float((high - low)[:2].max()), 1e-6) / inner
    extent, centre = whole, 0.5 * (low + high)
    if sphere is not None:
        # One texel more, since rounding moves the map by up to half of one. No coarser than the scene's own map.
        extent = min(2 * sphere[1] / (inner - 1 / size), whole)
        texel = extent / size
        centre = np.round(rotation @ sphere[0] / texel) * texel
    depth = max(float(high[2] - low[2]), 1e-6)
    pad = 1e-3 * depth + 2 * whole / size
    near, far = high[2] + pad, low[2] - pad  # along "back": the light is at +z
    matrix = np.eye(4)
    matrix[0, :3], matrix[0, 3] = rotation[0] * 2 / extent, -centre[0] * 2 / extent
    matrix[1, :3], matrix[1, 3] = rotation[1] * 2 / extent, -centre[1] * 2 / extent
    matrix[2, :3], matrix[2, 3] = rotation[2] / (near - far), -far / (near - far)
    return Layer(matrix, extent / size, False, 0.0, near - far, 0.0)


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
    outside = np.maximum(0, np.maximum(corners[0] - origin, origin - corners[7]))
    return Layer(projection @ view, 2 * tangent / size, True, near, reach, float(np.linalg.norm(outside)))
