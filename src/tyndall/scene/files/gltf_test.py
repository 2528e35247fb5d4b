"""glTF: hand-made files whose right reading is known exactly, and files that lie."""

from __future__ import annotations

import base64
import copy
import io
import json
import math
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image as Picture

from tyndall.scene.errors import SceneError, SceneWarning
from tyndall.scene.files import load
from tyndall.scene.model import DirectionalLight, PointLight, Scene, SpotLight

FLOAT, UINT = 5126, 5125
CODES = {
    np.dtype(t): c for t, c in (("i1", 5120), ("u1", 5121), ("i2", 5122), ("u2", 5123), ("u4", UINT), ("f4", FLOAT))
}
SHAPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
SQUARE = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], np.float32)
HALVES = np.array([0, 1, 2, 0, 2, 3], np.uint16)


class Document:
    """A glTF file under construction."""

    def __init__(self) -> None:
        self.binary = bytearray()
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": []}], "accessors": [], "bufferViews": [], "buffers": [{"byteLength": 0}],
        }  # fmt: skip

    def view(self, data: bytes, **more: Any) -> int:
        self.binary += bytes(-len(self.binary) % 4)
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data), **more})
        self.binary += data
        self.json["buffers"][0]["byteLength"] = len(self.binary)
        return len(self.json["bufferViews"]) - 1

    def accessor(self, values: NDArray[Any], **more: Any) -> int:
        values = np.asarray(values)
        width = 1 if values.ndim == 1 else values.shape[1]
        record = {"bufferView": self.view(values.tobytes()), "componentType": CODES[values.dtype],
                  "type": SHAPES[width], "count": len(values), **more}  # fmt: skip
        self.json["accessors"].append(record)
        return len(self.json["accessors"]) - 1

    def primitive(self, positions: NDArray[Any] = SQUARE, indices: NDArray[Any] | None = HALVES, **more: Any) -> Any:
        record: dict[str, Any] = {"attributes": {"POSITION": self.accessor(positions)}, **more}
        if indices is not None:
            record["indices"] = self.accessor(indices)
        self.json["meshes"][0]["primitives"].append(record)
        return record

    def glb(self) -> bytes:
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        data = bytes(self.binary) + bytes(-len(self.binary) % 4)
        head = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(data))
        return head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data

    def load(self, folder: Path) -> Scene:
        (folder / "a.glb").write_bytes(self.glb())
        return load(folder / "a.glb")


@pytest.fixture
def doc() -> Document:
    return Document()


def png(width: int = 2, height: int = 3, mode: str = "RGB", color: Any = (255, 128, 0)) -> bytes:
    out = io.BytesIO()
    Picture.new(mode, (width, height), color).save(out, "PNG")
    return out.getvalue()


# --- geometry -----------------------------------------------------------------------------------------------------


def test_the_same_square_as_glb_as_data_uri_and_with_a_file_beside(doc: Document, tmp_path: Path) -> None:
    doc.primitive()
    meshes = [doc.load(tmp_path).instances[0].mesh]
    doc.json["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(doc.binary).decode()
    (tmp_path / "b.gltf").write_text(json.dumps(doc.json), encoding="utf-8-sig")
    meshes.append(load(tmp_path / "b.gltf").instances[0].mesh)
    doc.json["buffers"][0]["uri"] = "sub/the%20data.bin"
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "the data.bin").write_bytes(doc.binary)
    (tmp_path / "c.gltf").write_text(json.dumps(doc.json))
    meshes.append(load(tmp_path / "c.gltf").instances[0].mesh)
    for mesh in meshes:
        assert np.array_equal(mesh.positions, SQUARE)
        assert np.array_equal(mesh.indices, [(0, 1, 2), (0, 2, 3)])
        assert np.array_equal(mesh.normals, [(0, 0, 1)] * 4)  # type: ignore[arg-type]


def test_float_attributes_of_a_glb_are_mapped_not_copied(doc: Document, tmp_path: Path) -> None:
    doc.primitive(indices=HALVES.astype(np.uint32))
    mesh = doc.load(tmp_path).instances[0].mesh
    for array in (mesh.positions, mesh.indices):
        base: Any = array
        while isinstance(base, np.ndarray) and not isinstance(base, np.memmap):
            base = base.base
        assert isinstance(base, np.memmap)


