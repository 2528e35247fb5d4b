"""Triangle meshes on the device.

All meshes share one position stream (12 bytes a vertex; all that a solid mesh needs in a shadow map), one attribute
stream (normal as snorm16, texture coordinate as float32; 16 bytes) and one index buffer; the three are vertex and
index buffers, so a storage binding's limit does not bound them. Instances of a mesh are one draw. What is drawn is
recorded once into render bundles and replayed, so a frame's host cost does not grow with the number of meshes.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tyndall.content.contract import PLANE_FORMAT, SHADE_TARGET, Casters, Cull, Prepared
from tyndall.content.outline import Outline, Placed
from tyndall.content.rasterize import Triangles
from tyndall.gpu.device import Blend, Gpu, Raster
from tyndall.gpu.resources import Bound, Buffer, Resource, Texture
from tyndall.scene.model import Material, Mesh, Scene
from tyndall.scene.model import Texture as SceneTexture

MODULE = "package::content::mesh"
OWNER = "mesh"

GBUFFER_TARGETS: tuple[tuple[str, Blend | None], ...] = (
    ("rgba16float", None),
    ("rgba8unorm", None),  # the square root of the colour: compute cannot write sRGB
    ("rgba16float", None),
)
MAP_FORMAT = "depth32float"

_POSITION = (12, ((0, "float32x3", 0),))
_ATTRIBUTES = (16, ((1, "snorm16x4", 0), (2, "float32x2", 8)))
MAPS = ("base_color", "metallic_roughness", "normal", "emissive")
_ADDRESS = {"repeat": "repeat", "clamp": "clamp-to-edge", "mirror": "mirror-repeat"}


@dataclass(frozen=True, eq=False)
class _Draw:
    mesh: Mesh
    mirrored: bool
    first_index: int
    base_vertex: int
    first_instance: int
    transforms: tuple[NDArray[np.float64], ...]

    @property
    def material(self) -> Material:
        return self.mesh.material

    @property
    def is_masked(self) -> bool:
        """Whether its material has holes."""
        return self.material.alpha_mode == "mask"

    def placements(self) -> list[Placed]:
        """Each of its instances."""
        return [
            Placed(self.mesh, self.first_index, self.base_vertex, self.first_instance + i, self.mirrored, transform)
            for i, transform in enumerate(self.transforms)
        ]


_TURNED: Mapping[Cull, Cull] = {"none": "none", "front": "back", "back": "front"}
_BOUND = {
    "gbuffer": ("camera",),
    "depth": ("shadow_layers", "layer"),
    "flattened": ("camera", "flattenings", "flattening"),
    "silhouette": ("silhouettes", "layer"),
}


@dataclass(frozen=True)
class _Way:
    """A way to draw meshes: what for, the faces that are left out, how many images at once, and the depth's format."""

    kind: Literal["gbuffer", "depth", "flattened", "silhouette"]
    cull: Cull = "none"
    targets: int = 0
    depth: str = MAP_FORMAT

    def program(self, masked: bool) -> tuple[Raster, str, str | None]:
        """State, vertex and fragment entry point."""
        streams = (_POSITION, _ATTRIBUTES) if masked else (_POSITION,)
        shade = (SHADE_TARGET,) * self.targets
        match self.kind:
            case "gbuffer":
                targets = GBUFFER_TARGETS[: self.targets]
                state = Raster(targets=targets, depth=self.depth, vertex_buffers=(_POSITION, _ATTRIBUTES))
                return state, "vertex", "fragment"
            case "depth":
                state = Raster(depth=self.depth, vertex_buffers=streams)
                return (state, "depth_vertex", "depth_fragment") if masked else (state, "solid_depth_vertex", None)
            case "flattened":
                state = Raster(
                    targets=shade, depth=self.depth, depth_compare="equal", depth_write=False, vertex_buffers=streams
                )
                return state, "flat_vertex", "flat_fragment"
            case "silhouette":
                return Raster(targets=shade, vertex_buffers=streams), "silhouette_vertex", "silhouette_fragment"


