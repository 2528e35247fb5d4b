"""Linear light for a browser, which has no format for it.

The report's pictures can be exposed anew, so they hold light, not bytes: half floats rounded to 7 bits after the point
(0.4 %, which no eye sees at any exposure), as differences: green, red less green, blue less green, each less its left
neighbour, low bytes before high bytes, deflated. That is about 1.6 bytes a pixel, a fifth of an EXR and little more
than an 8-bit PNG. ``report/light.js`` reads it.
"""

from __future__ import annotations

import io
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.lab.picture import OutputError

_DROPPED = 3  # bits of a half float's ten after the point
_LARGEST = 0x7BFF >> _DROPPED

Light = NDArray[np.float32]


def encode_light(radiance: Light) -> bytes:
    """(H, W, 3) linear light, negative values as 0, in the format above."""
    half = np.minimum(np.maximum(radiance, 0), 65504).astype(np.float16).view(np.uint16).astype(np.int32)
    code = np.minimum((half + (1 << (_DROPPED - 1))) >> _DROPPED, _LARGEST)
    planes = np.stack([code[..., 1], code[..., 0] - code[..., 1], code[..., 2] - code[..., 1]])
    steps = np.diff(planes, axis=2, prepend=0)
    folded = ((steps << 1) ^ (steps >> 31)).astype(np.uint16)  # the sign goes to the lowest bit: small steps are small
    both = np.concatenate([(folded & 255).astype(np.uint8).ravel(), (folded >> 8).astype(np.uint8).ravel()])
    return zlib.compress(both.tobytes(), 6)


def read_exr(path: Path) -> dict[str, NDArray[Any]]:
    """The channels of an EXR, each (H, W).

    Raises:
        OutputError: there is no such file, or it is no EXR.
    """
    import OpenEXR

    if not path.is_file():
        raise OutputError(f"{path}: is missing, and results.json names it")
    try:
        channels = OpenEXR.File(str(path), separate_channels=True).channels()
    except (RuntimeError, OSError, ValueError) as error:
        raise OutputError(f"{path}: is no EXR that can be read ({str(error).splitlines()[0]})") from error
    return {name: channel.pixels for name, channel in channels.items()}


def layer(channels: dict[str, NDArray[Any]], name: str, path: Path) -> Light | None:
    """The colour of a layer, (H, W, 3) float32: ``""`` for R, G, B, ``"inscatter"`` for inscatter.R and so on; None
    where the file has no such layer.

    Raises:
        OutputError: a value is not finite.
    """
    names = [f"{name}.{c}" if name else c for c in "RGB"]
    if any(n not in channels for n in names):
        return None
    light = np.stack([channels[n] for n in names], axis=-1).astype(np.float32)
    if not np.isfinite(light).all():
        raise OutputError(f"{path}: {name or 'the picture'} has values that are not finite")
    return light


def read_image(path: Path) -> NDArray[np.uint8]:
    """The pixels of a PNG, (H, W, 3).

    Raises:
        OutputError: there is no such file, or it is no picture.
    """
    from PIL import Image, UnidentifiedImageError

    if not path.is_file():
        raise OutputError(f"{path}: is missing, and results.json names it")
    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("RGB"))
    except (UnidentifiedImageError, OSError, SyntaxError, Image.DecompressionBombError) as error:
        raise OutputError(f"{path}: is no picture that can be read") from error


def encode_image(pixels: NDArray[np.uint8], *, lossless: bool) -> bytes:
    """(H, W, 3) as WebP."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels), "RGB").save(buffer, "webp", lossless=lossless, quality=88, method=4)
    return buffer.getvalue()


def shrink[T: np.generic](image: NDArray[T], factor: int, *, power: int = 1) -> NDArray[T]:
    """(H, W, …) smaller by a whole factor: each pixel the mean of a square; of its squares, for ``power`` 2."""
    if factor == 1:
        return image
    height, width = (n // factor * factor for n in image.shape[:2])
    squares = image[:height, :width].astype(np.float64) ** power
    squares = squares.reshape(height // factor, factor, width // factor, factor, *image.shape[2:]).mean(axis=(1, 3))
    mean = squares ** (1 / power)
    return (np.rint(mean) if np.issubdtype(image.dtype, np.integer) else mean).astype(image.dtype)