def test_interleaved_attributes_are_taken_apart(doc: Document, tmp_path: Path) -> None:
    rows = np.zeros(4, [("p", "<f4", 3), ("n", "<f4", 3), ("uv", "<f4", 2)])
    rows["p"], rows["n"], rows["uv"] = SQUARE, (0, 0, 1), SQUARE[:, :2] * 0.5
    primitive = doc.primitive()
    view = doc.view(rows.tobytes(), byteStride=32)
    for name, offset, width in (("POSITION", 0, 3), ("NORMAL", 12, 3), ("TEXCOORD_0", 24, 2)):
        doc.json["accessors"].append({"bufferView": view, "byteOffset": offset, "componentType": FLOAT, "count": 4,
                                      "type": SHAPES[width]})  # fmt: skip
        primitive["attributes"][name] = len(doc.json["accessors"]) - 1
    mesh = doc.load(tmp_path).instances[0].mesh
    assert np.array_equal(mesh.positions, SQUARE)
    assert np.array_equal(mesh.normals, rows["n"])  # type: ignore[arg-type]
    assert np.array_equal(mesh.uvs, rows["uv"])  # type: ignore[arg-type]


@pytest.mark.parametrize("dtype", ["i1", "u1", "i2", "u2"])
@pytest.mark.parametrize("normalized", [False, True])
def test_quantized_positions(doc: Document, tmp_path: Path, dtype: str, normalized: bool) -> None:
    top = np.iinfo(dtype).max
    values = (SQUARE * top).astype(dtype)
    padded = np.zeros((4, 4), dtype)
    padded[:, :3] = values
    primitive = doc.primitive()
    view = doc.view(padded.tobytes(), byteStride=padded.strides[0])
    doc.json["accessors"].append({"bufferView": view, "componentType": CODES[np.dtype(dtype)], "count": 4,
                                  "type": "VEC3", "normalized": normalized})  # fmt: skip
    primitive["attributes"]["POSITION"] = len(doc.json["accessors"]) - 1
    doc.json["extensionsRequired"] = ["KHR_mesh_quantization"]
    expected = SQUARE if normalized else SQUARE * np.float32(top)
    assert np.array_equal(doc.load(tmp_path).instances[0].mesh.positions, expected)


def test_a_normalized_minimum_is_minus_one_and_not_less(doc: Document, tmp_path: Path) -> None:
    primitive = doc.primitive()
    normals = np.array([(0, 0, -128)] * 4, np.int8)
    primitive["attributes"]["NORMAL"] = doc.accessor(normals, normalized=True)
    assert np.array_equal(doc.load(tmp_path).instances[0].mesh.normals, [(0, 0, -1)] * 4)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("mode", "triangles"), [(5, [(0, 1, 2), (1, 3, 2), (2, 3, 4)]), (6, [(1, 2, 0), (2, 3, 0), (3, 4, 0)])]
)
def test_strips_and_fans(doc: Document, tmp_path: Path, mode: int, triangles: list[tuple[int, ...]]) -> None:
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 2, 0)], np.float32)
    doc.primitive(points, None, mode=mode)
    assert doc.load(tmp_path).instances[0].mesh.indices.tolist() == [list(t) for t in triangles]


def test_a_strip_keeps_its_side_and_loses_its_degenerate_triangles(doc: Document, tmp_path: Path) -> None:
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], np.float32)
    doc.primitive(points, np.array([0, 1, 2, 3, 3, 3], np.uint8), mode=5)
    mesh = doc.load(tmp_path).instances[0].mesh
    a, b, c = (mesh.positions[mesh.indices[:, i]] for i in range(3))
    assert np.array_equal(np.cross(b - a, c - a), [(0, 0, 1), (0, 0, 1)])


def test_points_and_lines_are_left_out_with_a_warning(doc: Document, tmp_path: Path) -> None:
    doc.primitive(mode=1)
    warned = pytest.warns(SceneWarning, match="meshes.0..primitives.0.: lines are left out")
    with warned, pytest.raises(SceneError, match="has no triangles"):
        doc.load(tmp_path)
    doc.primitive()
    with pytest.warns(SceneWarning, match="lines"):
        assert doc.load(tmp_path).triangle_count == 2