class Meshes:
    """The meshes of a scene on the device.

    Attributes:
        positions, attributes, indices: the streams of all meshes.
        materials: ``MaterialData`` of each material.
        placed: by a mesh's ``id``, its first index and first vertex in the streams.
        material_of: by a mesh's ``id``, its material's row.
        material_list: the materials in the order of their rows.
        emits: whether a material does, so that the G-buffer has a target for it.
    """

    def __init__(self, gpu: Gpu, scene: Scene) -> None:
        self._gpu = gpu
        self._bundles: dict[Any, Any] = {}
        self._textures: dict[Any, Texture] = {}
        self._buffers: list[Buffer] = []
        self._draws: list[_Draw] = []
        self._maps: dict[int, dict[str, Bound]] = {}
        self._outline: Outline | None = None
        self._outlined = False
        self._triangles: Triangles | None = None
        self._lock = threading.RLock()  # renderers beside each other share what is made on first use
        try:
            self._upload(scene)
        except BaseException:
            self.close()
            raise

    def _buffer(self, label: str, data: NDArray[Any] | int, **kwargs: Any) -> Buffer:
        buffer = self._gpu.buffer(f"mesh.{label}", data, owner=OWNER, **kwargs)
        self._buffers.append(buffer)
        return buffer

    def _upload(self, scene: Scene) -> None:
        gpu = self._gpu
        groups: dict[tuple[int, bool], list[NDArray[np.float64]]] = {}
        meshes: dict[int, Mesh] = {}
        for instance in scene.instances:
            matrix = np.asarray(instance.transform, np.float64)
            mirrored = bool(np.linalg.det(matrix[:3, :3]) < 0)
            meshes[id(instance.mesh)] = instance.mesh
            groups.setdefault((id(instance.mesh), mirrored), []).append(matrix)

        materials: dict[int, Material] = {}
        for mesh in meshes.values():
            materials.setdefault(id(mesh.material), mesh.material)
        material_index = {key: i for i, key in enumerate(materials)}
        self.material_list = list(materials.values())
        self.emits = any(any(material.emissive) for material in self.material_list)
        self.material_of = {key: material_index[id(mesh.material)] for key, mesh in meshes.items()}

        vertex_total = sum(len(m.positions) for m in meshes.values())
        index_total = sum(m.indices.size for m in meshes.values())
        self.positions = self._buffer("positions", 12 * vertex_total, usage="vertex storage")
        self.attributes = self._buffer("attributes", 16 * vertex_total, usage="vertex storage")
        self.indices = self._buffer("indices", 4 * index_total, usage="index storage")
        self.placed: dict[int, tuple[int, int]] = {}
        vertex = index = 0
        for key, mesh in meshes.items():
            gpu.write(self.positions, _centred(mesh), 12 * vertex)
            gpu.write(self.attributes, _attributes(mesh), 16 * vertex)
            gpu.write(self.indices, mesh.indices, 4 * index)
            self.placed[key] = (index, vertex)
            vertex += len(mesh.positions)
            index += mesh.indices.size

        count = len(scene.instances)
        rows = np.zeros(max(1, count), gpu.dtype(f"{MODULE}::InstanceData"))
        first = 0
        for (key, mirrored), matrices in groups.items():
            mesh = meshes[key]
            stop = first + len(matrices)
            world = from_origin(np.stack(matrices), np.broadcast_to(origin_of(mesh), (len(matrices), 3)))
            rows["world"][first:stop] = world.transpose(0, 2, 1)
            rows["normal"][first:stop, :, :3] = normal_columns(world[:, :3, :3])
            rows["material"][first:stop] = self.material_of[key]
            first_index, first_vertex = self.placed[key]
            self._draws.append(_Draw(mesh, mirrored, first_index, first_vertex, first, tuple(matrices)))
            first = stop
        self._instances = self._buffer("instances", rows, element=f"{MODULE}::InstanceData")
        self.materials = self._buffer(
            "materials", self._pack_materials(self.material_list), element=f"{MODULE}::MaterialData"
        )
        self._maps = {key: self._bind_maps(material) for key, material in materials.items()}

    def _pack_materials(self, materials: list[Material]) -> NDArray[Any]:
        rows = np.zeros(max(1, len(materials)), self._gpu.dtype(f"{MODULE}::MaterialData"))
        for row, m in zip(rows, materials, strict=False):
            row["base_color"], row["emissive"] = m.base_color, m.emissive
            row["metallic"], row["roughness"] = m.metallic, m.roughness
            row["alpha_cutoff"] = m.alpha_cutoff if m.alpha_mode == "mask" else 0.0
            for name in MAPS:
                row[f"{name}_uv"] = _uv_columns(getattr(m, f"{name}_texture"))
        return rows

    def _bind_maps(self, material: Material) -> dict[str, Bound]:
        gpu = self._gpu
        bound: dict[str, Bound] = {}
        for name in MAPS:
            texture: SceneTexture | None = getattr(material, f"{name}_texture")
            srgb = name in ("base_color", "emissive")
            bound[f"{name}_map"] = self._texture(texture, srgb).sampled()
            bound[f"{name}_sampler"] = (
                gpu.sampler()
                if texture is None
                else gpu.sampler(filter=texture.filter, u=_ADDRESS[texture.wrap_u], v=_ADDRESS[texture.wrap_v])
            )
        return bound

    def _texture(self, texture: SceneTexture | None, srgb: bool) -> Texture:
        key = (None if texture is None else id(texture.image), srgb)
        if key not in self._textures:
            pixels = np.full((1, 1, 4), 255, np.uint8) if texture is None else texture.image.pixels
            label = "white" if texture is None else f"texture {texture.image.name}"
            levels = _mip_chain(pixels, srgb)
            format = "rgba8unorm-srgb" if srgb else "rgba8unorm"
            height, width = pixels.shape[:2]
            made = self._gpu.texture(
                f"mesh.{label}", (width, height), format, owner=OWNER, usage="sampled", mips=len(levels)
            )
            for mip, level in enumerate(levels):
                self._gpu.write_texture(made, level, mip=mip)
            self._textures[key] = made
        return self._textures[key]

    # --- drawing --------------------------------------------------------------------------------------------------

    def draw_gbuffer(self, native_pass: Any, scope: Mapping[str, Bound], *, emissive: bool) -> None:
        """Draw into the G-buffer; ``scope`` binds ``camera``."""
        count = len(GBUFFER_TARGETS) if emissive else 2
        self._replay(native_pass, _Way("gbuffer", "back", count, self._gpu.depth_format), scope)

    def march_gbuffer(self, scope: Mapping[str, Bound], depth: Texture | None, *, emissive: bool, alone: bool) -> None:
        """Nothing: all of it is drawn."""

    def prepare(self, what: Prepared, scope: Mapping[str, Bound], size: tuple[int, int], owner: str) -> None:
        """Nothing is needed."""

    def draw_depth(self, native_pass: Any, scope: Mapping[str, Bound], cull: Cull, casters: Casters = "all") -> None:
        """Draw depth from a light; ``scope`` binds ``shadow_layers`` and ``layer``.

        Args:
            cull: faces to leave out, as the light sees them; double-sided materials are always drawn whole.
            casters: "beside_outline" leaves out what :meth:`outline` describes.
        """
        self._replay(native_pass, _Way("depth", cull), scope, casters)

    def draw_flattened(self, native_pass: Any, scope: Mapping[str, Bound]) -> None:
        """Darken what is in its shadow on a plane, as a camera sees it; ``scope`` binds ``camera``, ``flattenings`` and
        ``flattening``, and the depth test is for equality.
        """
        self._replay(native_pass, _Way("flattened", targets=1, depth=PLANE_FORMAT), scope)

    def draw_silhouette(self, native_pass: Any, scope: Mapping[str, Bound], targets: int) -> None:
        """Darken what a light sees of it, a channel of ``targets`` images for each plane that it casts a shadow on;
        ``scope`` binds ``silhouettes`` and ``layer``.
        """
        self._replay(native_pass, _Way("silhouette", targets=targets), scope)

    def casts_beside_outline(self) -> bool:
        """Whether something casts a shadow that :meth:`outline` does not describe: surfaces with holes."""
        return any(draw.is_masked for draw in self._draws)

    def outline(self) -> Outline | None:
        """The adjacency of all solid triangles, made on first use and then kept; None where there are none."""
        with self._lock:
            if not self._outlined:
                self._outlined = True
                solid = [p for draw in self._draws if not draw.is_masked for p in draw.placements()]
                streams = (self.positions, self.indices, self._instances.read())
                self._outline = Outline(self._gpu, solid, streams, owner=OWNER) if solid else None
            return self._outline

    def triangles(self) -> Triangles | None:
        """All solid triangles, for passes in compute, made on first use and then kept; None where there are none."""
        solid = [p for draw in self._draws if not draw.is_masked for p in draw.placements()]
        with self._lock:
            if self._triangles is None and solid:
                streams = (self.positions, self.indices, self._instances.read())
                self._triangles = Triangles(self._gpu, solid, streams, owner=OWNER)
            return self._triangles

    def _replay(self, native_pass: Any, way: _Way, scope: Mapping[str, Bound], casters: Casters = "all") -> None:
        draws = [draw for draw in self._draws if casters == "all" or draw.is_masked]
        if not draws:
            return
        bound = {name: scope[name] for name in _BOUND[way.kind]}
        key = (way, casters, tuple(b.key for b in bound.values()))
        bundle = self._bundles.get(key)
        if bundle is None:
            bundle = self._bundles[key] = self._record(way, bound, draws)
        native_pass.execute_bundles([bundle])

    def _record(self, way: _Way, scope: Mapping[str, Any], draws: list[_Draw]) -> Any:
        gpu = self._gpu
        bundle = gpu.bundle(f"mesh.{way.kind}", way.program(masked=False)[0])
        bundle.set_index_buffer(self.indices.native, "uint32")
        bundle.set_vertex_buffer(0, self.positions.native)
        bundle.set_vertex_buffer(1, self.attributes.native)
        current: Any = None
        for draw in draws:
            faces: Cull = "none" if draw.material.double_sided else way.cull
            if draw.mirrored:
                faces = _TURNED[faces]
            bindings = {
                **scope,
                "instances": self._instances,
                "materials": self.materials,
                **self._maps[id(draw.material)],
            }
            state, vertex, fragment = way.program(draw.is_masked)
            pipeline, group = gpu.raster(
                MODULE,
                replace(state, cull=faces),
                bindings,
                vertex=vertex,
                fragment=fragment,
                features={
                    **_features(draw.material),
                    "scene_emits": way.kind == "gbuffer" and way.targets > 2,
                    "has_many_planes": way.kind == "silhouette" and way.targets > 1,
                },
            )
            if pipeline is not current:
                bundle.set_pipeline(pipeline)
                current = pipeline
            bundle.set_bind_group(0, group)
            bundle.draw_indexed(
                draw.mesh.indices.size, len(draw.transforms), draw.first_index, draw.base_vertex, draw.first_instance
            )
        return bundle.finish()

    def resources(self) -> list[Resource]:
        """What the meshes hold on the device."""
        made = [one for one in (self._outline, self._triangles) if one is not None]
        return [*self._buffers, *self._textures.values(), *(resource for one in made for resource in one.resources())]

    def forget_bundles(self) -> None:
        """Drop what was recorded, so that destroyed resources are not kept alive by it."""
        self._bundles.clear()

    def close(self) -> None:
        """Free all device memory."""
        self.forget_bundles()
        for resource in self.resources():
            resource.destroy()
        self._buffers.clear()
        self._textures.clear()
        self._outline = self._triangles = None


