"""Pictures of a shape's values in a plane, for notebooks and for understanding (row 5.11 of the systems compared).

>>> from tyndall.sdf import box, sphere
>>> picture = (sphere(1) - box(1)).show_slice(z=0.2)
>>> picture.size, round(picture.least, 1)
((440, 450), -0.2)

:func:`show_slice` shows what is outside in orange and what is inside in blue, darker farther away, with a thin line at
every 1, 2 or 5 × 10ⁿ metres and a thick white one in black, the contour, where the value is 0.
:func:`show_gradient` shows how fast the value changes with the place, in all three directions: white where it is 1, as
of a true distance, blue where less (sphere tracing takes shorter steps than it could) and red where more (it would step
through the surface if it did not know of the declared Lipschitz bound). Blue and orange or red differ for every kind of
colour vision.

A :class:`Slice` shows itself in a notebook, and has ``save(path)``. One coordinate is held: ``z=0`` unless told
otherwise; ``y=…`` is seen from above (-Y is away from the eye, Z down) and ``x=…`` from +X (Z leftwards). The legend
has the colours, the coordinates are at the edges.
"""

from __future__ import annotations

import io
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.params import ParameterError
from tyndall.sdf.meshing import evaluate, gradient
from tyndall.sdf.shape import Floats, Shape

if TYPE_CHECKING:
    from PIL.Image import Image

_LEFT, _TOP, _RIGHT, _BOTTOM = 50, 28, 30, 62  # margins around the field, for pictures of 360 pixels
_INK = (36, 41, 47)
# From the value 0 outwards, linear in between, sRGB.
_OUTSIDE = np.array([(255, 240, 214), (253, 184, 99), (224, 130, 20), (127, 59, 8)], np.float64)
_INSIDE = np.array([(222, 235, 247), (120, 174, 214), (33, 113, 181), (8, 48, 107)], np.float64)
_ABOVE = np.array([(255, 255, 255), (253, 174, 107), (217, 72, 1), (103, 0, 13)], np.float64)
_BELOW = np.array([(255, 255, 255), (158, 202, 225), (49, 130, 189), (8, 48, 107)], np.float64)


@dataclass(frozen=True, eq=False)
class Slice:
    """A picture of a field in a plane.

    Attributes:
        pixels: (H, W, 3) uint8, with its legend.
        values: (N, N) what is shown, the first row at the top: metres, or metres per metre.
        least, greatest: of the values.
    """

    pixels: NDArray[np.uint8]
    values: Floats

    @property
    def least(self) -> float:
        return float(self.values.min())

    @property
    def greatest(self) -> float:
        return float(self.values.max())

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.pixels.shape[1], self.pixels.shape[0]

    @property
    def image(self) -> Image:
        """As Pillow has it."""
        from PIL import Image

        return Image.fromarray(self.pixels)

    def save(self, path: str | Path) -> None:
        """To a file of a kind that Pillow knows by its ending."""
        self.image.save(path)

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        self.image.save(stream, "PNG")
        return stream.getvalue()


def show_slice(
    shape: Shape,
    *,
    x: float | None = None,
    y: float | None = None,
    z: float | None = None,
    size: float | None = None,
    pixels: int = 360,
) -> Slice:
    """The values in a plane; see the module.

    Args:
        shape: solid, or flat: then in its own plane.
        x, y, z: the coordinate that is held, at most one of them, in metres.
        size: side of the square shown, in metres; None: 1.5 times the longest side of the shape there.
        pixels: of that square's side, 64 … 2,048.

    Raises:
        ParameterError: several coordinates held, or a number out of range.
    """
    plane = _Plane.of(shape, (x, y, z), size, pixels)
    values = evaluate(shape, plane.places).reshape(pixels, pixels)
    most = float(np.abs(values).max())
    step = _nice(most / 12)
    steps = step * max(1, math.ceil(most / step - 1e-9))
    colours = _diverging(values / steps, _INSIDE, _OUTSIDE)
    # A line's width is told in pixels by how much the value changes over one.
    slope = np.maximum(np.hypot(*np.gradient(values)), 1e-12)
    apart = np.abs(values / step - np.round(values / step)) * step / slope
    colours *= 1 - 0.3 * _line(apart, 0.9)[..., None]
    edge = np.abs(values) / slope
    for width, colour in ((3.4, _INK), (1.6, (255, 255, 255))):
        part = _line(edge, width)[..., None]
        colours = colours * (1 - part) + np.array(colour) * part
    title = f"distance at {plane.held}, metres"
    return Slice(plane.draw(colours, title, _scale(-steps, steps, _INSIDE, _OUTSIDE, 0.0), _nice(steps / 4)), values)