def test_sparse_accessors_with_and_without_a_base(doc: Document, tmp_path: Path) -> None:
    places = doc.view(np.array([1, 3], np.uint16).tobytes())
    values = doc.view(np.array([(5, 0, 0), (0, 7, 0)], np.float32).tobytes())
    sparse = {"count": 2, "indices": {"bufferView": places, "componentType": 5123}, "values": {"bufferView": values}}
    doc.primitive()
    doc.json["accessors"][0]["sparse"] = sparse
    expected = SQUARE.copy()
    expected[[1, 3]] = (5, 0, 0), (0, 7, 0)
    assert np.array_equal(doc.load(tmp_path).instances[0].mesh.positions, expected)
    del doc.json["accessors"][0]["bufferView"]
    expected[[0, 2]] = 0
    assert np.array_equal(doc.load(tmp_path).instances[0].mesh.positions, expected)


def test_zero_and_nan_normals_are_computed_anew(doc: Document, tmp_path: Path) -> None:
    primitive = doc.primitive()
    given = np.array([(0, 0, 0), (math.nan, 0, 0), (0, 0, 5), (1, 0, 0)], np.float32)
    primitive["attributes"]["NORMAL"] = doc.accessor(given)
    normals = doc.load(tmp_path).instances[0].mesh.normals
    assert np.array_equal(normals, [(0, 0, 1), (0, 0, 1), (0, 0, 1), (1, 0, 0)])  # type: ignore[arg-type]


# --- nodes --------------------------------------------------------------------------------------------------------


def test_transforms_multiply_down_the_tree(doc: Document, tmp_path: Path) -> None:
    doc.primitive()
    half = math.sqrt(0.5)
    doc.json["nodes"] = [
        {"translation": [1, 2, 3], "rotation": [0, half, 0, half], "scale": [2, 3, 4], "children": [1]},
        {"matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 10, 20, 30, 1], "mesh": 0, "name": "leaf"},
    ]
    (instance,) = doc.load(tmp_path).instances
    # T·R·S, R a quarter turn about +Y: x → −z, z → x.
    expected = np.array([(0, 0, 4, 1), (0, 3, 0, 2), (-2, 0, 0, 3), (0, 0, 0, 1)]) @ np.array(
        [(1, 0, 0, 10), (0, 1, 0, 20), (0, 0, 1, 30), (0, 0, 0, 1)]
    )
    assert np.allclose(instance.transform, expected, atol=1e-12)
    assert instance.name == "leaf"


def test_nodes_share_a_mesh_and_other_scenes_are_left_alone(doc: Document, tmp_path: Path) -> None:
    doc.primitive()
    doc.json["nodes"] = [{"mesh": 0}, {"mesh": 0, "translation": [5, 0, 0]}, {"mesh": 0}]
    doc.json["scenes"] = [{"nodes": [2]}, {"nodes": [0, 1]}]
    doc.json["scene"] = 1
    first, second = doc.load(tmp_path).instances
    assert first.mesh is second.mesh
    assert second.transform[0][3] == 5
    del doc.json["scenes"], doc.json["scene"]
    assert len(doc.load(tmp_path).instances) == 3


def test_a_mirrored_node_keeps_its_front_faces(doc: Document, tmp_path: Path) -> None:
    primitive = doc.primitive()
    primitive["attributes"]["NORMAL"] = doc.accessor(np.array([(0, 0, 1)] * 4, np.float32))
    doc.json["nodes"] = [{"mesh": 0, "scale": [1, 1, -2], "translation": [0, 0, 7]}, {"mesh": 0},
                         {"mesh": 0, "scale": [-1, 1, 1]}]  # fmt: skip
    doc.json["scenes"] = [{"nodes": [0, 1, 2]}]
    mirrored, plain, other = doc.load(tmp_path).instances
    assert mirrored.mesh is other.mesh
    assert mirrored.mesh is not plain.mesh
    for instance, sign in ((mirrored, -1), (plain, 1), (other, 1)):
        matrix = np.array(instance.transform)
        assert np.linalg.det(matrix[:3, :3]) > 0
        world = instance.mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]
        a, b, c = (world[instance.mesh.indices[:, i]] for i in range(3))
        # The side that faced +z in the file faces where the mirror sends it, by winding and by normal.
        assert np.array_equal(np.sign(np.cross(b - a, c - a)[:, 2]), [sign, sign])
        turned = instance.mesh.normals @ np.linalg.inv(matrix[:3, :3])
        assert (np.sign(turned[:, 2]) == sign).all()
    world = mirrored.mesh.positions @ np.array(mirrored.transform)[:3, :3].T + np.array(mirrored.transform)[:3, 3]
    assert np.array_equal(world, SQUARE * (1, 1, -2) + (0, 0, 7))