def origin_of(mesh: Mesh) -> NDArray[np.float64]:
    """(3,) the origin of a mesh's vertices on the device: its middle, where that is far from its own origin.

    Its vertices, and their products with a matrix that brings them back, would have no digits left for detail.
    """
    low, high = (corner.astype(np.float64) for corner in mesh.bounds)
    middle = 0.5 * (low + high)
    far = np.abs(middle).max() > 8 * (high - low).max()
    return middle.astype(np.float32).astype(np.float64) if far else np.zeros(3)


def from_origin(matrices: NDArray[np.float64], origins: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 4, 4): the transforms of a mesh as those of its vertices on the device, relative to (N, 3)."""
    moved = matrices.copy()
    moved[:, :3, 3] += np.einsum("nij,nj->ni", matrices[:, :3, :3], origins)
    return moved


def _centred(mesh: Mesh) -> NDArray[np.float32]:
    origin = origin_of(mesh)
    return (mesh.positions.astype(np.float64) - origin).astype(np.float32) if origin.any() else mesh.positions


def _features(material: Material) -> dict[str, bool]:
    """What a material's shader must do: a fragment of a plain one is several times as cheap."""
    maps = {f"has_{name}": getattr(material, f"{name}_texture") is not None for name in MAPS}
    masked = material.alpha_mode == "mask"
    return {
        **maps,
        "is_textured": masked or any(maps.values()),  # holes are looked up, if only in a white texel
        "is_masked": masked,
        "is_two_sided": material.double_sided,
    }


