"""PLY: ASCII, binary little and big endian (Turk, "The PLY polygon file format", 1994).

Read are the vertices' positions, normals (nx ny nz) and texture coordinates (s t, u v or texture_u texture_v, counted
from the bottom of the image), and the faces' vertex_indices (or vertex_index); polygons are split into fans. Vertex
colours and other elements are passed over. Where all faces have equally many corners, as in every triangle mesh, the
binary file is read as one structured array; only mixed polygons are walked one by one.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.scene.errors import SceneError
from tyndall.scene.files.polygons import Ints, fans
from tyndall.scene.files.source import (
    Floats,
    check_positions,
    first_line,
    map_bytes,
    parse_numbers,
    shorten,
    usable_normals,
)
from tyndall.scene.model import Instance, Mesh, Scene, vertex_normals

_TYPES = {"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
          "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
          "double": "f8", "float64": "f8"}  # fmt: skip
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_LONGEST_HEADER = 1 << 16
_INDICES = ("vertex_indices", "vertex_index")
_COORDINATES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))


@dataclass(frozen=True)
class _Property:
    """``count`` is the type of a list's length; empty for a single number."""

    name: str
    type: str
    count: str


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: tuple[_Property, ...]

    @property
    def has_lists(self) -> bool:
        return any(p.count for p in self.properties)


def load(path: Path) -> Scene:
    """Read a PLY file. See :func:`tyndall.scene.files.load`."""
    data = map_bytes(path)
    order, elements, start = _header(path, data)
    tables = _ascii(path, data, elements, start) if order == "" else _binary(path, data, elements, start, order)
    vertices, faces = tables.get("vertex"), tables.get("face")
    if vertices is None or not {"x", "y", "z"} <= vertices.keys():
        raise SceneError(path, "has no vertices with x, y and z")
    if faces is None:
        raise SceneError(path, "has no faces; a cloud of points cannot be drawn")
    return Scene((Instance(_mesh(path, vertices, faces["corners"], faces["sizes"])),), name=path.stem)


def _header(path: Path, data: NDArray[np.uint8]) -> tuple[str, list[_Element], int]:
    """The byte order ('' for ASCII), the elements, and where the data begin."""
    head = data[:_LONGEST_HEADER].tobytes()
    if not head:
        raise SceneError(path, "is empty")
    if not re.match(rb"ply\s", head):
        raise SceneError(path, "is not a PLY: it does not begin with 'ply'")
    end = re.search(rb"^end_header[ \t]*(\r\n|\n|\r)", head, re.MULTILINE) or re.search(
        rb"\rend_header[ \t]*(\r)", head
    )
    if end is None:
        raise SceneError(path, "has no end of its header")
    order: str | None = None
    elements: list[_Element] = []
    for number, line in enumerate(head[: end.start()].splitlines()[1:], 2):
        words = line.decode("ascii", "replace").split()
        where = f"line {number}: '{shorten(' '.join(words))}'"
        match words:
            case [] | ["comment" | "obj_info", *_]:
                continue
            case ["format", name, "1.0"] if name in _FORMATS:
                order = _FORMATS[name]
            case ["element", name, count] if count.isascii() and count.isdigit() and len(count) < 16:
                elements.append(_Element(name, int(count), ()))
            case ["property", "list", count, kind, name] if elements and {count, kind} <= _TYPES.keys():
                if _TYPES[count][0] == "f":
                    raise SceneError(path, f"{where}: the length of a list is a whole number")
                elements[-1] = _with(elements[-1], _Property(name, _TYPES[kind], _TYPES[count]))
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1] = _with(elements[-1], _Property(name, _TYPES[kind], ""))
            case _:
                raise SceneError(path, f"{where} is not a statement of a PLY header")
    if order is None:
        raise SceneError(path, "has no format in its header")
    for element in elements:
        names = [p.name for p in element.properties]
        if len(set(names)) != len(names):
            raise SceneError(path, f"element {shorten(element.name)}: a property twice")
    return order, elements, end.end()


def _with(element: _Element, prop: _Property) -> _Element:
    return _Element(element.name, element.count, (*element.properties, prop))


def _check_room(path: Path, element: _Element, smallest: int, left: int) -> None:
    """Refuse a count that the rest of the file cannot hold, before anything is allocated for it."""
    if element.count * smallest > left:
        raise SceneError(
            path,
            f"element {shorten(element.name)}: the header says {element.count}, "
            f"and the {left} bytes that are left hold at most {left // max(smallest, 1)}",
        )


