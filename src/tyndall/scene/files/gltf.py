"""glTF 2.0, as ``.gltf`` with its files beside it and as ``.glb``.

Specification: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html. Read are the default scene's nodes, meshes
(triangles, strips, fans), metallic-roughness materials with their textures, the first perspective camera, and the
extensions in :data:`EXTENSIONS`. Float attributes of a GLB that are not interleaved are views of the mapped file.

What differs from the file, each told by a :class:`~tyndall.scene.errors.SceneWarning`: points and lines are left out;
blending becomes an alpha mask; skins and morph targets keep their rest pose; vertex colours, and textures with other
coordinates than the material's base colour, are left out. Occlusion textures have no use where light is computed.

A mirrored node (negative determinant) would turn front faces into back faces, so its mesh is mirrored instead, once
for all its instances: no transform that leaves this module mirrors.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.params import ParameterError
from tyndall.scene.errors import SceneError, SceneWarning
from tyndall.scene.files.cursor import Cursor
from tyndall.scene.files.source import (
    MAX_COORDINATE,
    MAX_TEXELS,
    decode_image,
    map_bytes,
    read_uri,
    usable_normals,
)
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    Image,
    Instance,
    Light,
    Material,
    Mesh,
    PointLight,
    Scene,
    SpotLight,
    Texture,
    vertex_normals,
)

EXTENSIONS = {
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
}
"""What a file may require. An unlit material is lit: the light is what this is about."""

Matrix = NDArray[np.float64]

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_WRAPS = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_MODES = {0: "points", 1: "lines", 2: "line loops", 3: "line strips"}
_MAX_ZEROS = 1 << 20  # elements of an accessor without data, which costs the file nothing
_ALL_TEXELS = 4 * MAX_TEXELS  # of all images of a file together: 1 GiB


def load(path: Path) -> Scene:
    """Read a glTF file. See :func:`tyndall.scene.files.load`."""
    data = map_bytes(path)
    if path.suffix.lower() == ".glb" or data[:4].tobytes() == b"glTF":
        text, binary = _glb_chunks(path, data)
    else:
        text, binary = data.tobytes(), None
    if not text.strip():
        raise SceneError(path, "is empty")
    return _Reader(path, Cursor.parse(path, text), binary).scene()


def _glb_chunks(path: Path, data: NDArray[np.uint8]) -> tuple[bytes, NDArray[np.uint8] | None]:
    """The JSON and the binary chunk of a GLB (specification, 4.4)."""
    if len(data) < 20:
        raise SceneError(path, f"is not a GLB: {len(data)} bytes are too few")
    magic, version, length = data[:12].view("<u4")
    if magic != 0x46546C67:
        raise SceneError(path, "is not a GLB: it does not begin with 'glTF'")
    if version != 2:
        raise SceneError(path, f"is glTF {version}; only version 2 is read")
    if length > len(data):
        raise SceneError(path, f"is truncated: its header says {length} bytes, and there are {len(data)}")
    chunks: dict[int, NDArray[np.uint8]] = {}
    at = 12
    while at + 8 <= length:
        size, kind = (int(x) for x in data[at : at + 8].view("<u4"))
        if at + 8 + size > length:
            raise SceneError(
                path, f"is truncated: the chunk at byte {at} says {size} bytes, {length - at - 8} are left"
            )
        chunks.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + -(-size // 4) * 4
    if 0x4E4F534A not in chunks:
        raise SceneError(path, "has no JSON chunk")
    return chunks[0x4E4F534A].tobytes(), chunks.get(0x004E4942)


class _Reader:
    """One file: its tables, and what was made of their rows so far."""

    def __init__(self, path: Path, root: Cursor, binary: NDArray[np.uint8] | None) -> None:
        self.path, self.root, self.binary = path, root, binary
        names = "accessors bufferViews buffers cameras images materials meshes nodes samplers scenes textures"
        self.tables = {name: root.items(name) for name in names.split()}
        self.lights = root.object("extensions", "KHR_lights_punctual").items("lights")
        self._made: dict[Any, Any] = {}
        self._texels = 0
        self._check_version()

    def _check_version(self) -> None:
        asset = self.root.object("asset")
        version = asset.text("minVersion", asset.text("version", "2.0"))
        if not version.startswith("2."):
            asset.stop(f"version {version[:20]} is not 2.0")
        for required in self.root.items("extensionsRequired"):
            if required.value not in EXTENSIONS:
                required.stop(f"the file needs {required.value}, which Tyndall does not read")

    def _warn(self, where: str, message: str) -> None:
        warnings.warn(f"{self.path}: {where}: {message}", SceneWarning, stacklevel=2)

    def _once(self, key: Any, make: Callable[[], Any]) -> Any:
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]

    def _row(self, reference: Cursor, table: str) -> tuple[int, Cursor]:
        """The row of a table that ``reference`` names by its index."""
        index = reference.as_index(self.tables[table], table)
        return index, self.tables[table][index].object()

    # --- bytes ----------------------------------------------------------------------------------------------------

    def _buffer(self, reference: Cursor) -> NDArray[np.uint8]:
        index, row = self._row(reference, "buffers")

        def read() -> NDArray[np.uint8]:
            uri = row.get("uri")
            if uri is None:
                data = self.binary if index == 0 else None
                if data is None:
                    row.stop("has no uri, and the file has no binary chunk for it")
            else:
                try:
                    data = read_uri(self.path, row.text("uri"))
                except ValueError as error:
                    uri.stop(str(error))
            length = row.need("byteLength").as_int()
            if length > len(data):
                row.stop(f"byteLength {length} is more than the {len(data)} bytes there are")
            return data[:length]

        data: NDArray[np.uint8] = self._once(("buffer", index), read)
        return data

    def _view(self, reference: Cursor) -> tuple[NDArray[np.uint8], int]:
        """The bytes of a buffer view, and its stride (0: none given)."""
        _, row = self._row(reference, "bufferViews")
        buffer = self._buffer(row.need("buffer"))
        offset, length = row.integer("byteOffset", 0), row.need("byteLength").as_int()
        if offset + length > len(buffer):
            row.stop(f"ends at byte {offset + length}, beyond the {len(buffer)} bytes of its buffer")
        stride = row.get("byteStride")
        return buffer[offset : offset + length], 0 if stride is None else stride.as_int(4, 252)

    def _elements(self, row: Cursor, view: Cursor, dtype: np.dtype[Any], width: int, count: int) -> NDArray[Any]:
        """``count`` rows of ``width`` components out of a buffer view, without a copy."""
        data, stride = self._view(view)
        offset = row.integer("byteOffset", 0)
        size = width * dtype.itemsize
        stride = stride or size
        if stride < size:
            row.stop(f"its elements of {size} bytes overlap at a stride of {stride}")
        end = offset + (count - 1) * stride + size
        if end > len(data):
            row.stop(f"{count} elements end at byte {end}, beyond the {len(data)} bytes of its buffer view")
        return np.ndarray((count, width), dtype, data, offset, (stride, dtype.itemsize))

    def _accessor(self, reference: Cursor, *types: str) -> NDArray[Any]:
        """Elements (count, components): float32 where they are floats or normalized, else the file's own integers."""
        index, row = self._row(reference, "accessors")
        if row.text("type") not in types:
            row.stop(f"type '{row.text('type')[:20]}' is not {' or '.join(types)}")
        elements: NDArray[Any] = self._once(("accessor", index), lambda: self._read_accessor(row))
        return elements

    def _read_accessor(self, row: Cursor) -> NDArray[Any]:
        component = row.need("componentType")
        if component.as_int() not in _COMPONENTS:
            component.stop(f"{component.value} is no component type")
        dtype = np.dtype(_COMPONENTS[component.as_int()])
        width, count = _WIDTHS[row.text("type")], row.need("count").as_int(1)
        view = row.get("bufferView")
        if view is not None:
            elements = self._elements(row, view, dtype, width, count)
        elif count > _MAX_ZEROS:
            row.need("count").stop(f"{count} elements without a bufferView")
        else:
            elements = np.zeros((count, width), dtype)
        sparse = row.get("sparse")
        if sparse is not None:
            elements = self._overlay(sparse, elements, dtype, width)
        if row.flag("normalized") and dtype.kind in "iu":
            elements = np.maximum(elements.astype(np.float32) / np.iinfo(dtype).max, np.float32(-1))
        return elements

    def _overlay(self, sparse: Cursor, elements: NDArray[Any], dtype: np.dtype[Any], width: int) -> NDArray[Any]:
        """Sparse accessor (specification, 3.6.2.3): some elements are replaced."""
        count = sparse.need("count").as_int(1)
        where, what = sparse.need("indices"), sparse.need("values")
        component = where.need("componentType").as_int()
        if component not in (5121, 5123, 5125):
            where.stop(f"componentType {component} is not that of an index")
        places = self._elements(where, where.need("bufferView"), np.dtype(_COMPONENTS[component]), 1, count)[:, 0]
        values = self._elements(what, what.need("bufferView"), dtype, width, count)
        if places.max() >= len(elements):
            where.stop(f"{places.max()} is beyond the last of {len(elements)} elements")
        result = elements.copy()
        result[places] = values
        return result

    # --- materials ------------------------------------------------------------------------------------------------

    def _image(self, reference: Cursor) -> Image:
        index, row = self._row(reference, "images")

        def read() -> Image:
            view, uri = row.get("bufferView"), row.get("uri")
            try:
                data = self._view(view)[0] if view is not None else read_uri(self.path, row.text("uri"))
                image = decode_image(data, row.text("name"))
            except SceneError:
                raise
            except ValueError as error:
                (uri or view or row).stop(str(error))
            self._texels += image.pixels.size // 4
            if self._texels > _ALL_TEXELS:
                row.stop(f"the images of the file have more than {_ALL_TEXELS} texels together")
            return image

        image: Image = self._once(("image", index), read)
        return image

    def _texture(self, info: Cursor) -> Texture | None:
        """The texture of a texture info, with its sampler and transform."""
        _, row = self._row(info.need("index"), "textures")
        source = row.object("extensions", "EXT_texture_webp").get("source") or row.get("source")
        if source is None:
            self._warn(row.where, "a texture whose image only an extension gives is left out")
            return None
        sampler = row.get("sampler")
        settings = self._row(sampler, "samplers")[1] if sampler is not None else Cursor(self.path, row.where, {})
        wraps = []
        for key in ("wrapS", "wrapT"):
            wrap = settings.integer(key, 10497)
            if wrap not in _WRAPS:
                settings.stop(f"{key} {wrap} is not one of {', '.join(map(str, _WRAPS))}")
            wraps.append(_WRAPS[wrap])
        transform = info.object("extensions", "KHR_texture_transform")
        sampling: tuple[Any, ...] = (
            *wraps,
            "nearest" if settings.integer("magFilter", 9729) == 9728 else "linear",
            transform.numbers("offset", (0.0, 0.0)),
            transform.number("rotation", 0.0),
            transform.numbers("scale", (1.0, 1.0)),
        )
        image = self._image(source)
        texture: Texture = self._once(("texture", id(image), sampling), lambda: Texture(image, *sampling))
        return texture

    def _material(self, reference: Cursor | None) -> tuple[Material, int]:
        """A material, and the set of texture coordinates that its textures use."""
        if reference is None:
            plain = Material(base_color=(1.0, 1.0, 1.0, 1.0), metallic=1.0, roughness=1.0)
            return self._once(("material", None), lambda: (plain, 0))  # type: ignore[no-any-return]
        index, row = self._row(reference, "materials")
        return self._once(("material", index), lambda: self._read_material(row))  # type: ignore[no-any-return]

    def _read_material(self, row: Cursor) -> tuple[Material, int]:
        surface = row.object("pbrMetallicRoughness")
        infos = {
            "base_color_texture": surface.get("baseColorTexture"),
            "metallic_roughness_texture": surface.get("metallicRoughnessTexture"),
            "normal_texture": row.get("normalTexture"),
            "emissive_texture": row.get("emissiveTexture"),
        }
        maps: dict[str, Any] = {}
        uv_set: int | None = None
        for name, info in infos.items():
            if info is None:
                continue
            chosen = info.object("extensions", "KHR_texture_transform").get("texCoord") or info.get("texCoord")
            wanted = 0 if chosen is None else chosen.as_int()
            if uv_set is not None and wanted != uv_set:
                self._warn(info.where, f"a texture with a second set of coordinates ({wanted}) is left out")
                continue
            maps[name] = self._texture(info)
            uv_set = wanted
        mode = row.text("alphaMode", "OPAQUE")
        if mode not in ("OPAQUE", "MASK", "BLEND"):
            row.stop(f"alphaMode '{mode[:20]}' is not one of 'OPAQUE', 'MASK', 'BLEND'")
        if mode == "BLEND":
            self._warn(row.where, "alphaMode BLEND is drawn as MASK")
        strength = row.object("extensions", "KHR_materials_emissive_strength").number("emissiveStrength", 1.0)
        ior = row.object("extensions", "KHR_materials_ior").number("ior", 1.5)
        try:
            material = Material(
                name=row.text("name"),
                base_color=surface.numbers("baseColorFactor", (1.0, 1.0, 1.0, 1.0)),  # type: ignore[arg-type]
                metallic=surface.number("metallicFactor", 1.0),
                roughness=surface.number("roughnessFactor", 1.0),
                emissive=tuple(  # type: ignore[arg-type]
                    strength * e for e in row.numbers("emissiveFactor", (0.0, 0.0, 0.0))
                ),
                alpha_mode="opaque" if mode == "OPAQUE" else "mask",
                alpha_cutoff=row.number("alphaCutoff", 0.5),
                double_sided=row.flag("doubleSided"),
                transmission=row.object("extensions", "KHR_materials_transmission").number("transmissionFactor", 0.0),
                ior=ior or 1.5,  # 0 asks for a mirror at every angle in older files
                **maps,
            )
        except ParameterError as error:
            row.stop(str(error))
        return material, uv_set or 0

    # --- meshes ---------------------------------------------------------------------------------------------------

    def _meshes(self, reference: Cursor, mirrored: bool) -> list[Mesh]:
        """A mesh's primitives, one mesh each; ``mirrored`` in x where the transform would mirror them."""
        index, row = self._row(reference, "meshes")

        def read() -> list[Mesh]:
            return [m for p in row.items("primitives") if (m := self._primitive(p, row.text("name"))) is not None]

        meshes: list[Mesh] = self._once(("mesh", index), read)
        if mirrored:
            meshes = self._once(("mirrored", index), lambda: [_mirrored(m) for m in meshes])
        return meshes

    def _primitive(self, row: Cursor, name: str) -> Mesh | None:
        mode = row.integer("mode", _TRIANGLES, 0, 6)
        if mode in _MODES:
            self._warn(row.where, f"{_MODES[mode]} are left out")
            return None
        attributes = row.object("attributes")
        if "KHR_draco_mesh_compression" in row.object("extensions").value and attributes.get("POSITION") is None:
            row.stop("is compressed by Draco, which Tyndall does not read")
        place = attributes.need("POSITION")
        positions = self._accessor(place, "VEC3").astype(np.float32, copy=False)
        if not np.abs(positions).max() <= MAX_COORDINATE:  # one comparison that NaN fails, too
            bad = ~(np.abs(positions) <= MAX_COORDINATE).all(axis=1)
            vertex = int(np.argmax(bad))
            place.stop(f"vertex {vertex}: {tuple(map(float, positions[vertex]))} is not a position")
        indices = self._triangles(row, mode, len(positions))
        if not len(indices):
            self._warn(row.where, "has no triangles")
            return None
        if int(indices.max()) >= len(positions):
            (row.get("indices") or row).stop(f"index {indices.max()} is beyond the last of {len(positions)} vertices")
        material, uv_set = self._material(row.get("material"))
        for left_out in ("COLOR_0", "JOINTS_0"):
            if attributes.get(left_out) is not None:
                self._warn(row.where, f"{left_out} is left out")
        if row.items("targets"):
            self._warn(row.where, "morph targets are left out")
        normals = self._attribute(attributes, "NORMAL", ("VEC3",), len(positions))
        if normals is not None:
            normals = usable_normals(normals, lambda: vertex_normals(positions, indices))
        uvs = self._attribute(attributes, f"TEXCOORD_{uv_set}", ("VEC2",), len(positions))
        if uvs is not None and not np.isfinite(uvs).all():
            attributes.stop(f"TEXCOORD_{uv_set}: a coordinate is not finite")
        try:
            return Mesh(positions, indices, normals, uvs, material, name)
        except ParameterError as error:
            row.stop(str(error))

    def _attribute(
        self, attributes: Cursor, name: str, types: tuple[str, ...], count: int
    ) -> NDArray[np.float32] | None:
        reference = attributes.get(name)
        if reference is None:
            return None
        values = self._accessor(reference, *types).astype(np.float32, copy=False)
        if len(values) != count:
            reference.stop(f"{len(values)} for {count} vertices")
        return values

    def _triangles(self, row: Cursor, mode: int, vertices: int) -> NDArray[np.uint32]:
        """(T, 3) indices of a triangle list, strip or fan (specification, 3.7.2.1)."""
        reference = row.get("indices")
        if reference is None:
            flat: NDArray[Any] = np.arange(vertices, dtype=np.uint32)
        else:
            flat = self._accessor(reference, "SCALAR")[:, 0]
            if flat.dtype.kind != "u":
                reference.stop("indices are not unsigned whole numbers")
            flat = flat.astype(np.uint32, copy=False)
        if mode == _TRIANGLES:
            if len(flat) % 3:
                row.stop(f"{len(flat)} corners are not whole triangles")
            return flat.reshape(-1, 3)
        if len(flat) < 3:
            return np.zeros((0, 3), np.uint32)
        if mode == _FAN:
            corners = np.stack([flat[1:-1], flat[2:], np.full(len(flat) - 2, flat[0])], axis=1)
        else:
            corners = np.stack([flat[:-2], flat[1:-1], flat[2:]], axis=1)
            corners[1::2, 1:] = corners[1::2, :0:-1]
        a, b, c = corners.T
        triangles: NDArray[np.uint32] = corners[(a != b) & (b != c) & (c != a)]
        return triangles

    # --- nodes ----------------------------------------------------------------------------------------------------

    def _roots(self) -> list[Cursor]:
        """References to the default scene's root nodes; without scenes, to the nodes that are nobody's child."""
        if not self.tables["scenes"]:
            children = {c.value for n in self.tables["nodes"] for c in n.object().items("children") if c.as_int() >= 0}
            names = [i for i in range(len(self.tables["nodes"])) if i not in children]
            return [Cursor(self.path, f"nodes[{i}]", i) for i in names]
        chosen = self.root.get("scene") or Cursor(self.path, "scenes[0]", 0)
        return self._row(chosen, "scenes")[1].items("nodes")

    def scene(self) -> Scene:
        """The default scene."""
        instances: list[Instance] = []
        lights: list[Light] = []
        cameras: list[tuple[Cursor, Matrix]] = []
        seen: set[int] = set()
        pending = [(root, np.eye(4)) for root in reversed(self._roots())]
        while pending:
            reference, parent = pending.pop()
            index, node = self._row(reference, "nodes")
            if index in seen:
                reference.stop(f"node {index} is its own ancestor, or has two parents")
            seen.add(index)
            world = parent @ self._transform(node)
            if not np.isfinite(world).all():
                node.stop("its transform is not finite")
            if (mesh := node.get("mesh")) is not None:
                instances += self._instances(node, mesh, world)
            if (light := node.object("extensions", "KHR_lights_punctual").get("light")) is not None:
                lights.append(self._light(light, world))
            if (camera := node.get("camera")) is not None:
                row = self._row(camera, "cameras")[1]
                if row.text("type") == "perspective":
                    cameras.append((row.object("perspective"), world))
                else:
                    self._warn(row.where, "a camera that is not perspective is left out")
            if node.get("skin") is not None:
                self._warn(node.where, "a skin is left out; the mesh keeps its rest pose")
            pending += [(child, world) for child in reversed(node.items("children"))]
        if not instances:
            raise SceneError(self.path, "has no triangles")
        scene = Scene(tuple(instances), tuple(lights), name=self.path.stem)
        return scene.with_(camera=self._camera(*cameras[0], scene)) if cameras else scene

    def _transform(self, node: Cursor) -> Matrix:
        if node.get("matrix") is not None:
            matrix = np.array(node.numbers("matrix", (0.0,) * 16)).reshape(4, 4).T
            if not np.array_equal(matrix[3], (0, 0, 0, 1)):
                node.stop("matrix: its last row is not 0, 0, 0, 1")
            return matrix
        if not node.value.keys() & {"translation", "rotation", "scale"}:
            return np.eye(4)
        rotation = np.array(node.numbers("rotation", (0.0, 0.0, 0.0, 1.0)))
        if not rotation.any():
            node.stop("rotation: (0, 0, 0, 0) is no rotation")
        translation = np.array(node.numbers("translation", (0.0, 0.0, 0.0)))
        scale = np.array(node.numbers("scale", (1.0, 1.0, 1.0)))
        matrices: Matrix = _trs(translation[None], rotation[None], scale[None])[0]
        return matrices

    def _instances(self, node: Cursor, mesh: Cursor, world: Matrix) -> list[Instance]:
        transforms = world[None]
        copies = node.object("extensions", "EXT_mesh_gpu_instancing").get("attributes")
        if copies is not None:
            transforms = world @ self._copies(copies)
        instances = []
        name = node.text("name")
        with np.errstate(over="ignore", invalid="ignore"):
            determinants = np.linalg.det(transforms[:, :3, :3])
        for matrix, determinant in zip(transforms, determinants, strict=True):
            if not np.isfinite(matrix).all() or not np.isfinite(determinant):
                node.stop("its transform is not finite")
            if determinant == 0:
                self._warn(node.where, "its transform flattens the mesh, which is left out")
                continue
            if determinant < 0:
                matrix = matrix @ np.diag((-1.0, 1.0, 1.0, 1.0))
            instances += [Instance(m, _rows(matrix), name) for m in self._meshes(mesh, bool(determinant < 0))]
        return instances

    def _copies(self, attributes: Cursor) -> Matrix:
        """The (N, 4, 4) transforms of EXT_mesh_gpu_instancing."""
        widths = {"TRANSLATION": ("VEC3", (0.0, 0.0, 0.0)), "ROTATION": ("VEC4", (0.0, 0.0, 0.0, 1.0)),
                  "SCALE": ("VEC3", (1.0, 1.0, 1.0))}  # fmt: skip
        given = {name: attributes.get(name) for name in widths}
        values = {n: self._accessor(c, widths[n][0]).astype(np.float64) for n, c in given.items() if c is not None}
        counts = {len(v) for v in values.values()}
        if len(counts) != 1:
            attributes.stop("its attributes do not all have one and the same count")
        count = counts.pop()
        whole = {
            n: values.get(n, np.broadcast_to(default, (count, len(default)))) for n, (_, default) in widths.items()
        }
        if not all(np.isfinite(v).all() for v in whole.values()) or not whole["ROTATION"].any(axis=1).all():
            attributes.stop("a transform is not finite")
        return _trs(whole["TRANSLATION"], whole["ROTATION"], whole["SCALE"])

    # --- lights and camera ----------------------------------------------------------------------------------------

    def _light(self, reference: Cursor, world: Matrix) -> Light:
        """KHR_lights_punctual: a light shines along its node's -Z; scale does not touch it."""
        index = reference.as_index(self.lights, "lights")
        row = self.lights[index].object()
        kind = row.text("type")
        shared: dict[str, Any] = {
            "intensity": row.number("intensity", 1.0),
            "color": row.numbers("color", (1.0, 1.0, 1.0)),
        }
        position, direction = tuple(world[:3, 3]), tuple(-world[:3, 2])
        if kind not in ("directional", "point", "spot"):
            row.stop(f"type '{kind[:20]}' is not one of 'directional', 'point', 'spot'")
        try:
            if kind == "directional":
                return DirectionalLight(direction=direction, **shared)
            if kind == "point":
                return PointLight(position=position, **shared)
            cone = row.object("spot")
            inner, outer = cone.number("innerConeAngle", 0.0), cone.number("outerConeAngle", math.pi / 4)
            if 1.5 < outer <= math.pi / 2 + 1e-6:
                outer = 1.5  # a cone of exactly a half space has no shadow map
                inner = min(inner, 1.499)
            return SpotLight(position=position, direction=direction, inner_angle=inner, outer_angle=outer, **shared)
        except ParameterError as error:
            row.stop(str(error))

    def _camera(self, lens: Cursor, world: Matrix, scene: Scene) -> Camera:
        """A camera looks along its node's -Z; its target is put at the depth of the middle of the scene."""
        position = world[:3, 3]
        up, forward = world[:3, 1], -world[:3, 2]
        length = np.linalg.norm(forward)
        if not length > 0:
            lens.stop("its node flattens it")
        forward = forward / length
        low, high = scene.bounds
        depth = float(np.dot((low + high) / 2 - position, forward))
        reach = max(depth, 0.05 * float(np.linalg.norm(high - low)), 1e-3)
        try:
            return Camera(
                position=tuple(position),
                target=tuple(position + reach * forward),
                up=tuple(up),
                fov=lens.need("yfov").as_number(),
                near=lens.number("znear", 0.01),
            )
        except ParameterError as error:
            lens.stop(str(error))


def _trs(translation: Matrix, rotation: Matrix, scale: Matrix) -> Matrix:
    """(N, 4, 4) matrices T·R·S of translations (N, 3), quaternions x, y, z, w (N, 4) and scales (N, 3)."""
    x, y, z, w = (rotation / np.linalg.norm(rotation, axis=1, keepdims=True)).T
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    result = np.zeros((len(translation), 4, 4))
    result[:, :3, :3] = np.moveaxis(turn, 2, 0) * scale[:, None, :]
    result[:, :3, 3] = translation
    result[:, 3, 3] = 1
    return result


def _rows(matrix: Matrix) -> Any:
    return tuple(tuple(row) for row in matrix.tolist())


def _mirrored(mesh: Mesh) -> Mesh:
    """The mesh with x negated, its triangles turned round so that they still face outwards."""
    mirror = np.array((-1, 1, 1), np.float32)
    normals = None if mesh.normals is None else mesh.normals * mirror
    return Mesh(mesh.positions * mirror, mesh.indices[:, ::-1], normals, mesh.uvs, mesh.material, mesh.name)
