"""Wavefront OBJ with its MTL.

Format: Alias|Wavefront, "Advanced Visualizer manual", appendix B1 (1993); the physically based additions to MTL
(Pr, Pm, norm) are those of Exocortex. Read are v, vt, vn, f, usemtl and mtllib; there is one mesh for each material.
Polygons are split into fans, which is exact for convex ones. Where a corner has no normal it gets the area-weighted
mean over all faces around its position, across materials and texture seams; smoothing groups are not read.

MTL: Kd and map_Kd are the base colour (Kd linear), Ke and map_Ke the emission, d or Tr the alpha (below 0.5 invisible),
Pr the roughness and Pm the metalness; without Pr, the Blinn–Phong exponent Ns gives α² = 2/(Ns+2) (Walter et al. 2007),
roughness = √α. A missing MTL or texture is a :class:`~tyndall.scene.errors.SceneWarning`.

The text is not parsed line by line: lines are sorted by keyword, and numpy reads all numbers of a keyword in one go.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.params import ParameterError
from tyndall.scene.errors import SceneError, SceneWarning
from tyndall.scene.files.polygons import Ints, fans
from tyndall.scene.files.source import (
    Floats,
    beside,
    check_positions,
    decode_image,
    first_line,
    map_bytes,
    parse_numbers,
    shorten,
    usable_normals,
)
from tyndall.scene.model import Instance, Material, Mesh, Scene, Texture, vertex_normals


def load(path: Path) -> Scene:
    """Read an OBJ file. See :func:`tyndall.scene.files.load`."""
    data = path.read_bytes()
    if not data.strip():
        raise SceneError(path, "is empty")
    lines = _sort(data)
    if not lines.faces:
        raise SceneError(path, "has no faces")
    positions = _vectors(path, data, b"v", lines.v, 3)
    uvs = _vectors(path, data, b"vt", lines.vt, 2)
    normals = _vectors(path, data, b"vn", lines.vn, 3)
    check_positions(path, positions)
    corners, sizes = _corners(path, data, lines, (len(positions), len(uvs), len(normals)))
    places, face = fans(sizes)
    triangles = corners[places]
    a, b, c = (triangles[:, i, 0] for i in range(3))
    proper = (a != b) & (b != c) & (c != a)
    triangles, face = triangles[proper], face[proper]
    if not len(triangles):
        raise SceneError(path, "has no triangles: every face has a corner twice")

    numbers = {name: number for number, name in enumerate(dict.fromkeys(lines.materials))}
    run = np.searchsorted(lines.material_starts, face, side="right") - 1
    material_of = np.array([numbers[name] for name in lines.materials])[run]
    by_material = np.argsort(material_of, kind="stable")
    ends = np.cumsum(np.bincount(material_of, minlength=len(numbers)))[:-1]
    materials = _materials(path, lines.libraries)
    surface = _Surface(positions, uvs, normals, triangles)
    instances = []
    for name, part in zip(numbers, np.split(by_material, ends), strict=True):
        if not len(part):
            continue
        if name and name not in materials:
            _warn(path, f"material '{shorten(name)}' is defined nowhere; a grey one is taken")
        mesh = surface.mesh(triangles[part], materials.get(name, Material(name=name)), name)
        instances.append(Instance(mesh, name=name))
    return Scene(tuple(instances), name=path.stem)


def _warn(path: Path, message: str) -> None:
    warnings.warn(f"{path}: {message}", SceneWarning, stacklevel=2)


# --- text ---------------------------------------------------------------------------------------------------------


@dataclass
class _Lines:
    """The file's lines by keyword, without it."""

    v: list[bytes] = field(default_factory=list)
    vt: list[bytes] = field(default_factory=list)
    vn: list[bytes] = field(default_factory=list)
    faces: list[bytes] = field(default_factory=list)
    # Before which face how many v, vt, vn there were, where that changed: negative indices count back from there.
    known: list[tuple[int, int, int, int]] = field(default_factory=list)
    materials: list[str] = field(default_factory=lambda: [""])
    material_starts: list[int] = field(default_factory=lambda: [0])
    libraries: list[str] = field(default_factory=list)


def _sort(data: bytes) -> _Lines:
    out = _Lines()
    vectors = {b"v": out.v, b"vt": out.vt, b"vn": out.vn}
    if b"\\\n" in data or b"\\\r\n" in data:
        data = data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    changed = True
    for line in data.splitlines():
        keyword, _, rest = line.partition(b" ")
        if keyword not in vectors and keyword != b"f":  # something rarer, or other white space
            words = line.split(None, 1)
            if not words:
                continue
            keyword, rest = words[0], words[1] if len(words) > 1 else b""
        if keyword in vectors:
            vectors[keyword].append(rest)
            changed = True
        elif keyword == b"f":
            if changed:
                out.known.append((len(out.faces), len(out.v), len(out.vt), len(out.vn)))
                changed = False
            out.faces.append(rest)
        elif keyword == b"usemtl":
            out.materials.append(rest.strip().decode("utf-8", "replace"))
            out.material_starts.append(len(out.faces))
        elif keyword == b"mtllib":
            out.libraries.append(rest.strip().decode("utf-8", "replace"))
    return out