def test_gpu_instancing(doc: Document, tmp_path: Path) -> None:
    doc.primitive()
    attributes = {
        "TRANSLATION": doc.accessor(np.array([(1, 0, 0), (0, 2, 0)], np.float32)),
        "SCALE": doc.accessor(np.array([(1, 1, 1), (3, 3, 3)], np.float32)),
    }
    doc.json["nodes"] = [{"mesh": 0, "scale": [2, 2, 2],
                          "extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}}}]  # fmt: skip
    doc.json["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    first, second = doc.load(tmp_path).instances
    assert np.array_equal(first.transform, [(2, 0, 0, 2), (0, 2, 0, 0), (0, 0, 2, 0), (0, 0, 0, 1)])
    assert np.array_equal(second.transform, [(6, 0, 0, 0), (0, 6, 0, 4), (0, 0, 6, 0), (0, 0, 0, 1)])


# --- materials ----------------------------------------------------------------------------------------------------


def test_a_material_with_everything(doc: Document, tmp_path: Path) -> None:
    image = doc.view(png())
    (tmp_path / "normal.png").write_bytes(png(4, 4, "L", 128))
    doc.json.update(
        images=[{"bufferView": image, "mimeType": "image/png"}, {"uri": "normal.png", "name": "n"},
                {"uri": "data:image/png;base64," + base64.b64encode(png(1, 1, "I;16", 65535)).decode()}],
        samplers=[{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}],
        textures=[{"source": 0, "sampler": 0}, {"source": 1}, {"source": 2}],
        materials=[{
            "name": "all", "alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": True,
            "emissiveFactor": [1, 0.5, 0], "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8},
                                                          "KHR_materials_unlit": {},
                                                          "KHR_materials_ior": {"ior": 1.25},
                                                          "KHR_materials_transmission": {"transmissionFactor": 0.5}},
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5, "roughnessFactor": 0.25,
                "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": {
                    "offset": [0.5, 0.25], "rotation": 0.75, "scale": [2, 3]}}},
                "metallicRoughnessTexture": {"index": 1}},
            "normalTexture": {"index": 1}, "emissiveTexture": {"index": 2},
        }],
        extensionsUsed=["KHR_texture_transform"],
        extensionsRequired=["KHR_texture_transform", "KHR_materials_emissive_strength", "KHR_materials_unlit"],
    )  # fmt: skip
    primitive = doc.primitive(material=0)
    primitive["attributes"]["TEXCOORD_0"] = doc.accessor(SQUARE[:, :2].copy())
    material = doc.load(tmp_path).instances[0].mesh.material
    assert (material.name, material.alpha_mode, material.alpha_cutoff, material.double_sided) == (
        "all",
        "mask",
        0.25,
        True,
    )
    assert (material.base_color, material.metallic, material.roughness) == ((0.1, 0.2, 0.3, 0.4), 0.5, 0.25)
    assert (material.transmission, material.ior) == (0.5, 1.25)
    assert material.emissive == (8, 4, 0)
    base, rough = material.base_color_texture, material.metallic_roughness_texture
    normal, glow = material.normal_texture, material.emissive_texture
    assert base is not None
    assert rough is not None
    assert normal is not None
    assert glow is not None
    assert (base.wrap_u, base.wrap_v, base.filter) == ("clamp", "mirror", "nearest")
    assert (base.offset, base.rotation, base.scale) == ((0.5, 0.25), 0.75, (2, 3))
    assert base.image.pixels.shape == (3, 2, 4)
    assert (base.image.pixels == (255, 128, 0, 255)).all()
    assert rough.image is normal.image
    assert (rough.wrap_u, rough.filter, rough.scale) == ("repeat", "linear", (1, 1))
    assert (glow.image.pixels == 255).all()  # 16 bits are scaled, not clipped


def test_what_is_missing_has_gltfs_defaults(doc: Document, tmp_path: Path) -> None:
    doc.json["materials"] = [{}]
    doc.primitive(material=0)
    doc.primitive()
    for instance in doc.load(tmp_path).instances:
        material = instance.mesh.material
        assert (material.base_color, material.metallic, material.roughness) == ((1, 1, 1, 1), 1, 1)
        assert (material.emissive, material.alpha_mode, material.double_sided) == ((0, 0, 0), "opaque", False)