# --- binary -------------------------------------------------------------------------------------------------------


def _binary(
    path: Path, data: NDArray[np.uint8], elements: list[_Element], at: int, order: str
) -> dict[str, dict[str, NDArray[Any]]]:
    tables: dict[str, dict[str, NDArray[Any]]] = {}
    for element in elements:
        if not element.count or not element.properties:
            continue
        smallest = sum(np.dtype(p.count or p.type).itemsize for p in element.properties)
        _check_room(path, element, smallest, len(data) - at)
        if element.has_lists:
            columns, at = _lists(path, data, element, at, order)
        else:
            dtype = np.dtype([(p.name, order + p.type) for p in element.properties])
            rows = data[at : at + element.count * dtype.itemsize].view(dtype)
            columns = {p.name: rows[p.name] for p in element.properties}
            at += element.count * dtype.itemsize
        if element.name in ("vertex", "face") and columns:
            tables[element.name] = columns
    return tables


def _lists(
    path: Path, data: NDArray[np.uint8], element: _Element, at: int, order: str
) -> tuple[dict[str, NDArray[Any]], int]:
    """The list of corners of an element, and where the next element begins: in one go if all rows are alike."""
    lengths = _first_lengths(data, element, at, order)
    fields: list[tuple[Any, ...]] = []
    for p, length in zip(element.properties, lengths, strict=True):
        if p.count:
            fields.append((f"{p.name} length", order + p.count))
        fields.append((p.name, order + p.type, (length,)) if p.count else (p.name, order + p.type))
    if all(length >= 0 for length in lengths):
        dtype = np.dtype(fields)
        end = at + element.count * dtype.itemsize
        if end <= len(data):
            rows = data[at:end].view(dtype)
            names = set(dtype.names or ())
            lists = [(p.name, length) for p, length in zip(element.properties, lengths, strict=True) if p.count]
            if all((rows[f"{name} length"] == length).all() for name, length in lists):
                name = next((name for name in _INDICES if f"{name} length" in names), None)
                if name is None:
                    return {}, end
                corners = rows[name]
                sizes = np.full(element.count, corners.shape[1])
                return {"corners": corners.reshape(-1), "sizes": sizes}, end
    return _walk(path, data, element, at, order)


def _first_lengths(data: NDArray[np.uint8], element: _Element, at: int, order: str) -> list[int]:
    """How long the lists of the first row are (0 for a single number); -1 for those beyond the end of the file."""
    lengths = []
    for p in element.properties:
        length = 0
        if p.count:
            kind = np.dtype(order + p.count)
            if at + kind.itemsize > len(data):
                return [-1] * len(element.properties)
            length = int(data[at : at + kind.itemsize].view(kind)[0])
            at += kind.itemsize
        size = np.dtype(p.type).itemsize * (length if p.count else 1)
        if length < 0 or size > len(data) - at:
            return [-1] * len(element.properties)
        lengths.append(length)
        at += size
    return lengths


def _walk(
    path: Path, data: NDArray[np.uint8], element: _Element, at: int, order: str
) -> tuple[dict[str, NDArray[Any]], int]:
    """The same for lists of different lengths, row by row."""
    raw = data[at:].tobytes()
    letters = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "f4": "f", "f8": "d"}
    steps = [
        (p.name in _INDICES, struct.Struct(order + letters[p.count]) if p.count else None, letters[p.type])
        for p in element.properties
    ]
    sizes: list[int] = []
    corners: list[int] = []
    here = 0
    try:
        for _ in range(element.count):
            for is_corners, count, letter in steps:
                length = 1
                if count is not None:
                    (length,) = count.unpack_from(raw, here)
                    here += count.size
                if length < 0 or length > len(raw) - here:
                    raise struct.error
                if is_corners and count is not None:
                    values = struct.unpack_from(f"{order}{length}{letter}", raw, here)
                    sizes.append(length)
                    corners += values
                here += length * struct.calcsize(order + letter)
        if here > len(raw):
            raise struct.error
    except struct.error as error:
        row = f"row {len(sizes)}" if sizes else "its first row"
        raise SceneError(
            path, f"element {shorten(element.name)}: is truncated, or a count is wrong, at {row}"
        ) from error
    if not sizes:
        return {}, at + here
    return {"corners": np.array(corners), "sizes": np.array(sizes)}, at + here


# --- ascii --------------------------------------------------------------------------------------------------------


