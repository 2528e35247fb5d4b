"""Reading files that may be hostile: what a path may name, numbers from text, texels from images."""

from __future__ import annotations

import base64
import binascii
import io
import os
import re
import urllib.parse
import warnings
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.scene.errors import SceneError
from tyndall.scene.model import Image

MAX_TEXELS = 8192 * 8192
"""Largest image that is decoded: WebGPU's default limit of a texture, squared."""

MAX_COORDINATE = 1e18
"""Largest position in metres whose triangles still have a finite area in float32."""

_IMAGES = ("PNG", "JPEG", "WEBP", "BMP", "TGA")

Floats = NDArray[np.float64]


def regular_file(path: Path) -> int:
    """The size of ``path`` in bytes.

    Raises:
        SceneError: there is no such file, or it is a directory, a device or a pipe.
    """
    try:
        if path.is_dir():
            raise SceneError(path, "is a directory, not a file")
        if not path.exists():
            raise SceneError(path, "no such file")
        if not path.is_file():
            raise SceneError(path, "is not a regular file")
        return path.stat().st_size
    except (OSError, ValueError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(path, f"cannot be read: {getattr(error, 'strerror', None) or error}") from error


def map_bytes(path: Path) -> NDArray[np.uint8]:
    """A file's bytes as a read-only memory map; an empty file gives an empty array."""
    if regular_file(path) == 0:
        return np.zeros(0, np.uint8)
    return np.asarray(np.memmap(path, np.uint8, "r"))


def beside(path: Path, reference: str) -> Path:
    """The file that ``reference`` names, relative to the folder of ``path``, which it may not leave.

    Raises:
        ValueError: a URL, an absolute path, or one that climbs out; the message is for the user.
    """
    name = reference.replace("\\", "/")
    if not name or "\0" in name:
        raise ValueError("names no file")
    if re.match(r"[A-Za-z][A-Za-z0-9+.-]*:", name) or name.startswith("/"):
        raise ValueError(f"'{shorten(reference)}' is refused: only files in the folder of the scene are read")
    normal = PurePosixPath(os.path.normpath(name))
    if normal.parts[:1] == ("..",):
        raise ValueError(f"'{shorten(reference)}' is refused: it is outside the folder of the scene")
    return path.parent / normal


def read_uri(path: Path, uri: str) -> NDArray[np.uint8]:
    """The bytes behind a glTF URI: base64 data, or a file beside ``path``.

    Raises:
        ValueError: refused, missing or not base64; the message is for the user.
    """
    if uri.startswith("data:"):
        head, comma, body = uri.partition(",")
        if not comma or not head.endswith(";base64"):
            raise ValueError("a data URI without base64 data")
        try:
            return np.frombuffer(base64.b64decode(body, validate=True), np.uint8)
        except (binascii.Error, ValueError) as error:
            raise ValueError("a data URI that is not base64") from error
    file = beside(path, urllib.parse.unquote(uri))
    try:
        return map_bytes(file)
    except SceneError as error:
        raise ValueError(f"'{shorten(uri)}': {error.mistakes[0]}") from error


def decode_image(data: NDArray[np.uint8], name: str) -> Image:
    """Texels of a PNG, JPEG, WebP, BMP or TGA, its colour profile and orientation ignored as glTF asks.

    Raises:
        ValueError: not an image, damaged, or more than :data:`MAX_TEXELS`; the message is for the user.
    """
    import PIL.Image

    try:
        with warnings.catch_warnings():
            # Its own warning about large images: the size is checked here, before a texel is decoded.
            warnings.simplefilter("ignore", PIL.Image.DecompressionBombWarning)
            picture: PIL.Image.Image = PIL.Image.open(io.BytesIO(data.tobytes()), formats=_IMAGES)
            width, height = picture.size
            if width * height > MAX_TEXELS:
                raise ValueError(f"an image of {width}×{height} texels is larger than {MAX_TEXELS} texels")
            if picture.mode.startswith("I"):
                # 16-bit grey: Pillow's own conversion to 8 bits clips instead of scaling.
                grey = np.asarray(picture).astype(np.int64)
                picture = PIL.Image.fromarray(np.clip((grey + 128) // 257, 0, 255).astype(np.uint8))
            pixels = np.array(picture.convert("RGBA"), np.uint8)
    except PIL.Image.DecompressionBombError as error:
        raise ValueError(f"an image of more than {MAX_TEXELS} texels") from error
    except PIL.UnidentifiedImageError as error:
        raise ValueError("not a PNG, JPEG, WebP, BMP or TGA image") from error
    except (OSError, SyntaxError, EOFError, IndexError, OverflowError) as error:
        raise ValueError(f"a damaged image ({shorten(str(error))})") from error
    pixels.flags.writeable = False
    return Image(pixels, name)


def parse_numbers(text: bytes) -> Floats | None:
    """All the numbers of a text that holds nothing but numbers and white space; None where it holds anything else."""
    if not text.strip():
        return np.zeros(0)
    with warnings.catch_warnings():
        # numpy announces a text that it could not read to its end as a DeprecationWarning.
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text, np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            return None


def first_line(data: bytes, wrong: Callable[[bytes], Any]) -> int:
    """The number, from 1, of the first line for which ``wrong`` is true; 0 where there is none. For messages only."""
    return next((number for number, line in enumerate(data.splitlines(), 1) if wrong(line)), 0)


def check_positions(path: Path, positions: NDArray[Any]) -> None:
    """Refuse what has no finite area.

    Raises:
        SceneError: naming the first vertex, from 0, that is not finite or is beyond :data:`MAX_COORDINATE`.
    """
    with np.errstate(invalid="ignore"):
        bad = ~(np.abs(positions) <= MAX_COORDINATE).all(axis=1)
    if bad.any():
        vertex = int(np.argmax(bad))
        where = ", ".join(f"{float(x):g}" for x in positions[vertex])
        raise SceneError(path, f"vertex {vertex}: ({where}) is not a position")


def usable_normals(normals: NDArray[np.float32], computed: Callable[[], NDArray[np.float32]]) -> NDArray[np.float32]:
    """Unit normals: those of the file unchanged where they are unit, rescaled where not, ``computed`` where none.

    Args:
        normals: (V, 3), of any length, even zero or not finite.
        computed: gives the (V, 3) to take where the file has no direction.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        square = np.einsum("ij,ij->i", normals, normals)
        if ((square > 0.99) & (square < 1.01)).all():
            return normals
        scale = np.abs(normals).max(axis=1, keepdims=True)
        lost = ~((scale > 0) & (scale < np.inf))[:, 0]
        direction = normals.astype(np.float64) / np.where(lost[:, None], 1, scale)
        result = (direction / np.linalg.norm(direction, axis=1, keepdims=True)).astype(np.float32)
    if lost.any():
        result[lost] = computed()[lost]
    return result


def shorten(text: str, length: int = 60) -> str:
    """One printable line of at most ``length`` characters."""
    line = "".join(c if c.isprintable() else "·" for c in text[: length + 1])
    return line if len(line) <= length else line[: length - 1] + "…"
