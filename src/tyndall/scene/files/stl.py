"""STL, ASCII and binary (3D Systems, "StereoLithography interface specification", 1989).

An STL is a list of separate triangles, so a facet is flat: its normal is that of its plane (the file's own normals are
often wrong and are not read). Corners are welded where both position and normal are the same bits, which saves memory
on the flat faces of a machine part; above a million triangles, a scan, there is little to weld, and it is not tried.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tyndall.scene.errors import SceneError, SceneWarning
from tyndall.scene.files.source import check_positions, first_line, map_bytes, parse_numbers, shorten
from tyndall.scene.model import Instance, Mesh, Scene

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_MOST_WELDED = 1_000_000
_HEADER = 84  # 80 bytes of comment, then the count


def load(path: Path) -> Scene:
    """Read an STL file. See :func:`tyndall.scene.files.load`."""
    data = map_bytes(path)
    if not len(data):
        raise SceneError(path, "is empty")
    corners = _ascii(path, data.tobytes()) if _is_ascii(data) else _binary(path, data)
    flat = corners.reshape(-1, 3)
    check_positions(path, flat)
    if not len(flat):
        raise SceneError(path, "has no triangles")
    return Scene((Instance(flat_mesh(flat.astype(np.float32), path.stem)),), name=path.stem)


def _is_ascii(data: NDArray[np.uint8]) -> bool:
    """Binary files may begin with "solid" too; in those, the count agrees with the size, or the text has zero bytes."""
    if data[:200].tobytes().lstrip()[:5].lower() != b"solid":
        return False
    if len(data) >= _HEADER and len(data) == _HEADER + _FACET.itemsize * int(data[80:84].view("<u4")[0]):
        return False
    return not (data[:1024] == 0).any()


def _binary(path: Path, data: NDArray[np.uint8]) -> NDArray[np.float32]:
    if len(data) < _HEADER:
        raise SceneError(path, f"is not an STL: {len(data)} bytes are too few")
    count, room = int(data[80:84].view("<u4")[0]), (len(data) - _HEADER) // _FACET.itemsize
    if count > room:
        raise SceneError(path, f"is truncated: it says {count} triangles, and has room for {room}")
    corners: NDArray[np.float32] = data[_HEADER : _HEADER + count * _FACET.itemsize].view(_FACET)["corners"]
    return corners


def _ascii(path: Path, data: bytes) -> NDArray[np.float64]:
    text = data.lower()
    end = text.rfind(b"endsolid")
    if end < 0:
        warnings.warn(f"{path}: has no endsolid and may be truncated", SceneWarning, stacklevel=2)
        end = len(text)
    pieces = text[max(text.find(b"facet"), 0) : end].split(b"vertex")[1:]  # the solid's name may hold the word, too
    rows = [piece.split(None, 3)[:3] for piece in pieces]
    numbers = parse_numbers(b" ".join(word for row in rows for word in row))
    if numbers is None or len(numbers) != 3 * len(rows):
        number = first_line(data, _bad_vertex)
        if not number:
            raise SceneError(path, "is not an STL: 'vertex' without 3 numbers")
        wrong = shorten(data.splitlines()[number - 1].strip().decode("utf-8", "replace"))
        raise SceneError(path, f"line {number}: '{wrong}' is not 3 numbers")
    if len(rows) % 3:
        raise SceneError(path, f"is truncated: {len(rows)} corners are not whole triangles")
    return numbers.reshape(-1, 3, 3)


def _bad_vertex(line: bytes) -> bool:
    words = line.lower().split()
    numbers = parse_numbers(b" ".join(words[1:4]))
    return words[:1] == [b"vertex"] and (numbers is None or len(numbers) != 3)


def flat_mesh(corners: NDArray[np.float32], name: str) -> Mesh:
    """Flat triangles of corners (3T, 3), three after three; those without area get the normal +Y."""
    corners = corners + np.float32(0)  # -0.0 becomes 0.0, which is the same place
    a, b, c = (corners[i::3].astype(np.float64) for i in range(3))
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 0, normals / np.where(length > 0, length, 1), (0.0, 1.0, 0.0))
    directions = np.repeat(normals.astype(np.float32) + np.float32(0), 3, axis=0)
    if len(corners) > 3 * _MOST_WELDED:
        return Mesh(corners, np.arange(len(corners), dtype=np.uint32).reshape(-1, 3), directions, name=name)
    rows = np.concatenate([corners, directions], axis=1)
    vertex, indices = _unique_rows(rows)
    return Mesh(rows[vertex, :3], indices.reshape(-1, 3).astype(np.uint32), rows[vertex, 3:], name=name)


def _unique_rows(rows: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where each different row is first, and which of them each row is; by a hash, much faster than ``axis=0``."""
    bits = np.ascontiguousarray(rows).view(np.uint32).astype(np.uint64)
    key = np.zeros(len(rows), np.uint64)
    for column in bits.T:
        key = (key ^ column) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(29)
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    if (bits[first[inverse]] != bits).any():  # two rows with one hash
        _, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return first, inverse.reshape(-1)