def _line_of(data: bytes, keyword: bytes, index: int) -> int:
    """The line number, from 1, of the ``index``-th line, from 0, that begins with ``keyword``."""
    seen = -1

    def is_it(line: bytes) -> bool:
        nonlocal seen
        seen += line.split(None, 1)[:1] == [keyword]
        return seen == index

    return first_line(data, is_it)


def _vectors(path: Path, data: bytes, keyword: bytes, lines: list[bytes], width: int) -> Floats:
    """The first ``width`` numbers of every line, (N, width); what follows (a weight, a colour) is dropped."""
    if not lines:
        return np.zeros((0, width))
    columns = len(lines[0].split())
    numbers = parse_numbers(b" ".join(lines))
    if numbers is not None and columns >= width and all(len(line.split()) == columns for line in lines):
        return numbers.reshape(-1, columns)[:, :width]
    rows = np.zeros((len(lines), width))
    for index, line in enumerate(lines):
        row = parse_numbers(line.partition(b"#")[0])
        needed = 1 if keyword == b"vt" else width
        if row is None or len(row) < needed:
            where = f"line {_line_of(data, keyword, index)}"
            text = shorten(line.decode("utf-8", "replace"))
            raise SceneError(path, f"{where}: '{keyword.decode()} {text}' is not {width} numbers")
        rows[index, : min(width, len(row))] = row[:width]
    return rows


def _corners(path: Path, data: bytes, lines: _Lines, counts: tuple[int, int, int]) -> tuple[Ints, Ints]:
    """All faces' corners (C, 3) as indices from 0 into v, vt, vn (-1: none), and the corners of each face (F,)."""

    def stop(face: int, message: str) -> None:
        raise SceneError(path, f"line {_line_of(data, b'f', face)}: {message}")

    rows = [line.split() for line in lines.faces]
    sizes = np.fromiter(map(len, rows), np.int64, len(rows))
    written = _parse_corners(list(chain.from_iterable(rows)))
    if written is None or (sizes < 3).any():
        if any(b"#" in line for line in lines.faces):
            rows = [line.partition(b"#")[0].split() for line in lines.faces]
            sizes = np.fromiter(map(len, rows), np.int64, len(rows))
        if (sizes < 3).any():
            stop(int(np.argmax(sizes < 3)), "a face of fewer than 3 corners")
        each = [_parse_mixed(row) for row in rows]
        for index, parsed in enumerate(each):
            if parsed is None:
                stop(index, f"'f {shorten(lines.faces[index].decode('utf-8', 'replace'))}' is not a face")
        written = np.concatenate([parsed for parsed in each if parsed is not None])

    face = np.repeat(np.arange(len(sizes)), sizes)
    known = np.array(lines.known)
    limits = np.broadcast_to(np.array(counts), written.shape)
    relative = written < 0
    if relative.any():
        run = np.searchsorted(known[:, 0], face, side="right") - 1
        written = np.where(relative, known[run, 1:] + written + 1, written)
        # One that counts back beyond the first is not "none", which is 0 in `written`.
        written = np.where(relative & (written < 1), limits + 1, written)
    corners = written - 1
    wrong = (corners >= limits) | (corners < -1)
    wrong[:, 0] |= corners[:, 0] < 0
    if wrong.any():
        corner, column = (int(i) for i in np.argwhere(wrong)[0])
        keyword = ("v", "vt", "vn")[column]
        text = shorten(lines.faces[face[corner]].decode("utf-8", "replace").strip())
        stop(int(face[corner]), f"'f {text}' names a {keyword} that is not there ({counts[column]} are)")
    return corners, sizes


def _parse_corners(tokens: list[bytes]) -> Ints | None:
    """Corners that are all of one form (v, v/vt, v//vn or v/vt/vn), as written, 0 for none; None where they are not."""
    text = b" ".join(tokens)
    slashes, doubles = text.count(b"/"), text.count(b"//")
    forms = {
        (0, 0): (b"/", (0,)),
        (len(tokens), 0): (b"/", (0, 1)),
        (2 * len(tokens), len(tokens)): (b"//", (0, 2)),
        (2 * len(tokens), 0): (b"/", (0, 1, 2)),
    }
    if (slashes, doubles) not in forms:
        return None
    separator, columns = forms[slashes, doubles]
    numbers = parse_numbers(text.replace(separator, b" "))
    if numbers is None or len(numbers) != len(columns) * len(tokens):
        return None
    with np.errstate(invalid="ignore"):
        whole = numbers.astype(np.int64)
    if (whole != numbers).any():
        return None
    written = np.zeros((len(tokens), 3), np.int64)
    written[:, columns] = whole.reshape(-1, len(columns))
    # A 0 would be taken for "none": it is as far out of range as a number can be.
    written[:, columns] = np.where(written[:, columns] == 0, np.iinfo(np.int64).max, written[:, columns])
    return written


