"""STL: flat facets, welded; both encodings; files that lie."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tyndall.scene.errors import SceneError, SceneWarning
from tyndall.scene.files import load
from tyndall.scene.model import Mesh


# A cube of side 2, two triangles a side, counter-clockwise from outside.
def _cube() -> NDArray[np.float32]:
    triangles = []
    for axis in range(3):
        for sign in (-1, 1):
            a, b, c, d = (np.roll((sign, u, v), axis) for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
            triangles += [(a, b, c), (a, c, d)] if sign > 0 else [(a, c, b), (a, d, c)]
    return np.array(triangles, np.float32)


CUBE = _cube()


def binary(triangles: NDArray[np.float32], head: bytes = b"", count: int | None = None) -> bytes:
    rows = np.zeros(len(triangles), [("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")])
    rows["c"] = triangles
    return head.ljust(80, b"\0") + struct.pack("<I", len(triangles) if count is None else count) + rows.tobytes()


def text(triangles: NDArray[np.float32], name: str = "part") -> bytes:
    facets = "".join(
        "facet normal 0 0 0\n outer loop\n"
        + "".join(f"  vertex {x!r} {y!r} {z!r}\n" for x, y, z in t.tolist())
        + " endloop\nendfacet\n"
        for t in triangles
    )
    return f"solid {name}\n{facets}endsolid {name}\n".encode()


def read(folder: Path, data: bytes) -> Mesh:
    (folder / "a.stl").write_bytes(data)
    (instance,) = load(folder / "a.stl").instances
    return instance.mesh


@pytest.mark.parametrize(
    "data",
    [binary(CUBE), binary(CUBE, b"solid cube"), binary(CUBE) + b"more", text(CUBE), text(CUBE).upper(),
     text(CUBE, "a vertex")],
    ids=["binary", "solid", "longer", "ascii", "upper", "name"],
)  # fmt: skip
def test_a_cube_is_flat_welded_and_outside_out(data: bytes, tmp_path: Path) -> None:
    mesh = read(tmp_path, data)
    assert np.array_equal(mesh.positions[mesh.indices], CUBE)
    assert len(mesh.positions) == 24  # 4 corners a side: the two triangles of a side share two
    assert mesh.normals is not None
    a, b, c = (mesh.positions[mesh.indices[:, i]] for i in range(3))
    face = np.cross(b - a, c - a)
    for corner in range(3):
        assert np.array_equal(mesh.normals[mesh.indices[:, corner]], face / 4)
    assert (np.einsum("ij,ij->i", face, (a + b + c) / 3) > 0).all()


def test_zero_and_minus_zero_are_one_place(tmp_path: Path) -> None:
    triangles = np.array([[(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(-0.0, 0, -0.0), (0, 1, 0), (-1, 0, 0)]], np.float32)
    assert len(read(tmp_path, binary(triangles)).positions) == 4


def test_a_triangle_without_area_has_a_normal(tmp_path: Path) -> None:
    triangles = np.array([[(0, 0, 0)] * 3, [(0, 0, 0), (1, 0, 0), (0, 0, 1)]], np.float32)
    normals = read(tmp_path, binary(triangles)).normals
    assert normals is not None
    assert np.allclose(np.linalg.norm(normals, axis=1), 1)


def test_without_endsolid_there_is_a_warning(tmp_path: Path) -> None:
    data = text(CUBE).partition(b"endsolid")[0]
    with pytest.warns(SceneWarning, match="has no endsolid and may be truncated"):
        assert read(tmp_path, data).triangle_count == 12


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is empty"),
        (bytes(83), "is not an STL: 83 bytes are too few"),
        (binary(CUBE)[:-1], "is truncated: it says 12 triangles, and has room for 11"),
        (binary(CUBE, count=2**32 - 1), "is truncated: it says 4294967295 triangles, and has room for 12"),
        (binary(CUBE[:0]), "has no triangles"),
        (b"solid nothing\nendsolid\n", "has no triangles"),
        (binary(CUBE * np.float32(np.nan)), "vertex 0: (nan, nan, nan) is not a position"),
        (binary(CUBE + np.float32(np.inf)), "vertex 0: (inf, inf, inf) is not a position"),
        (binary(CUBE * np.float32(1e30)), "is not a position"),
        (text(CUBE).replace(b"1.0", b"one", 1), "line 4: 'vertex -one -1.0 -1.0' is not 3 numbers"),
        (text(CUBE).replace(b" 1.0", b"", 1), "line 5: 'vertex -1.0 1.0' is not 3 numbers"),
        (text(CUBE).replace(b"  vertex", b" ", 1), "is truncated: 35 corners are not whole triangles"),
    ],
    ids=range(12),
)
def test_a_lie_is_one_line(data: bytes, message: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError) as caught:
        read(tmp_path, data)
    assert message in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