def show_gradient(
    shape: Shape,
    *,
    x: float | None = None,
    y: float | None = None,
    z: float | None = None,
    size: float | None = None,
    pixels: int = 360,
) -> Slice:
    """How fast the values change, in metres per metre; see the module and :func:`show_slice`."""
    plane = _Plane.of(shape, (x, y, z), size, pixels)
    slope = gradient(shape, plane.places, 1e-6 * plane.side)  # so near that few straddle an edge of the field
    values = np.linalg.norm(slope, axis=1).reshape(pixels, pixels)
    top = max(2.0, math.ceil(max(shape.lipschitz, float(values.max())) - 1e-6))
    where = np.where(values > 1, (values - 1) / (top - 1), values - 1)
    colours = _diverging(where, _BELOW, _ABOVE)
    level = evaluate(shape, plane.places).reshape(pixels, pixels)
    edge = np.abs(level) / np.maximum(np.hypot(*np.gradient(level)), 1e-12)
    part = _line(edge, 1.4)[..., None]
    colours = colours * (1 - part) + np.array(_INK) * part
    title = f"gradient at {plane.held}: up to {values.max():.3g}, declared {shape.lipschitz:.3g}"
    return Slice(plane.draw(colours, title, _scale(0.0, top, _BELOW, _ABOVE, 1.0), _nice(top / 6)), values)


