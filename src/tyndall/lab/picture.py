"""A rendered picture, and its files.

A :class:`Picture` keeps three views of one frame: the 8-bit sRGB pixels as a viewer sees them, the linear radiance
before tone mapping, and the depth. ``.png`` holds the first, with text chunks that say how it was made; ``.exr`` holds
the other two: half-float ``R``, ``G``, ``B`` (Rec.709 primaries, linear) and 32-bit ``Z`` in metres along the view
axis, infinite where there is only background. A file is written beside its place and then moved there: an interruption
leaves what was.
"""

from __future__ import annotations

import io
import os
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

HALF_MAX = 65504.0


class OutputError(ValueError):
    """A place that a result cannot be written to. The message is one line and names the path."""


@dataclass(frozen=True, eq=False)
class Picture:
    """One frame.

    Attributes:
        pixels: (H, W, 3) uint8, sRGB, tone mapped.
        radiance: (H, W, 3) float32, linear Rec.709, before tone mapping.
        depth: (H, W) float32, metres along the view axis, inf for background.
        metadata: what made it ("scene", "technique", "adapter", …), written into the files.
    """

    pixels: NDArray[np.uint8] = field(repr=False)
    radiance: NDArray[np.float32] = field(repr=False)
    depth: NDArray[np.float32] = field(repr=False)
    metadata: Mapping[str, str] = field(default_factory=dict)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.pixels.shape[1], self.pixels.shape[0]

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write a ``.png`` or ``.exr``, by the suffix of ``path``; an existing file is replaced whole.

        Raises:
            OutputError: another suffix, a folder that does not exist, or a file that cannot be written.
        """
        path = Path(path)
        writers: dict[str, Callable[[Path], None]] = {".png": self._write_png, ".exr": self._write_exr}
        if path.suffix.lower() not in writers:
            raise OutputError(f"{path}: a picture is saved as .png or .exr, not '{path.suffix}'")
        write_atomically(path, writers[path.suffix.lower()])
        return path

    def _repr_png_(self) -> bytes:
        return encode_png(self.pixels, self.metadata)

    def _write_png(self, path: Path) -> None:
        path.write_bytes(encode_png(self.pixels, self.metadata))

    def _write_exr(self, path: Path) -> None:
        half = np.clip(self.radiance, -HALF_MAX, HALF_MAX).astype(np.float16)
        write_layers(path, {"": half}, self.depth, self.metadata)


def write_layers(
    path: Path,
    layers: Mapping[str, NDArray[np.floating[Any]]],
    depth: NDArray[np.float32],
    metadata: Mapping[str, str] | None = None,
) -> None:
    """Write an EXR with several pictures of one view.

    Args:
        layers: (H, W, 3) of half or single precision each, as they are written: channels ``R``, ``G``, ``B`` for the
            name "", and ``name.R`` … for another.
        depth: (H, W), channel ``Z``.
        metadata: becomes the file's attributes.
    """
    import OpenEXR

    channels = {
        f"{layer}.{name}" if layer else name: np.ascontiguousarray(light[..., i])
        for layer, light in layers.items()
        for i, name in enumerate("RGB")
    }
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    header |= {f"tyndall.{key}": value for key, value in (metadata or {}).items()}
    OpenEXR.File(header, {**channels, "Z": np.ascontiguousarray(depth, np.float32)}).write(str(path))


def encode_png(pixels: NDArray[np.uint8], metadata: Mapping[str, str] | None = None) -> bytes:
    """The PNG file of (H, W, 3) uint8 pixels, with ``metadata`` as text chunks."""
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    info = PngInfo()
    info.add_text("Software", "Tyndall")
    for key, value in (metadata or {}).items():
        info.add_itxt(key, value)
    buffer = io.BytesIO()
    Image.fromarray(pixels, "RGB").save(buffer, "png", pnginfo=info)
    return buffer.getvalue()


def check_folder(folder: Path) -> None:
    """Raises OutputError where a folder of results cannot be made: before any work is done."""
    for path in (folder, *folder.parents):
        if path.is_dir():
            if not os.access(path, os.W_OK):
                raise OutputError(f"{folder}: {path} is not writable")
            return
        if path.exists():
            raise OutputError(f"{folder}: {path} is a file, not a folder")


def write_texts(folder: Path, texts: Mapping[str, str]) -> None:
    """Write text files by name into a folder, which is made.

    Raises:
        OutputError: ``folder`` is a file, or the system refuses.
    """
    check_folder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        write_atomically(folder / name, lambda path, text=text: _write(path, text))  # type: ignore[misc]


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def write_atomically(path: Path, write: Callable[[Path], None]) -> None:
    """Call ``write`` with a temporary path in the same folder and the same suffix, then move that file to ``path``.

    Raises:
        OutputError: the folder does not exist, ``path`` is a folder, or the system refuses; nothing is left then.
    """
    if not path.parent.is_dir():
        raise OutputError(f"{path}: the folder {path.parent} does not exist")
    if path.is_dir():
        raise OutputError(f"{path}: is a folder")
    try:
        handle, name = tempfile.mkstemp(path.suffix, f".{path.stem}-", path.parent)
    except OSError as error:
        raise OutputError(f"{path}: {error.strerror}") from error
    os.close(handle)
    temporary = Path(name)
    try:
        write(temporary)
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, path)
    except OSError as error:
        raise OutputError(f"{path}: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _umask() -> int:
    """The process's file mode mask; mkstemp's files are private, a user's picture is not."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