def test_blending_becomes_a_mask_with_a_warning(doc: Document, tmp_path: Path) -> None:
    doc.json["materials"] = [{"alphaMode": "BLEND"}]
    doc.primitive(material=0)
    with pytest.warns(SceneWarning, match="materials.0.: alphaMode BLEND is drawn as MASK"):
        assert doc.load(tmp_path).instances[0].mesh.material.alpha_mode == "mask"


def test_the_second_set_of_coordinates_is_used_where_the_base_colour_uses_it(doc: Document, tmp_path: Path) -> None:
    doc.json.update(
        images=[{"bufferView": doc.view(png())}], textures=[{"source": 0}],
        materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 1}},
                    "emissiveTexture": {"index": 0}}],
    )  # fmt: skip
    primitive = doc.primitive(material=0)
    primitive["attributes"]["TEXCOORD_0"] = doc.accessor(np.zeros((4, 2), np.float32))
    primitive["attributes"]["TEXCOORD_1"] = doc.accessor(np.array([(0, 0), (255, 0), (255, 255), (0, 51)], np.uint8),
                                                         normalized=True)  # fmt: skip
    with pytest.warns(SceneWarning, match=r"materials\[0\].emissiveTexture: .* second set of coordinates"):
        mesh = doc.load(tmp_path).instances[0].mesh
    assert np.allclose(mesh.uvs, [(0, 0), (1, 0), (1, 1), (0, 0.2)])  # type: ignore[arg-type]
    assert mesh.material.emissive_texture is None


# --- lights and camera --------------------------------------------------------------------------------------------


def test_lights_and_the_first_perspective_camera(doc: Document, tmp_path: Path) -> None:
    doc.primitive()
    half = math.sqrt(0.5)
    doc.json.update(
        extensions={"KHR_lights_punctual": {"lights": [
            {"type": "directional", "intensity": 1000, "color": [1, 0.5, 0.25]},
            {"type": "point"},
            {"type": "spot", "intensity": 40, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.4}, "range": 9},
            {"type": "spot", "spot": {"outerConeAngle": math.pi / 2}},
        ]}},
        extensionsRequired=["KHR_lights_punctual"],
        cameras=[{"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "zfar": 1, "znear": 0}},
                 {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.125}}],
        nodes=[{"mesh": 0},
               {"rotation": [-half, 0, 0, half], "scale": [5, 5, 5], **light(0)},  # -Z turned down
               {"translation": [1, 2, 3], **light(1)},
               {"translation": [4, 5, 6], "rotation": [0, half, 0, half], **light(2)},  # -Z turned to -X
               light(3),
               {"camera": 0},
               {"camera": 1, "translation": [0.5, 0.5, 10], "scale": [3, 3, 3]},
               {"camera": 1}],
        scenes=[{"nodes": list(range(8))}],
    )  # fmt: skip
    with pytest.warns(SceneWarning, match="a camera that is not perspective is left out"):
        scene = doc.load(tmp_path)
    sun, lamp, spot, wide = scene.lights
    assert isinstance(sun, DirectionalLight)
    assert np.allclose(np.array(sun.direction) / np.linalg.norm(sun.direction), (0, -1, 0))
    assert (sun.intensity, sun.color) == (1000, (1, 0.5, 0.25))
    assert lamp == PointLight((1, 2, 3), 1)
    assert isinstance(spot, SpotLight)
    assert (spot.position, spot.intensity, spot.inner_angle, spot.outer_angle) == ((4, 5, 6), 40, 0.1, 0.4)
    assert np.allclose(spot.direction, (-1, 0, 0))
    assert isinstance(wide, SpotLight)
    assert (wide.inner_angle, wide.outer_angle) == (0, 1.5)
    camera = scene.camera
    assert (camera.position, camera.fov, camera.near) == ((0.5, 0.5, 10), 0.7, 0.125)
    assert np.allclose(camera.target, (0.5, 0.5, 0))  # the depth of the middle of the square
    assert np.allclose(np.array(camera.up) / np.linalg.norm(camera.up), (0, 1, 0))


def light(index: int) -> dict[str, Any]:
    return {"extensions": {"KHR_lights_punctual": {"light": index}}}


# --- files that lie -----------------------------------------------------------------------------------------------


