"""What a frame is made of, as pictures: for a look at a scene, and at what marching it costs.

- ``steps``: how many steps the march through each pixel took, as heat; the legend has the largest.
- ``normals``: x, y and z of the world's as red, green and blue, −1 black and 1 full.
- ``depth``: metres along the view axis on a logarithmic scale, near bright; the legend has both ends.
- ``ids``: a colour for each implicit surface; meshes grey.
- ``albedo``, ``roughness``: of the materials.
- ``slice``: the implicit surfaces' distances in the plane through their middle that faces the camera most, as
  :func:`tyndall.sdf.slices.show_slice` shows them.

They are drawn through the pixels' centres, without any technique's work.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError, nearest
from tyndall.lab.closeup import heat
from tyndall.lab.picture import Picture
from tyndall.lab.stage import adapter_name
from tyndall.scene.model import Implicit, Scene
from tyndall.sdf.marching import Marching
from tyndall.sdf.shape import Shape, union
from tyndall.techniques.shadow import ShadowMap

Pixels = NDArray[np.uint8]
ViewName = Literal["steps", "normals", "depth", "ids", "albedo", "roughness", "slice"]
VIEWS: tuple[ViewName, ...] = get_args(ViewName)

_INK, _PAPER = (235, 235, 235), (18, 18, 20)
_BAR = 96
_GREY = (70, 70, 74)


def render_view(
    scene: Scene,
    name: str,
    size: tuple[int, int],
    *,
    marching: Mapping[str, Any] | None = None,
    adapter: str | Gpu | None = None,
) -> Picture:
    """A view of a scene.

    Args:
        marching: parameters of :class:`~tyndall.sdf.marching.Marching` in place of the scene's.

    Raises:
        GpuError: no such adapter, or a size beyond its limits.
        ParameterError: no such view, or one that the scene has nothing for.
    """
    _check(name, scene)
    gpu = adapter if isinstance(adapter, Gpu) else Gpu(adapter)
    try:
        plain: dict[str, Any] = {"volumetric": "off", "shadow": ShadowMap(size=16), "antialiasing": "none"}
        rays = Marching.of(scene.looks, marching)
        with Renderer(scene, size, gpu=gpu, occlusion="none", marching=rays, **plain) as renderer:
            renderer.draw(casters=False)
            made = {"scene": scene.name, "view": name, "adapter": adapter_name(gpu)}
            return Picture(view(renderer, name), renderer.radiance(), renderer.depth(), made)
    finally:
        if gpu is not adapter:
            gpu.close()


def view(renderer: Renderer, name: str) -> Pixels:
    """A view of a renderer's last frame, (height, width, 3) uint8; a slice has a size of its own.

    Raises:
        ParameterError: no such view, or one that the scene has nothing for.
    """
    _check(name, renderer.scene)
    there = np.isfinite(renderer.depth())
    match name:
        case "steps":
            steps = renderer.surface("steps").astype(np.float32)
            most = max(1.0, float(steps.max()))
            return _legend(heat(steps, most), f"steps, mean {steps.mean():.1f}", "0", f"{most:.0f}")
        case "depth":
            depth = renderer.depth()
            if not there.any():
                return np.zeros((*depth.shape, 3), np.uint8)
            low, high = float(depth[there].min()), float(depth[there].max())
            along = np.log(np.where(there, depth, high) / low) / max(float(np.log(high / low)), 1e-6)
            grey = np.where(there, 255 - 215 * along, 0)
            return _legend(_bytes(np.repeat(grey[..., None], 3, -1)), "depth", f"{low:.3g} m", f"{high:.3g} m", False)
        case "ids":
            ids = renderer.surface("ids")
            return np.where(there[..., None], np.where(ids[..., None] > 0, _colours(ids), _GREY), 0).astype(np.uint8)
        case "normals":
            return _bytes(np.where(there[..., None], 127.5 + 127.5 * renderer.surface("normals"), 0))
        case "albedo":
            return _bytes(255 * np.clip(renderer.surface("albedo"), 0, 1) ** (1 / 2.2))
        case "slice":
            return _slice(renderer.scene, renderer.size[1])
        case _:
            return _bytes(255 * np.repeat(renderer.surface("roughness")[..., None], 3, -1))


def _check(name: str, scene: Scene) -> None:
    if name not in VIEWS:
        raise ParameterError(f"view: no '{name}'{nearest(name, VIEWS)}; there are {', '.join(VIEWS)}")
    if name in ("steps", "ids", "slice") and not scene.implicits:
        raise ParameterError(f"view: {name} needs implicit surfaces, and {scene.name} has none")


def _slice(scene: Scene, height: int) -> Pixels:
    """A picture of its own size, about ``height`` pixels high."""
    shape: Any = union(*(placed(one) for one in scene.implicits))
    axis = int(np.abs(np.subtract(scene.camera.target, scene.camera.position)).argmax())
    low, high = (corner[axis] for corner in shape.box)
    middle = 0.5 * (low + high) if np.isfinite(high - low) else 0.0
    held = {"xyz"[axis]: round(float(middle), 6)}
    return np.asarray(shape.show_slice(**held, pixels=int(np.clip(height, 64, 2048))).pixels)


def placed(one: Implicit) -> Shape:
    """The shape of an implicit surface where it stands in the world."""
    shape: Any = one.shape
    made: Shape = shape.transform(one.transform)
    return made


def _bytes(values: NDArray[Any]) -> Pixels:
    made: Pixels = np.rint(np.clip(values, 0, 255)).astype(np.uint8)
    return made


def _colours(ids: NDArray[np.uint32]) -> NDArray[np.float64]:
    """(…, 3) hues far apart for numbers that follow each other: steps of the golden ratio."""
    hue = ids * 0.6180339887 % 1.0
    wave = np.abs((hue[..., None] * 6 - np.array([3, 2, 4])) % 6 - np.array([3, 3, 3]))
    light = 0.55 + 0.45 * (ids * 0.7548776662 % 1.0)
    return np.asarray(255 * (0.25 + 0.75 * np.clip(wave - 0.5, 0, 1)) * light[..., None])


def _legend(pixels: Pixels, title: str, low: str, high: str, is_heat: bool = True) -> Pixels:
    """The picture with a bar of its scale in the lower left corner, where there is room for one."""
    from PIL import Image, ImageDraw, ImageFont

    height, width = pixels.shape[:2]
    if width < 2 * _BAR or height < 60:
        return pixels
    canvas = Image.fromarray(pixels)
    draw = ImageDraw.Draw(canvas)
    font = ImageFont.load_default(11)
    ramp = np.linspace(0, 1, _BAR, dtype=np.float32)[None].repeat(8, axis=0)
    bar = heat(ramp, 1.0) if is_heat else _bytes(np.repeat((255 - 215 * ramp)[..., None], 3, -1))
    left, top = 8, height - 38
    draw.rectangle((left - 4, top - 4, left + _BAR + 4, height - 4), fill=_PAPER)
    draw.text((left, top), title, _INK, font, anchor="lt")
    canvas.paste(Image.fromarray(bar), (left, top + 13))
    draw.text((left, height - 7), low, _INK, font, anchor="ls")
    draw.text((left + _BAR, height - 7), high, _INK, font, anchor="rs")
    return np.asarray(canvas)