def _attributes(mesh: Mesh) -> NDArray[Any]:
    packed = np.zeros(len(mesh.positions), np.dtype([("normal", "<i2", 4), ("uv", "<f4", 2)]))
    if mesh.normals is not None:
        np.rint(mesh.normals * 32767, out=packed["normal"][:, :3], casting="unsafe")
    if mesh.uvs is not None:
        packed["uv"] = mesh.uvs
    return packed


def normal_columns(world: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3, 3): columns of the inverse transpose, scaled to 1; a flat transform's normals stand on the flat."""
    x, y, z = np.moveaxis(world, -1, 0)  # the matrix's columns
    # The cofactors are the inverse transpose times the determinant, and exist where that is 0.
    cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=1)
    largest = np.abs(cofactors).max(axis=(1, 2), keepdims=True)
    sign = np.where(np.linalg.det(world) < 0, -1.0, 1.0)[:, None, None]
    scaled: NDArray[np.float64] = sign * cofactors / np.where(largest > 0, largest, 1.0)
    return scaled


def _uv_columns(texture: SceneTexture | None) -> NDArray[np.float64]:
    """KHR_texture_transform as the three columns of a 3×2 matrix: translate · rotate · scale."""
    if texture is None:
        return np.array([[1, 0], [0, 1], [0, 0]], np.float64)
    c, s = math.cos(texture.rotation), math.sin(texture.rotation)
    sx, sy = texture.scale
    return np.array([[c * sx, -s * sx], [s * sy, c * sy], texture.offset])