def setting(where: str, value: Any) -> Callable[[dict[str, Any]], None]:
    def change(record: Any) -> None:
        *steps, last = where.split(".")
        for step in steps:
            record = record[int(step) if isinstance(record, list) else step]
        record[int(last) if isinstance(record, list) else last] = value

    return change


LIES: list[tuple[str, Any, str]] = [
    ("accessors.0.count", 5, "accessors[0]: 5 elements end at byte 60, beyond the 48 bytes of its buffer view"),
    ("accessors.0.count", 10**18, "accessors[0]: 1000000000000000000 elements end at byte"),
    ("accessors.0.count", 0, "accessors[0].count: 0 is outside 1 …"),
    ("accessors.0.count", -3, "accessors[0].count: -3 is outside 1 …"),
    ("accessors.0.count", 1.5, "accessors[0].count: 1.5 is not a whole number"),
    ("accessors.0.count", "4", "accessors[0].count: '4' is not a whole number"),
    ("accessors.0.count", math.inf, "accessors[0].count: inf is not a whole number"),
    ("accessors.0.byteOffset", 4, "accessors[0]: 4 elements end at byte 52, beyond the 48 bytes"),
    ("accessors.0.byteOffset", -4, "accessors[0].byteOffset: -4 is outside 0 …"),
    ("accessors.0.componentType", 5130, "accessors[0].componentType: 5130 is no component type"),
    ("accessors.0.type", "MAT4", "accessors[0]: type 'MAT4' is not VEC3"),
    ("accessors.0.bufferView", 9, "accessors[0].bufferView: 9 is beyond the last of 2 bufferViews"),
    ("accessors.0", {"componentType": 5126, "type": "VEC3", "count": 10**9},
     "accessors[0].count: 1000000000 elements without a bufferView"),
    ("accessors.1.componentType", 5122, "meshes[0].primitives[0].indices: indices are not unsigned"),
    ("accessors.1.count", 5, "meshes[0].primitives[0]: 5 corners are not whole triangles"),
    ("bufferViews.0.byteStride", -12, "bufferViews[0].byteStride: -12 is outside 4 … 252"),
    ("bufferViews.0.byteStride", 2**40, "bufferViews[0].byteStride: 1099511627776 is outside 4 … 252"),
    ("bufferViews.0.byteStride", 8, "accessors[0]: its elements of 12 bytes overlap at a stride of 8"),
    ("bufferViews.0.byteStride", 20, "accessors[0]: 4 elements end at byte 72, beyond the 48 bytes"),
    ("bufferViews.0.byteLength", 10**12, "bufferViews[0]: ends at byte 1000000000000, beyond the 60 bytes"),
    ("buffers.0.byteLength", 10**12, "buffers[0]: byteLength 1000000000000 is more than the 60 bytes there are"),
    ("buffers.0.uri", "../../etc/passwd", "buffers[0].uri: '../../etc/passwd' is refused: it is outside the folder"),
    ("buffers.0.uri", "a/../../x", "is refused: it is outside the folder"),
    ("buffers.0.uri", "%2e%2e/x", "is refused: it is outside the folder"),
    ("buffers.0.uri", "..\\x", "is refused: it is outside the folder"),
    ("buffers.0.uri", "/etc/passwd", "is refused: only files in the folder of the scene are read"),
    ("buffers.0.uri", "http://host/x.bin", "is refused: only files in the folder of the scene are read"),
    ("buffers.0.uri", "file:///etc/passwd", "is refused: only files in the folder of the scene are read"),
    ("buffers.0.uri", "none.bin", "buffers[0].uri: 'none.bin': no such file"),
    ("buffers.0.uri", ".", "is a directory, not a file"),
    ("buffers.0.uri", "data:text/plain,hello", "buffers[0].uri: a data URI without base64 data"),
    ("buffers.0.uri", "data:;base64,###", "buffers[0].uri: a data URI that is not base64"),
    ("nodes.0.children", [0], "nodes[0].children[0]: node 0 is its own ancestor, or has two parents"),
    ("scenes.0.nodes", [0, 0], "scenes[0].nodes[1]: node 0 is its own ancestor, or has two parents"),
    ("scenes.0.nodes", [7], "scenes[0].nodes[0]: 7 is beyond the last of 1 nodes"),
    ("scenes.0.nodes", 3, "scenes[0].nodes: is not a list"),
    ("scene", 4, "scene: 4 is beyond the last of 1 scenes"),
    ("nodes.0", 3, "nodes[0]: is not an object"),
    ("nodes.0.mesh", "a", "nodes[0].mesh: 'a' is not a whole number"),
    ("nodes.0.scale", [1, 1], "nodes[0].scale: has 2 items, not 3"),
    ("nodes.0.scale", [1, "x", 1], "nodes[0].scale[1]: 'x' is not a number"),
    ("nodes.0.scale", [1, math.nan, 1], "nodes[0].scale[1]: nan is not a finite number"),
    ("nodes.0.rotation", [0, 0, 0, 0], "nodes[0]: rotation: (0, 0, 0, 0) is no rotation"),
    ("nodes.0.matrix", [1e300] * 15 + [1], "nodes[0]: matrix: its last row is not 0, 0, 0, 1"),
    ("nodes.0.extensions", {"KHR_lights_punctual": {"light": 0}}, "light: 0 is beyond the last of 0 lights"),
    ("meshes.0.primitives.0.mode", 9, "meshes[0].primitives[0].mode: 9 is outside 0 … 6"),
    ("meshes.0.primitives.0.attributes", {}, "meshes[0].primitives[0].attributes: has no 'POSITION'"),
    ("meshes.0.primitives.0.attributes.NORMAL", 1, "accessors[1]: type 'SCALAR' is not VEC3"),
    ("meshes.0.primitives.0.material", 0, "meshes[0].primitives[0].material: 0 is beyond the last of 0 materials"),
    ("meshes.0.primitives.0", {"attributes": {}, "extensions": {"KHR_draco_mesh_compression": {}}}, "Draco"),
    ("meshes.0.primitives", [], "has no triangles"),
    ("extensionsRequired", ["KHR_draco_mesh_compression"],
     "extensionsRequired[0]: the file needs KHR_draco_mesh_compression, which Tyndall does not read"),
    ("asset.version", "1.0", "asset: version 1.0 is not 2.0"),
    ("accessors", 5, "accessors: is not a list"),
]  # fmt: skip