def _parse_mixed(tokens: list[bytes]) -> Ints | None:
    """The corners of one face, whatever form each has; None where one is no corner."""
    written = np.zeros((len(tokens), 3), np.int64)
    for i, token in enumerate(tokens):
        parts = token.split(b"/")
        if len(parts) > 3:
            return None
        for column, part in enumerate(parts):
            if column and not part:
                continue
            try:
                value = int(part)
            except ValueError:
                return None
            if not 0 < abs(value) < 2**62:
                value = np.iinfo(np.int64).max
            written[i, column] = value
    return written


# --- surface ------------------------------------------------------------------------------------------------------


# Doubled vertices whose normals differ less than this (40°) are a seam of one smooth surface, not a crease.
_SEAM_COSINE = math.cos(math.radians(40))


class _Surface:
    """The whole file's geometry, from which each material's part is cut."""

    def __init__(self, positions: Floats, uvs: Floats, normals: Floats, triangles: Ints) -> None:
        self.positions = positions.astype(np.float32)
        self.uvs = np.where(np.isfinite(uvs), uvs, 0).astype(np.float32)
        self.uvs[:, 1] = 1 - self.uvs[:, 1]  # OBJ counts v from the bottom of the image
        with np.errstate(over="ignore", invalid="ignore"):
            self.normals = normals.astype(np.float32)
        self._triangles = triangles
        self._smooth: NDArray[np.float32] | None = None

    def smooth(self) -> NDArray[np.float32]:
        """A normal for each position, over all faces of the file around it."""
        if self._smooth is None:
            triangles = self._triangles[:, :, 0].astype(np.uint32)
            own = vertex_normals(self.positions, triangles)
            # Patches that meet in doubled vertices are one surface, unless they meet at an angle.
            places, place = np.unique(self.positions, axis=0, return_inverse=True)
            place = place.reshape(-1)
            shared = vertex_normals(places, place[triangles].astype(np.uint32))[place]
            flat = (own * shared).sum(axis=1, keepdims=True) > _SEAM_COSINE
            self._smooth = np.where(flat, shared, own)
        return self._smooth

    def mesh(self, triangles: Ints, material: Material, name: str) -> Mesh:
        """Some of the triangles; a vertex for each different triple of position, texture coordinate and normal."""
        corners = triangles.reshape(-1, 3)
        has_uvs, has_normals = (bool((corners[:, column] >= 0).any()) for column in (1, 2))
        key = corners[:, 0]
        if has_uvs:
            key = key * (len(self.uvs) + 1) + corners[:, 1] + 1
        if has_normals:
            key = np.unique(key, return_inverse=True)[1].reshape(-1)  # small again: the product below stays in 64 bits
            key = key * (len(self.normals) + 1) + corners[:, 2] + 1
        _, vertex, indices = np.unique(key, return_index=True, return_inverse=True)
        v, vt, vn = corners[vertex].T
        if has_normals:
            given = np.where((vn >= 0)[:, None], self.normals[np.maximum(vn, 0)], np.float32(0))
            normals = usable_normals(given, lambda: self.smooth()[v])
        else:
            normals = self.smooth()[v]
        uvs = np.where((vt >= 0)[:, None], self.uvs[np.maximum(vt, 0)], 0) if has_uvs else None
        return Mesh(
            self.positions[v],
            indices.reshape(-1, 3).astype(np.uint32),
            normals,
            uvs,
            material,
            name,
        )


# --- materials ----------------------------------------------------------------------------------------------------

_MAP_OPTIONS = {"-blendu": 1, "-blendv": 1, "-cc": 1, "-clamp": 1, "-texres": 1, "-bm": 1, "-boost": 1, "-imfchan": 1,
                "-type": 1, "-mm": 2, "-o": 3, "-s": 3, "-t": 3}  # fmt: skip
_MAPS = {"map_kd": "base_color_texture", "map_ke": "emissive_texture", "norm": "normal_texture"}