_TO_LINEAR = np.where(
    np.arange(256) / 255 <= 0.04045, np.arange(256) / 255 / 12.92, ((np.arange(256) / 255 + 0.055) / 1.055) ** 2.4
).astype(np.float32)


def _mip_chain(pixels: NDArray[np.uint8], srgb: bool) -> list[NDArray[np.uint8]]:
    """Box-filtered levels down to 1×1, averaged in linear light; an odd last row or column is dropped."""
    levels = [np.ascontiguousarray(pixels)]
    current = pixels.astype(np.float32) / 255
    if srgb:
        current[..., :3] = _TO_LINEAR[pixels[..., :3]]
    while max(current.shape[:2]) > 1:
        height, width = (max(1, n // 2) for n in current.shape[:2])
        y = 2 if current.shape[0] > 1 else 1
        x = 2 if current.shape[1] > 1 else 1
        current = current[: height * y, : width * x].reshape(height, y, width, x, 4).mean(axis=(1, 3))
        out = current.copy()
        if srgb:
            rgb = out[..., :3]
            out[..., :3] = np.where(rgb <= 0.0031308, 12.92 * rgb, 1.055 * np.maximum(rgb, 1e-8) ** (1 / 2.4) - 0.055)
        levels.append(np.rint(out * 255).astype(np.uint8))
    return levels