@pytest.mark.parametrize(("where", "value", "message"), LIES, ids=range(len(LIES)))
def test_a_lie_is_one_line_with_its_path(doc: Document, tmp_path: Path, where: str, value: Any, message: str) -> None:
    doc.primitive()
    setting(where, value)(doc.json)
    with pytest.raises(SceneError) as caught:
        doc.load(tmp_path)
    assert message in str(caught.value)
    assert str(caught.value).startswith(f"{tmp_path / 'a.glb'}: ")
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("positions", "indices", "message"),
    [
        (SQUARE, np.array([0, 1, 4], np.uint8), "primitives[0].indices: index 4 is beyond the last of 4 vertices"),
        (SQUARE * np.float32(math.nan), HALVES, "POSITION: vertex 0: (nan, nan, nan) is not a position"),
        (SQUARE * np.float32(1e30), HALVES, "POSITION: vertex 1"),
        (SQUARE + np.float32(math.inf), HALVES, "POSITION: vertex 0"),
    ],
    ids=range(4),
)
def test_geometry_that_is_wrong(doc: Document, tmp_path: Path, positions: Any, indices: Any, message: str) -> None:
    doc.primitive(positions, indices)
    with pytest.raises(SceneError) as caught:
        doc.load(tmp_path)
    assert message in str(caught.value)


def test_degenerate_triangles_have_finite_normals(doc: Document, tmp_path: Path) -> None:
    doc.primitive(np.array([(1, 1, 1)] * 3 + [(0, 0, 0), (1e-30, 0, 0), (0, 1e-30, 0)], np.float32),
                  np.arange(6, dtype=np.uint8))  # fmt: skip
    normals = doc.load(tmp_path).instances[0].mesh.normals
    assert normals is not None
    assert np.allclose(np.linalg.norm(normals, axis=1), 1)


