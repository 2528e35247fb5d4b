"""OBJ and MTL: hand-made files whose right reading is known exactly, real ones, and files that lie."""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture

import tyndall.scene
from tyndall.scene.errors import SceneError, SceneWarning
from tyndall.scene.files import load
from tyndall.scene.model import Mesh, Scene

DATA = Path(tyndall.scene.__file__).parents[4] / "shared" / "data"
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def read(folder: Path, text: str | bytes, name: str = "a.obj") -> Scene:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return load(path)


def only(scene: Scene) -> Mesh:
    (instance,) = scene.instances
    return instance.mesh


def test_a_triangle(tmp_path: Path) -> None:
    mesh = only(read(tmp_path, TRIANGLE + "f 1 2 3\n"))
    assert mesh.positions.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert mesh.indices.tolist() == [[0, 1, 2]]
    assert mesh.normals is not None
    assert mesh.normals.tolist() == [[0, 0, 1]] * 3
    assert mesh.uvs is None


@pytest.mark.parametrize(
    "text",
    [
        TRIANGLE.replace("\n", "\r\n") + "f 1 2 3\r\n",
        TRIANGLE.replace("\n", "\r") + "f 1 2 3\r",
        TRIANGLE.replace(" ", "\t") + "\n\n  f\t1  2   3  ",
        "# a comment\nv 0 0 0 1\nv 1 0 0 1.0\nv 0 1 0\nf 1 2 \\\n3\n",
        "v 0 0 0 1 0 0\nv 1 0 0 0.5 0.5 0.5\nv 0 1 0 0 0 1\no thing\ng a b\ns 1\nf 1 2 3\nl 1 2\np 1\n",
        TRIANGLE + "f -3 -2 -1\nv 9 9 9\n",
        TRIANGLE + "f 1 2 3 # the only one\n",
        TRIANGLE + "f +1 2.0 3\n",
    ],
    ids=["crlf", "cr", "tabs", "weights", "colours", "negative", "comment", "signs"],
)
def test_ways_to_write_the_same_triangle(tmp_path: Path, text: str) -> None:
    mesh = only(read(tmp_path, text))
    assert mesh.positions[mesh.indices[0]].tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def test_negative_indices_count_back_from_where_they_stand(tmp_path: Path) -> None:
    text = TRIANGLE + "f -3 -2 -1\nv 0 0 5\nv 1 0 5\nv 0 1 5\nf -3 -2 -1\nf 1 -2 -1\n"
    mesh = only(read(tmp_path, text))
    z = mesh.positions[mesh.indices][:, :, 2]
    assert z.tolist() == [[0, 0, 0], [5, 5, 5], [0, 5, 5]]


