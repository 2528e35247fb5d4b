"""PLY: one mesh in every encoding, and files that lie."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tyndall.scene.errors import SceneError
from tyndall.scene.files import load
from tyndall.scene.model import Mesh

POINTS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0.25)])
TRIANGLES = [[0, 1, 2], [0, 2, 3]]
MIXED = [[0, 1, 2], [0, 1, 2, 3], [], [0, 1], [3, 0, 2]]
FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


def header(form: str, vertices: int, faces: int, extra: str = "", list_type: str = "uchar int") -> bytes:
    return (
        f"ply\nformat {form} 1.0\ncomment made by hand\nelement vertex {vertices}\n"
        f"property float x\nproperty float y\nproperty float z\n{extra}"
        f"element face {faces}\nproperty list {list_type} vertex_indices\nend_header\n"
    ).encode()


def body(form: str, points: Any, faces: list[list[int]]) -> bytes:
    if form == "ascii":
        rows = [" ".join(map(str, p)) for p in points] + [" ".join(map(str, (len(f), *f))) for f in faces]
        return ("\n".join(rows) + "\n").encode()
    order = FORMATS[form]
    return np.asarray(points, order + "f4").tobytes() + b"".join(
        struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in faces
    )


def read(folder: Path, data: bytes) -> Mesh:
    (folder / "a.ply").write_bytes(data)
    (instance,) = load(folder / "a.ply").instances
    return instance.mesh


@pytest.mark.parametrize("form", FORMATS)
def test_the_same_mesh_in_every_encoding(form: str, tmp_path: Path) -> None:
    mesh = read(tmp_path, header(form, 4, 2) + body(form, POINTS, TRIANGLES))
    assert mesh.positions.tolist() == POINTS.tolist()
    assert mesh.indices.tolist() == TRIANGLES
    assert mesh.positions.dtype == np.dtype("=f4")


@pytest.mark.parametrize("form", FORMATS)
def test_polygons_of_one_and_of_many_sizes(form: str, tmp_path: Path) -> None:
    quads = read(tmp_path, header(form, 4, 2) + body(form, POINTS, [[0, 1, 2, 3], [3, 2, 1, 0]]))
    assert quads.indices.tolist() == [[0, 1, 2], [0, 2, 3], [3, 2, 1], [3, 1, 0]]
    mixed = read(tmp_path, header(form, 4, len(MIXED)) + body(form, POINTS, MIXED))
    assert mixed.indices.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3], [3, 0, 2]]


@pytest.mark.parametrize("form", ["binary_little_endian", "binary_big_endian"])
def test_other_properties_and_elements_are_passed_over(form: str, tmp_path: Path) -> None:
    order = FORMATS[form]
    head = (
        f"ply\nformat {form} 1.0\nobj_info x\nelement strange 2\nproperty list ushort double weights\nproperty char c\n"
        "element vertex 3\nproperty double y\nproperty uchar red\nproperty double x\nproperty float32 z\n"
        "property float nx\nproperty float ny\nproperty float nz\nproperty float s\nproperty float t\n"
        "element face 1\nproperty short flags\nproperty list uint8 uint16 vertex_index\n"
        "property list uchar float texcoord\nelement after 1\nproperty int q\nend_header\n"
    ).encode()
    data = struct.pack(f"{order}H2dbH1db", 2, 0.5, 0.5, 7, 1, 0.25, 8)
    for x, y, s, t in ((0, 0, 0, 0), (1, 0, 1, 0), (0, 1, 0, 0.25)):
        data += struct.pack(f"{order}dBdf3f2f", y, 200, x, 0, 0, 0, 2, s, t)
    data += struct.pack(f"{order}hB3HB2fi", -1, 3, 0, 1, 2, 2, 0.5, 0.5, 99)
    mesh = read(tmp_path, head + data)
    assert mesh.positions.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert mesh.indices.tolist() == [[0, 1, 2]]
    assert mesh.normals is not None
    assert mesh.normals.tolist() == [[0, 0, 1]] * 3
    assert mesh.uvs is not None
    assert mesh.uvs.tolist() == [[0, 1], [1, 1], [0, 0.75]]


def test_ascii_with_other_properties_on_the_faces(tmp_path: Path) -> None:
    head = header("ascii", 4, 2).replace(b"end_header", b"property uchar red\nend_header")
    mesh = read(tmp_path, head + b"0 0 0\n1 0 0 1 1 0\n0 1 0.25\n3 0 1 2 255\n3 0 2 3 254\n")
    assert mesh.indices.tolist() == TRIANGLES


def test_carriage_returns_in_the_header(tmp_path: Path) -> None:
    head = header("ascii", 4, 2).replace(b"\n", b"\r\n")
    assert read(tmp_path, head + body("ascii", POINTS, TRIANGLES)).indices.tolist() == TRIANGLES


LITTLE = "binary_little_endian"
TWICE = "element vertex 1\nproperty int x\nproperty int x\n"
ROOM = header(LITTLE, 4, 2) + body(LITTLE, POINTS, TRIANGLES)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is empty"),
        (b"plywood", "does not begin with 'ply'"),
        (b"ply\nformat ascii 1.0\n", "has no end of its header"),
        (b"ply\nformat ascii 1.0\n" + b"comment x\n" * 9999, "has no end of its header"),
        (b"ply\nformat ascii 1.0\nhello there\nend_header\n", "line 3: 'hello there' is not a statement"),
        (b"ply\nformat ascii 2.0\nend_header\n", "line 2: 'format ascii 2.0' is not a statement"),
        (b"ply\nelement vertex 1\nend_header\n", "has no format"),
        (b"ply\nformat ascii 1.0\nelement vertex -1\nend_header\n", "line 3"),
        (b"ply\nformat ascii 1.0\nproperty float x\nend_header\n", "line 3"),
        (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty list float int x\nend_header\n", "line 4: "),
        (f"ply\nformat ascii 1.0\n{TWICE}end_header\n0 0\n".encode(), "a property twice"),
        (header(LITTLE, 10**6, 2), "element vertex: the header says 1000000, and the 0 bytes that are left hold"),
        (header("ascii", 10**6, 2) + b"1 2 3\n", "element vertex: the header says 1000000, and the 6 bytes"),
        (header(LITTLE, 10**14, 2) + bytes(100), "element vertex: the header says 100000000000000"),
        (header(LITTLE, 4, 10**9) + body(LITTLE, POINTS, TRIANGLES), "element face: the header says 1000000000"),
        (ROOM[:-1], "element face: is truncated, or a count is wrong, at row 1"),
        (ROOM[:-20], "element face: is truncated, or a count is wrong, at its first row"),
        (header(LITTLE, 4, 2) + body(LITTLE, POINTS, [[0, 1, 2]]) + b"\xff", "element face: "),
        (header(LITTLE, 4, 1, list_type="uint int") + body(LITTLE, POINTS, []) + b"\xff" * 8, "element face: "),
        (header(LITTLE, 4, 1, list_type="int int") + body(LITTLE, POINTS, []) + b"\xff" * 8, "element face: "),
        (header(LITTLE, 4, 2) + body(LITTLE, POINTS, [[0, 1, 2], [0, 2, 4]]), "face 1: index 4 is not one of 4"),
        (header(LITTLE, 4, 2) + body(LITTLE, POINTS, [[0, 1, 2], [0, 2, -1]]), "face 1: index -1 is not one of"),
        (header("ascii", 4, 2) + body("ascii", POINTS, [[0, 1, 2], [0, 2, 9]]), "face 1: index 9 is not one of"),
        (header("ascii", 4, 1) + body("ascii", POINTS, []) + b"3 0 1 1.5\n", "face 0: index 1.5 is not one of"),
        (header("ascii", 4, 1) + body("ascii", POINTS, []) + b"3 0 1 nan\n", "an index is not a number"),
        (header("ascii", 4, 1) + body("ascii", POINTS, []) + b"nan 0 1 2\n", "element face: "),
        (header("ascii", 4, 1) + body("ascii", POINTS, []) + b"1e30 0 1 2\n", "element face: "),
        (header("ascii", 4, 2) + body("ascii", POINTS, [[0, 1, 2]]), "element face: "),
        (header("ascii", 2, 1) + b"0 0 0\n0 zero 0\n3 0 1 2\n", "line 12: '0 zero 0' is not numbers"),
        (header(LITTLE, 4, 2) + body(LITTLE, POINTS * np.nan, TRIANGLES), "vertex 0: (nan, nan, nan) is not"),
        (header(LITTLE, 4, 2) + body(LITTLE, POINTS + np.inf, TRIANGLES), "vertex 0: (inf, inf, inf) is not"),
        (header(LITTLE, 4, 1) + body(LITTLE, POINTS, [[1, 1, 1]]), "has no triangles"),
        (header(LITTLE, 4, 0) + body(LITTLE, POINTS, []), "has no faces; a cloud of points cannot be drawn"),
        (header(LITTLE, 0, 1) + body(LITTLE, [], [[0, 1, 2]]), "has no vertices with x, y and z"),
    ],
    ids=range(34),
)  # fmt: skip
def test_a_lie_is_one_line(data: bytes, message: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError) as caught:
        read(tmp_path, data)
    assert message in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("form", FORMATS)
def test_every_truncation_is_one_line(form: str, tmp_path: Path) -> None:
    whole = header(form, 4, len(MIXED)) + body(form, POINTS, MIXED)
    for length in range(len(whole) - (2 if form == "ascii" else 0)):
        with pytest.raises(SceneError) as caught:
            read(tmp_path, whole[:length])
        assert len(str(caught.value).splitlines()) == 1