def _materials(path: Path, libraries: list[str]) -> dict[str, Material]:
    """The materials of all libraries that are there."""
    materials: dict[str, Material] = {}
    textures: dict[Any, Texture | None] = {}
    for library in dict.fromkeys(libraries):
        try:
            file = beside(path, library)
            text = map_bytes(file).tobytes().decode("utf-8", "replace")
        except SceneError as error:
            _warn(path, f"mtllib '{shorten(library)}': {error.mistakes[0]}; its materials are grey")
            continue
        except ValueError as error:
            _warn(path, f"mtllib {error}; its materials are grey")
            continue
        for block in _blocks(text):
            materials[block["newmtl"][1]] = _material(file, block, textures)
    return materials


def _blocks(text: str) -> list[dict[str, tuple[int, str]]]:
    """The statements of each material: keyword, in lower case, to line number and the rest of the line."""
    blocks: list[dict[str, tuple[int, str]]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split(None, 1)
        if not words or words[0].startswith("#"):
            continue
        keyword, rest = words[0].lower(), words[1].strip() if len(words) > 1 else ""
        if keyword == "newmtl":
            blocks.append({})
        if blocks:
            blocks[-1][keyword] = (number, rest)
    return blocks


def _material(file: Path, block: dict[str, tuple[int, str]], textures: dict[Any, Texture | None]) -> Material:
    def numbers(keyword: str, default: tuple[float, ...], high: float) -> tuple[float, ...]:
        if keyword not in block:
            return default
        line, rest = block[keyword]
        try:
            values = [float(word) for word in rest.partition("#")[0].split()[: len(default)]]
        except ValueError:
            values = []
        if not values or not np.isfinite(values).all():
            raise SceneError(file, f"line {line}: '{keyword} {shorten(rest)}' is not {len(default)} numbers")
        values += values[-1:] * (len(default) - len(values))  # one number stands for all three
        return tuple(min(max(value, 0.0), high) for value in values)

    maps: dict[str, Texture | None] = {}
    for keyword, name in _MAPS.items():
        if keyword in block:
            rest = block[keyword][1]
            if rest not in textures:
                textures[rest] = _texture(file, rest)
            maps[name] = textures[rest]
    plain = (1.0,) * 3 if maps.get("base_color_texture") else (0.8,) * 3
    kd = numbers("kd", plain, 1)
    alpha = 1 - numbers("tr", (0.0,), 1)[0] if "d" not in block else numbers("d", (1.0,), 1)[0]
    ke = numbers("ke", (1.0,) * 3 if maps.get("emissive_texture") else (0.0,) * 3, np.inf)
    (ns,) = numbers("ns", (0.0,), np.inf)
    default_roughness = float((2 / (ns + 2)) ** 0.25) if "ns" in block else 0.8
    cutout = "map_d" in block and block["map_d"][1] == block.get("map_kd", (0, ""))[1]
    try:
        return Material(
            name=block["newmtl"][1],
            base_color=(kd[0], kd[1], kd[2], alpha),
            metallic=numbers("pm", (0.0,), 1)[0],
            roughness=numbers("pr", (default_roughness,), 1)[0],
            emissive=(ke[0], ke[1], ke[2]),
            alpha_mode="mask" if cutout or alpha < 1 else "opaque",
            **maps,  # type: ignore[arg-type]
        )
    except ParameterError as error:
        raise SceneError(file, f"line {block['newmtl'][0]}: {error}") from error


def _texture(file: Path, statement: str) -> Texture | None:
    """The texture of a map statement, its options before the file's name; None, with a warning, where it is missing."""
    words = statement.split()
    offset, scale, wrap = (0.0, 0.0), (1.0, 1.0), "repeat"
    try:
        while words and words[0].lower() in _MAP_OPTIONS:
            option = words.pop(0).lower()
            values: list[str] = []
            while len(values) < _MAP_OPTIONS[option] and len(words) > 1 and (not values or _is_number(words[0])):
                values.append(words.pop(0))
            if option == "-o":
                u, v = ([float(x) for x in values] + [0.0])[:2]
                offset = (u, -v)  # v is counted from the other end
            elif option == "-s":
                u, v = ([float(x) for x in values] + [1.0])[:2]
                scale = (u, v)
            elif option == "-clamp" and values == ["on"]:
                wrap = "clamp"
        image = beside(file, " ".join(words))
        # uv' = scale·uv + offset about the bottom left corner, which is v = 1 here.
        offset = (offset[0], offset[1] + 1 - scale[1])
        texels = decode_image(map_bytes(image), image.name)
        return Texture(texels, wrap, wrap, offset=offset, scale=scale)  # type: ignore[arg-type]
    except SceneError as error:
        _warn(file, f"texture '{shorten(statement)}': {error.mistakes[0]}")
    except ValueError as error:
        _warn(file, f"texture '{shorten(statement)}': {error}")
    return None


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