def test_polygons_become_fans(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 2 1 0\nv 1 2 0\nv 0 2 0\nf 1 2 3 4 5\nf 1 2 3\nf 1 2 4 5\n"
    assert only(read(tmp_path, text)).indices.tolist() == [
        [0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 1, 2], [0, 1, 3], [0, 3, 4]
    ]  # fmt: skip


def test_corners_are_one_vertex_where_position_coordinate_and_normal_agree(tmp_path: Path) -> None:
    text = (
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 0.25\nvn 0 0 1\nvn 0 0 -2\n"
        "f 1/1/1 2/2/1 3/3/1\nf 1/1/1 3/3/1 4/4/1\nf 3/3/2 2/2/2 1/4/2\n"
    )
    mesh = only(read(tmp_path, text))
    assert len(mesh.positions) == 4 + 3
    assert mesh.uvs is not None
    assert mesh.normals is not None
    corner = mesh.indices[2, 2]
    assert mesh.positions[corner].tolist() == [0, 0, 0]
    assert mesh.uvs[corner].tolist() == [0, 0.75]  # OBJ counts from the bottom, an image from the top
    assert mesh.normals[corner].tolist() == [0, 0, -1]


def test_forms_may_be_mixed(tmp_path: Path) -> None:
    text = TRIANGLE + "v 0 0 1\nvt 0.5 0.5\nvn 1 0 0\nf 1/1/1 2//1 3/1\nf 1 2 4\n"
    mesh = only(read(tmp_path, text))
    assert mesh.uvs is not None
    assert mesh.normals is not None
    assert mesh.uvs[mesh.indices[0]].tolist() == [[0.5, 0.5], [0, 0], [0.5, 0.5]]
    assert mesh.normals[mesh.indices[0]][:2].tolist() == [[1, 0, 0], [1, 0, 0]]
    assert mesh.normals[mesh.indices[0, 2]].tolist() == [0, 0, 1]  # computed


def test_computed_normals_are_smooth_across_seams_and_materials(tmp_path: Path) -> None:
    # Two faces of a roof; the ridge has two texture coordinates and two materials, and still one normal.
    text = "v -1 0 0\nv 0 1 0\nv 0 1 1\nv 1 0 0\nvt 0 0\nvt 1 1\nusemtl a\nf 1/1 3/1 2/1\nusemtl b\nf 4/2 2/2 3/2\n"
    with pytest.warns(SceneWarning, match="material '[ab]' is defined nowhere"):
        left, right = (i.mesh for i in read(tmp_path, text).instances)
    assert left.normals is not None
    assert right.normals is not None
    ridge = [n for m in (left, right) for p, n in zip(m.positions, m.normals, strict=True) if p[1] == 1]  # type: ignore[arg-type]
    assert len(ridge) == 4
    assert np.allclose(ridge, (0, 1, 0))


def test_a_mesh_for_each_material_in_order(tmp_path: Path) -> None:
    (tmp_path / "a b.mtl").write_text(
        "newmtl red\nKd 1 0 0\nKe 2 0 0.5\nNs 998\n\nnewmtl glass\nKd 0.5\nd 0.25\nPr 0.125\nPm 1\n# end\n"
    )
    text = TRIANGLE + "mtllib a b.mtl\nusemtl glass\nf 1 2 3\nusemtl red\nf 3 2 1\nusemtl glass\nf 2 3 1\n"
    glass, red = (i.mesh for i in read(tmp_path, text).instances)
    assert (glass.triangle_count, red.triangle_count) == (2, 1)
    assert red.material.base_color == (1, 0, 0, 1)
    assert red.material.emissive == (2, 0, 0.5)
    assert red.material.roughness == pytest.approx((2 / 1000) ** 0.25)  # α² = 2/(Ns+2)
    assert red.material.alpha_mode == "opaque"
    assert glass.material.base_color == (0.5, 0.5, 0.5, 0.25)
    assert (glass.material.roughness, glass.material.metallic) == (0.125, 1)
    assert glass.material.alpha_mode == "mask"


def test_a_texture_with_options(tmp_path: Path) -> None:
    out = io.BytesIO()
    Picture.new("RGBA", (2, 2), (10, 20, 30, 40)).save(out, "PNG")
    (tmp_path / "my wood.png").write_bytes(out.getvalue())
    (tmp_path / "a.mtl").write_text(
        "newmtl wood\nmap_Kd -s 2 4 1 -o 0.5 0.25 -clamp on my wood.png\n"
        "map_d -s 2 4 1 -o 0.5 0.25 -clamp on my wood.png\n"
    )
    text = TRIANGLE + "vt 0 0\nvt 1 0\nvt 0 1\nmtllib a.mtl\nusemtl wood\nf 1/1 2/2 3/3\n"
    mesh = only(read(tmp_path, text))
    texture = mesh.material.base_color_texture
    assert texture is not None
    assert (texture.image.pixels == (10, 20, 30, 40)).all()
    assert mesh.material.base_color == (1, 1, 1, 1)
    assert mesh.material.alpha_mode == "mask"
    assert texture.wrap_u == texture.wrap_v == "clamp"
    # OBJ's own coordinate, scaled and moved, is what the texture makes of the mesh's flipped one.
    assert mesh.uvs is not None
    own = np.array([(0, 0), (1, 0), (0, 1)]) * (2, 4) + (0.5, 0.25)
    ours = mesh.uvs[mesh.indices[0]] * texture.scale + texture.offset
    assert np.allclose(ours, np.stack([own[:, 0], 1 - own[:, 1]], axis=1))


@pytest.mark.parametrize(
    ("mtl", "message"),
    [
        (None, "mtllib 'a.mtl': no such file; its materials are grey"),
        ("newmtl m\nmap_Kd none.png\n", "texture 'none.png': no such file"),
        ("newmtl m\nmap_Kd ../../x.png\n", "is refused: it is outside the folder"),
        ("newmtl m\nmap_Kd C:\\x.png\n", "is refused: only files in the folder"),
        ("newmtl m\nmap_Kd a.mtl\n", "not a PNG, JPEG"),
        ("newmtl m\nmap_Kd\n", "names no file"),
        ("newmtl other\n", "material 'm' is defined nowhere"),
    ],
)
def test_what_is_missing_beside_is_a_warning(tmp_path: Path, mtl: str | None, message: str) -> None:
    if mtl is not None:
        (tmp_path / "a.mtl").write_text(mtl)
    with pytest.warns(SceneWarning) as caught:
        assert read(tmp_path, TRIANGLE + "mtllib a.mtl\nusemtl m\nf 1 2 3\n").triangle_count == 1
    assert any(message in str(w.message) for w in caught)


def test_a_library_outside_the_folder_is_not_read(tmp_path: Path) -> None:
    with pytest.warns(SceneWarning, match="refused"):
        read(tmp_path, TRIANGLE + "mtllib /etc/passwd\nmtllib ../../x.mtl\nf 1 2 3\n")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("\n \n", "is empty"),
        ("hello", "has no faces"),
        (TRIANGLE, "has no faces"),
        (TRIANGLE + "f 1 2 4\n", "line 4: 'f 1 2 4' names a v that is not there (3 are)"),
        (TRIANGLE + "f 1 2 0\n", "line 4: 'f 1 2 0' names a v that is not there"),
        (TRIANGLE + "f 1 2 -4\n", "line 4: 'f 1 2 -4' names a v that is not there"),
        (TRIANGLE + "f 1/1 2/1 3/1\n", "line 4: 'f 1/1 2/1 3/1' names a vt that is not there (0 are)"),
        (TRIANGLE + "vn 0 0 1\nf 1//1 2//1 3//2\n", "line 5: 'f 1//1 2//1 3//2' names a vn that is not there (1 are)"),
        (TRIANGLE + "f 1 2 99999999999999999999\n", "line 4"),
        (TRIANGLE + "f 1 2 3\nf 1/1/1/1 2 3/1\n", "line 5: 'f 1/1/1/1 2 3/1' is not a face"),
        (TRIANGLE + "f 1 2 3\n\nf 1 2\n", "line 6: a face of fewer than 3 corners"),
        (TRIANGLE + "f 1 2 x\n", "line 4: 'f 1 2 x' is not a face"),
        (TRIANGLE + "f 1 2 1.5\n", "line 4: 'f 1 2 1.5' is not a face"),
        (TRIANGLE + "f 1 2 nan\n", "line 4: 'f 1 2 nan' is not a face"),
        (TRIANGLE + "f / 2 3\n", "line 4: 'f / 2 3' is not a face"),
        ("v 0 0 0\nv 1 0\nv 0 1 0 7\nf 1 2 3\n", "line 2: 'v 1 0' is not 3 numbers"),
        ("v 0 0 0\nv 1 zero 0\nv 0 1 0\nf 1 2 3\n", "line 2: 'v 1 zero 0' is not 3 numbers"),
        ("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", "vertex 1: (nan, 0, 0) is not a position"),
        ("v 0 0 0\nv 1e300 0 0\nv 0 1 0\nf 1 2 3\n", "vertex 1: (1e+300, 0, 0) is not a position"),
        (TRIANGLE + "f 1 1 2\nf 2 3 2\n", "has no triangles: every face has a corner twice"),
        (b"\xff\xfe" + (TRIANGLE + "f 1 2 3\n").encode("utf-16-le"), "has no faces"),
    ],
    ids=range(21),
)  # fmt: skip
def test_a_lie_is_one_line_with_its_number(tmp_path: Path, text: str | bytes, message: str) -> None:
    with pytest.raises(SceneError) as caught:
        read(tmp_path, text)
    assert message in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_bad_numbers_in_an_mtl_name_their_line(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("newmtl m\nKd 1 nan 0\n")
    with pytest.raises(SceneError, match=r"a.mtl: line 2: 'kd 1 nan 0' is not 3 numbers"):
        read(tmp_path, TRIANGLE + "mtllib a.mtl\nusemtl m\nf 1 2 3\n")


def test_degenerate_faces_leave_no_nan(tmp_path: Path) -> None:
    mesh = only(read(tmp_path, TRIANGLE + "v 0 0 0\nv 2 0 0\nf 1 2 3\nf 1 1 2\nf 1 2 5\nf 1 4 2\n"))
    assert mesh.triangle_count == 3  # the one that names a corner twice is dropped, those without area are kept
    assert mesh.normals is not None
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1)