def _ascii(
    path: Path, data: NDArray[np.uint8], elements: list[_Element], start: int
) -> dict[str, dict[str, NDArray[Any]]]:
    body = data[start:].tobytes()
    for element in elements:
        _check_room(path, element, 2 * len(element.properties) - 1, len(body))
    numbers = parse_numbers(body)
    if numbers is None:
        lines_before = data[:start].tobytes().count(b"\n")
        number = first_line(body, lambda line: parse_numbers(line) is None)
        text = shorten(body.splitlines()[number - 1].decode("utf-8", "replace"))
        raise SceneError(path, f"line {lines_before + number}: '{text}' is not numbers")
    tables: dict[str, dict[str, NDArray[Any]]] = {}
    at = 0
    for element in elements:
        if not element.count or not element.properties:
            continue
        width = len(element.properties)
        if element.has_lists:
            columns, at = _ascii_lists(path, numbers, element, at)
        else:
            _check_numbers(path, element, len(numbers) - at, element.count * width)
            rows = numbers[at : at + element.count * width].reshape(-1, width)
            columns = {p.name: rows[:, i] for i, p in enumerate(element.properties)}
            at += element.count * width
        if element.name in ("vertex", "face") and columns:
            tables[element.name] = columns
    return tables


def _check_numbers(path: Path, element: _Element, left: int, needed: int) -> None:
    if left < needed:
        raise SceneError(path, f"element {shorten(element.name)}: is truncated: {left} of {needed} numbers are there")


def _ascii_lists(path: Path, numbers: Floats, element: _Element, at: int) -> tuple[dict[str, NDArray[Any]], int]:
    if len(element.properties) == 1 and element.properties[0].name in _INDICES and at < len(numbers):
        width = 1 + int(np.clip(np.nan_to_num(numbers[at]), 0, len(numbers)))
        rows = numbers[at : at + element.count * width]
        if len(rows) == element.count * width and (rows[::width] == width - 1).all():
            corners = rows.reshape(-1, width)[:, 1:]
            return {"corners": corners.reshape(-1), "sizes": np.full(element.count, width - 1)}, at + len(rows)
    sizes: list[int] = []
    pieces: list[Floats] = []
    for row in range(element.count):
        for p in element.properties:
            length = 1
            if p.count:
                value = numbers[at] if at < len(numbers) else -1.0
                if not (0 <= value <= len(numbers) - at - 1 and value == int(value)):
                    raise SceneError(
                        path, f"element {shorten(element.name)}: is truncated, or a count is wrong, at row {row}"
                    )
                length = int(value)
                at += 1
                if p.name in _INDICES:
                    sizes.append(length)
                    pieces.append(numbers[at : at + length])
            at += length
    _check_numbers(path, element, len(numbers), at)
    if not sizes:
        return {}, at
    return {"corners": np.concatenate(pieces), "sizes": np.array(sizes)}, at


# --- mesh ---------------------------------------------------------------------------------------------------------


def _columns(vertices: dict[str, NDArray[Any]], names: tuple[str, ...]) -> NDArray[np.float32] | None:
    if not all(name in vertices for name in names):
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        return np.stack([vertices[name].astype(np.float32) for name in names], axis=1)


def _mesh(path: Path, vertices: dict[str, NDArray[Any]], corners: NDArray[Any], sizes: Ints) -> Mesh:
    positions = _columns(vertices, ("x", "y", "z"))
    assert positions is not None
    check_positions(path, positions)
    if not np.isfinite(corners).all():
        raise SceneError(path, "element face: an index is not a number")
    wrong = (corners < 0) | (corners >= len(positions)) | (corners != corners // 1)
    if wrong.any():
        place = int(np.argmax(wrong))
        face = int(np.searchsorted(np.cumsum(sizes), place, side="right"))
        raise SceneError(path, f"face {face}: index {corners[place]:.12g} is not one of {len(positions)} vertices")
    flat = corners.astype(np.uint32)
    triangles = flat.reshape(-1, 3) if (sizes == 3).all() else flat[fans(sizes)[0]]
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    if not len(triangles):
        raise SceneError(path, "has no triangles")
    normals = _columns(vertices, ("nx", "ny", "nz"))
    if normals is not None:
        normals = usable_normals(normals, lambda: vertex_normals(positions, triangles))
    uvs = next((uv for names in _COORDINATES if (uv := _columns(vertices, names)) is not None), None)
    if uvs is not None:
        uvs = np.where(np.isfinite(uvs), uvs, np.float32(0))
        uvs[:, 1] = 1 - uvs[:, 1]
    return Mesh(positions, triangles, normals, uvs, name=path.stem)