def test_a_long_cycle_and_a_deep_tree(doc: Document, tmp_path: Path) -> None:
    doc.primitive()
    count = 5000
    doc.json["nodes"] = [{"children": [i + 1]} for i in range(count)] + [{"mesh": 0}]
    assert len(doc.load(tmp_path).instances) == 1
    doc.json["nodes"][count]["children"] = [count // 2]
    with pytest.raises(SceneError, match="is its own ancestor"):
        doc.load(tmp_path)


def test_truncated_anywhere_a_glb_is_one_line(doc: Document, tmp_path: Path) -> None:
    doc.primitive()
    whole = doc.glb()
    path = tmp_path / "a.glb"
    for length in (1, 4, 12, 19, 20, 60, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(SceneError) as caught:
            load(path)
        assert "truncated" in str(caught.value) or "too few" in str(caught.value)


@pytest.mark.parametrize(
    ("at", "value", "message"),
    [
        (0, b"glTX", "does not begin with 'glTF'"),
        (4, b"\1\0\0\0", "is glTF 1; only version 2 is read"),
        (8, b"\xff\xff\xff\xff", "its header says 4294967295 bytes"),
        (12, b"\xff\xff\xff\xff", "the chunk at byte 12 says 4294967295 bytes"),
        (12, b"\0\0\0\0", "is truncated: the chunk at byte 20"),
        (16, b"JUNK", "has no JSON chunk"),
        (20, b"\xff", "not UTF-8 text (byte 0)"),
        (20, b"[", "not JSON"),
    ],
)
def test_chunks_that_lie(doc: Document, tmp_path: Path, at: int, value: bytes, message: str) -> None:
    doc.primitive()
    data = bytearray(doc.glb())
    data[at : at + len(value)] = value
    (tmp_path / "a.glb").write_bytes(data)
    with pytest.raises(SceneError) as caught:
        load(tmp_path / "a.glb")
    assert message in str(caught.value)


@pytest.mark.parametrize("text", ['{"a":' * 50_000, "[" * 50_000, '{"asset": ' + "9" * 5000 + "}", "[]", "3", "{}"])
def test_json_that_is_no_gltf(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.gltf").write_text(text)
    with pytest.raises(SceneError) as caught:
        load(tmp_path / "a.gltf")
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.filterwarnings("ignore::tyndall.scene.errors.SceneWarning")
def test_every_single_field_may_be_wrong(doc: Document, tmp_path: Path) -> None:
    """Whatever one value is replaced by, the file loads or is refused in one line; nothing else is raised."""
    primitive = doc.primitive(material=0)
    primitive["attributes"]["TEXCOORD_0"] = doc.accessor(SQUARE[:, :2].copy())
    doc.json.update(
        images=[{"bufferView": doc.view(png())}], samplers=[{"wrapS": 33071}], textures=[{"source": 0, "sampler": 0}],
        materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 1, 1, 1]},
                    "emissiveFactor": [0, 0, 0], "alphaMode": "MASK"}],
        cameras=[{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}],
        nodes=[{"mesh": 0, "camera": 0, "translation": [0, 0, 0], "rotation": [0, 0, 0, 1], **light(0)}],
        extensions={"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {"outerConeAngle": 0.5}}]}},
    )  # fmt: skip

    def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
        items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
        return [path] * bool(path) + [found for key, item in items for found in places(item, (*path, key))]

    original = doc.json
    refused = 0
    for path in places(original):
        for junk in (None, True, -1, 10**400, math.nan, "x", [[]], {"x": {}}):
            doc.json = copy.deepcopy(original)
            target: Any = doc.json
            for step in path[:-1]:
                target = target[step]
            target[path[-1]] = junk
            try:
                doc.load(tmp_path)
            except SceneError as error:
                assert len(str(error).splitlines()) == 1  # noqa: PT017 - both outcomes are right
                refused += 1
    assert refused > 400


# --- images that lie ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "images[0].bufferView: not a PNG, JPEG, WebP, BMP or TGA image"),
        (b"hello", "images[0].bufferView: not a PNG"),
        (png(64, 64)[:-40], "images[0].bufferView: a damaged image"),
        (png(9000, 9000, "1", 0), "images[0].bufferView: an image of 9000×9000 texels is larger"),
        (png(20000, 20000, "1", 0), "images[0].bufferView: an image of"),
    ],
    ids=range(5),
)
def test_bad_images_are_one_line(doc: Document, tmp_path: Path, data: bytes, message: str) -> None:
    doc.json.update(
        images=[{"bufferView": doc.view(data)}], textures=[{"source": 0}],
        materials=[{"normalTexture": {"index": 0}}],
    )  # fmt: skip
    doc.primitive(material=0)
    with pytest.raises(SceneError) as caught:
        doc.load(tmp_path)
    assert message in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