def test_every_truncation_of_a_file_loads_or_is_one_line(tmp_path: Path) -> None:
    text = TRIANGLE + "vt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1\nf -1//-1 -2//-1 -3//-1\n"
    outcomes = []
    for length in range(len(text)):
        try:
            outcomes.append(read(tmp_path, text[:length]).triangle_count)
        except SceneError as error:
            assert len(str(error).splitlines()) == 1  # noqa: PT017 - both outcomes are right
    assert set(outcomes) == {1, 2}


@pytest.mark.parametrize(("name", "triangles"), [("stanford-bunny", 69_451), ("spot", 5856), ("teapot", 6320)])
def test_real_files(name: str, triangles: int) -> None:
    path = DATA / f"{name}.obj"
    if not path.exists():
        pytest.skip(f"{name}.obj is not beside this checkout, in ../shared/data")
    scene = load(path)
    assert scene.triangle_count == triangles
    for instance in scene.instances:
        normals = instance.mesh.normals
        assert normals is not None
        assert np.allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
        a, b, c = (instance.mesh.positions[instance.mesh.indices[:, i]].astype(float) for i in range(3))
        faces = np.cross(b - a, c - a)
        agree = np.einsum("ij,ij->i", faces, normals[instance.mesh.indices[:, 0]]) > 0
        assert agree.mean() > 0.98  # winding and normals tell the same outside


def test_doubled_vertices_of_a_smooth_surface_share_their_normal(tmp_path: Path) -> None:
    """Patches that repeat the vertices of their common edge show no seam; a crease of 90° stays one."""
    bend = math.radians(10)
    for angle, smooth in ((bend, True), (math.pi / 2, False)):
        x, y = 1 + math.cos(angle), math.sin(angle)
        path = tmp_path / "patches.obj"
        path.write_text(
            f"v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nv 1 0 0\nv {x} {y} 0\nv {x} {y} 1\nv 1 0 1\nf 1 4 3 2\nf 5 8 7 6\n"
        )
        (instance,) = load(path).instances
        mesh = instance.mesh
        assert mesh.normals is not None
        edge = mesh.normals[np.isclose(mesh.positions, (1, 0, 0), atol=1e-6).all(axis=1)]
        assert len(edge) == 2
        assert np.allclose(edge[0], edge[1], atol=1e-6) == smooth
