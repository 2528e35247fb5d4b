"""Errors as colours on one scale.

The colour map runs from black over violet, magenta and orange to cream. It is computed, not tabulated: in OKLab
(Ottosson 2020, "A perceptual color space for image processing") lightness rises steadily while the hue turns, chroma is
as much as sRGB can show, up to a limit and without corners, and the curve is then cut into 255 steps of equal length.
Equal ratios of error are hence equally visible steps; and since lightness alone orders the colours, the map reads the
same in grey and to colour-blind eyes.

Errors of techniques differ by factors of a thousand, so the scale is logarithmic, and shared by all maps of a figure.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from tyndall.lab.closeup import nice_ceiling

Map = NDArray[np.float32]

_DECADES = 4
_DARK, _PALE = 0.05, 0.98  # lightness in OKLab
_BLUE, _CREAM = math.radians(265), math.radians(462)  # hue in OKLab, once past red
_CHROMA = 0.18


@dataclass(frozen=True)
class Scale:
    """The logarithmic range that the colours stand for: ``low`` and less is black, ``high`` and more is cream."""

    low: float
    high: float

    @classmethod
    def over(cls, maps: Iterable[Map]) -> Scale:
        """One scale for all maps: up to what all but a thousandth of the worst one's pixels stay below, down to the
        decade of the best one's median; four decades at most."""
        maps = list(maps)
        high = nice_ceiling(max((float(np.quantile(m, 0.999)) for m in maps), default=1.0))
        middles = [float(np.median(m[m > 0])) for m in maps if (m > 0).any()]
        low = 10.0 ** math.floor(math.log10(max(min(middles, default=high), 1e-12)))
        return cls(min(max(low, high * 10.0**-_DECADES), high / 10), high)

    def index(self, error: Map) -> NDArray[np.uint8]:
        """(H, W) colour numbers 0 … 255; ``low·(high/low)^(i/255)`` is the error that number i stands for."""
        position = np.log(np.maximum(error, 1e-30) / self.low) / math.log(self.high / self.low)
        return np.clip(np.rint(255 * position), 0, 255).astype(np.uint8)

    def ticks(self) -> list[tuple[float, float]]:
        """Values to write beside the colours, each with its place 0 … 1: the powers of ten, and the upper end."""
        span = math.log10(self.high / self.low)
        first, last = math.ceil(math.log10(self.low) - 1e-9), math.floor(math.log10(self.high) + 1e-9)
        values = [10.0**power for power in range(first, last + 1)]
        if math.log10(self.high / values[-1]) > 0.2 * span:
            values.append(self.high)
        return [(value, math.log10(value / self.low) / span) for value in values]


@cache
def colour_map() -> NDArray[np.uint8]:
    """The 256 colours, (256, 3) sRGB."""
    t = np.linspace(0, 1, 2048)
    lightness = _DARK + (_PALE - _DARK) * t
    hue = _BLUE + (_CREAM - _BLUE) * t**1.1
    most = 0.95 * _most_chroma(lightness, hue)
    window = np.hanning(615)  # the corners of sRGB would show as bands
    smooth = np.convolve(np.pad(np.minimum(_CHROMA, most), 307, mode="edge"), window / window.sum(), "valid")
    chroma = np.minimum(smooth, most)
    lab = np.stack([lightness, chroma * np.cos(hue), chroma * np.sin(hue)], axis=-1)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(lab, axis=0), axis=1))])
    even = np.linspace(0, length[-1], 256)
    rgb = oklab_to_linear(np.stack([np.interp(even, length, lab[:, i]) for i in range(3)], axis=-1))
    rgb = np.clip(rgb, 0, 1)
    encoded = np.where(rgb <= 0.0031308, 12.92 * rgb, 1.055 * rgb ** (1 / 2.4) - 0.055)
    colours = np.rint(255 * encoded).astype(np.uint8)
    colours.flags.writeable = False
    return colours


def oklab_to_linear(lab: NDArray[np.float64]) -> NDArray[np.float64]:
    """(…, 3) OKLab as linear sRGB (Ottosson 2020); out of gamut where a value is outside 0 … 1."""
    to_lms = np.array(
        [[1, 0.3963377774, 0.2158037573], [1, -0.1055613458, -0.0638541728], [1, -0.0894841775, -1.2914855480]]
    )
    to_rgb = np.array(
        [
            [4.0767416621, -3.3077115913, 0.2309699292],
            [-1.2684380046, 2.6097574011, -0.3413193965],
            [-0.0041960863, -0.7034186147, 1.7076147010],
        ]
    )
    rgb: NDArray[np.float64] = (lab @ to_lms.T) ** 3 @ to_rgb.T
    return rgb


def _most_chroma(lightness: NDArray[np.float64], hue: NDArray[np.float64]) -> NDArray[np.float64]:
    """The largest chroma of each lightness and hue that sRGB can show, by bisection."""
    low, high = np.zeros_like(lightness), np.full_like(lightness, 0.4)
    for _ in range(24):
        middle = (low + high) / 2
        rgb = oklab_to_linear(np.stack([lightness, middle * np.cos(hue), middle * np.sin(hue)], axis=-1))
        inside = ((rgb >= 0) & (rgb <= 1)).all(axis=-1)
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return low


def encode_map(error: Map, scale: Scale) -> bytes:
    """The error as a PNG of 256 colours: seen as it is, and read back to within a 255th of the scale."""
    from PIL import Image

    image = Image.fromarray(scale.index(error), "L")
    image.putpalette(colour_map().tobytes())
    buffer = io.BytesIO()
    image.save(buffer, "png")
    return buffer.getvalue()