@dataclass(frozen=True)
class _Plane:
    """A square of the plane in which one coordinate is held: its middle, and its axes across and up the picture."""

    held: str
    middle: Floats
    across: Floats
    up: Floats
    side: float
    pixels: int

    @classmethod
    def of(cls, shape: Shape, held: tuple[float | None, ...], size: float | None, pixels: int) -> _Plane:
        given = [axis for axis in range(3) if held[axis] is not None]
        if len(given) > 1:
            raise ParameterError(f"{'xyz'[given[1]]}: one coordinate is held, and {'xyz'[given[0]]} is already")
        axis = given[0] if given else 2
        at = float(held[axis] or 0.0)
        if shape.dimension == 2 and axis != 2:
            raise ParameterError(f"{'xyz'[axis]}: a flat shape lies in the plane of x and y")
        if not math.isfinite(at):
            raise ParameterError(f"{'xyz'[axis]}: {at} is not a finite number")
        if not 64 <= pixels <= 2048:
            raise ParameterError(f"pixels: {pixels} is outside 64 … 2,048")
        unit = np.eye(3)
        across, up = ((-unit[2], unit[1]), (unit[0], -unit[2]), (unit[0], unit[1]))[axis]
        low, high = shape.box
        kept = [other for other in range(3) if other != axis]
        middle, side = np.zeros(3), 4.0
        if np.isfinite(low[kept]).all() and np.isfinite(high[kept]).all() and (low[kept] < high[kept]).any():
            middle[kept] = (low[kept] + high[kept]) / 2
            side = 1.5 * float((high - low)[kept].max())
        if size is not None and not 0 < size < math.inf:
            raise ParameterError(f"size: {size} is not above 0 m")
        middle[axis] = at
        return cls(f"{'xyz'[axis]} = {at:g}", middle, across, up, side if size is None else float(size), pixels)

    @property
    def places(self) -> Floats:
        """(pixels², 3), row by row from the top."""
        offset = ((np.arange(self.pixels) + 0.5) / self.pixels - 0.5) * self.side
        grid = self.middle + offset[:, None] * self.across - offset[:, None, None] * self.up
        return grid.reshape(-1, 3)

    def draw(self, field: Floats, title: str, scale: tuple[float, float, Floats], step: float) -> NDArray[np.uint8]:
        """The field with coordinates at its edges, and below it the scale of colours with a number at every step."""
        from PIL import Image, ImageDraw, ImageFont

        n = self.pixels
        page = Image.new("RGB", (_LEFT + n + _RIGHT, _TOP + n + _BOTTOM), "white")
        font: Any = ImageFont.load_default(12)
        pen = ImageDraw.Draw(page)
        page.paste(Image.fromarray(np.clip(np.round(field), 0, 255).astype(np.uint8)), (_LEFT, _TOP))
        pen.rectangle((_LEFT - 1, _TOP - 1, _LEFT + n, _TOP + n), outline=_INK)
        pen.text((_LEFT, _TOP - 6), title, _INK, font, "ls")
        gap = _nice(self.side / 5)
        for axis, horizontal in ((self.across, True), (self.up, False)):
            where, sign = int(np.abs(axis).argmax()), float(axis.sum())
            least, most = sorted(sign * float(self.middle @ axis) + np.array([-0.5, 0.5]) * self.side)
            name = "xyz"[where]
            for tick in np.arange(math.ceil(least / gap), math.floor(most / gap) + 1) * gap:
                part = ((tick - float(self.middle[where])) * sign / self.side + 0.5) * n
                if horizontal:
                    pen.line((_LEFT + part, _TOP + n, _LEFT + part, _TOP + n + 4), _INK)
                    pen.text((_LEFT + part, _TOP + n + 6), f"{tick:g}", _INK, font, "ma")
                else:
                    pen.line((_LEFT - 5, _TOP + n - part, _LEFT - 1, _TOP + n - part), _INK)
                    pen.text((_LEFT - 8, _TOP + n - part), f"{tick:g}", _INK, font, "rm")
            at = (_LEFT + n + 8, _TOP + n + 6) if horizontal else (14, _TOP - 4)
            pen.text(at, name, _INK, font, "la" if horizontal else "ms")
        low, high, colours = scale
        top = _TOP + n + 28
        bar = np.repeat(_resampled(colours, n)[None], 10, axis=0)
        page.paste(Image.fromarray(np.round(bar).astype(np.uint8)), (_LEFT, top))
        pen.rectangle((_LEFT - 1, top - 1, _LEFT + n, top + 10), outline=_INK)
        for number in np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1) * step:
            part = (number - low) / (high - low) * n
            pen.line((_LEFT + part, top + 10, _LEFT + part, top + 13), _INK)
            pen.text((_LEFT + part, top + 15), f"{number:g}", _INK, font, "ma")
        return np.array(page)


def _diverging(where: Floats, below: Floats, above: Floats) -> Floats:
    """(…, 3) colours of numbers from -1 to 1."""
    return np.where((where < 0)[..., None], _ramp(below, -where), _ramp(above, where))


def _ramp(colours: Floats, where: Floats) -> Floats:
    along = np.clip(where, 0, 1) * (len(colours) - 1)
    return np.stack([np.interp(along, np.arange(len(colours)), channel) for channel in colours.T], axis=-1)


def _scale(low: float, high: float, below: Floats, above: Floats, zero: float) -> tuple[float, float, Floats]:
    values = np.linspace(low, high, 512)
    where = np.where(values < zero, (values - zero) / max(zero - low, 1e-30), (values - zero) / (high - zero))
    return low, high, _diverging(where, below, above)


def _resampled(colours: Floats, count: int) -> Floats:
    return colours[np.arange(count) * len(colours) // count]


def _line(apart: Floats, width: float) -> Floats:
    """How much of a pixel a line covers whose middle is so many pixels away."""
    return np.asarray(np.clip(width / 2 + 0.5 - apart, 0, 1))


def _nice(step: float) -> float:
    """The least of 1, 2, 5 × 10ⁿ that is not below a step."""
    if not step > 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(step))
    return next(factor * power for factor in (1, 2, 5, 10) if factor * power >= step * (1 - 1e-9))
