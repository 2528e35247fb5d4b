"""A scene that rays can hit: its tree, its triangles, its implicit surfaces, and what a hit needs to know of materials.

Shaders see it through ``tracing/rays.wesl`` (``occluded``, ``closest``) and ``tracing/surface.wesl`` (``surface_at``),
with :attr:`World.bindings` in their scope. A ray first descends the tree over the triangles, then marches through the
implicit surfaces (:mod:`tyndall.sdf.field`) up to what was found; a scene without any has no code for them.

Vertex attributes, indices and materials are the buffers that :mod:`tyndall.content.mesh` draws from; texels lie in a
buffer of their own, since a shader cannot choose between textures. :mod:`tyndall.tracing.layout` says what is built in
which space, :mod:`tyndall.tracing.bvh` how.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.content.mesh import MAPS, Meshes, from_origin
from tyndall.gpu.device import Gpu, GpuError
from tyndall.gpu.params import ParameterError
from tyndall.gpu.resources import Buffer, Closing, Parts, Resource
from tyndall.scene.model import Mat4, Scene, Texture
from tyndall.sdf.field import Field
from tyndall.tracing.bvh import OWNER, STACK, Clustering, Steps
from tyndall.tracing.layout import arrange, is_flat, place

_RAYS = "package::tracing::rays"
_MASKED = "package::tracing::masked"
_BUILD = "package::tracing::build"
_END = 0xBFFFFFFF  # as tracing/rays.wesl has it
_MAX_LEAVES = 1 << 30  # a reference has two bits for other things
# What shaders ask for implicit surfaces, of tracing/fields.wesl or, where there are none, of tracing/no_fields.wesl.
_FIELDS = """\
import package::tracing::{module}::{{closest_field, field_at, fields_occlude}};
import package::tracing::rays::RayHit;
import package::tracing::surface::TracedSurface;
fn trace_fields_closest(origin: vec3f, direction: vec3f, near: f32, far: f32) -> RayHit {{
    return closest_field(origin, direction, near, far);
}}
fn trace_fields_occlude(origin: vec3f, direction: vec3f, near: f32, far: f32) -> bool {{
    return fields_occlude(origin, direction, near, far);
}}
fn trace_field_at(hit: RayHit, origin: vec3f, direction: vec3f) -> TracedSurface {{
    return field_at(hit, origin, direction);
}}"""
_WRAP = {"repeat": 0, "clamp": 1, "mirror": 2}


class World(Closing):
    """The geometry of a scene, for rays.

    Args:
        meshes: the scene's meshes where they are on the device already; the world makes its own otherwise.
        fields: likewise, its implicit surfaces. Whoever moves or edits them updates them; rays see them as they are.
        movable: every instance keeps a space of its own, so that :meth:`move` needs no new build; rays then cross more
            boxes. (What has several instances can be moved in any case.)

    Attributes:
        bindings: what shaders that trace rays must have in their scope.
        depth: of the deepest branch, in nodes.

    Raises:
        GpuError: more triangles than can be numbered, or than fit the device.
    """

    def __init__(
        self,
        gpu: Gpu,
        scene: Scene,
        *,
        meshes: Meshes | None = None,
        fields: Field | None = None,
        movable: bool = False,
    ) -> None:
        self._gpu = gpu
        self._own_meshes, self._own_fields = meshes is None, fields is None and bool(scene.implicits)
        self._meshes = meshes or Meshes(gpu, scene)
        self._fields = fields
        self._buffers: list[Buffer] = []
        try:
            if fields is None and scene.implicits:
                self._fields = Field(gpu, scene.implicits)
                self._fields.update()
            dtypes = {
                name: gpu.dtype(f"{module}::{name}")
                for module, name in ((_BUILD, "Part"), (_RAYS, "Placed"), (_BUILD, "Box"))
            }
            self._layout = arrange(scene, self._meshes.placed, dtypes, movable=movable)
            self._upload()
            self.build()
        except BaseException:
            gpu.discard()  # passes that were recorded for what is freed now
            self.close()
            raise

    def _buffer(self, label: str, data: NDArray[Any] | int, element: str = "u32") -> Buffer:
        buffer = self._gpu.buffer(f"tracing.{label}", data, owner=OWNER, element=element)
        self._buffers.append(buffer)
        return buffer

    def _upload(self) -> None:
        gpu, layout, meshes = self._gpu, self._layout, self._meshes
        if layout.leaves > _MAX_LEAVES:
            raise GpuError(f"tracing: {layout.leaves:,} triangles; {_MAX_LEAVES:,} can be numbered")
        self._root = self._buffer("root", np.full(4, _END, np.uint32))
        self._instances = self._buffer("instances", layout.instances, f"{_RAYS}::Placed")
        self._nodes = self._buffer("nodes", 64 * (layout.leaves + len(layout.instances)), f"{_RAYS}::Node")
        self._triangles = self._buffer("triangles", 48 * max(1, layout.leaves), f"{_RAYS}::Triangle")
        self._roots = self._buffer("roots", np.full(len(layout.boxes), _END, np.uint32))
        self._boxes = self._buffer("boxes", layout.boxes, f"{_BUILD}::Box")
        rows = np.zeros(max(1, len(meshes.placed)), gpu.dtype(f"{_MASKED}::TracedMesh"))
        for row, (mesh, (_, vertex)) in zip(rows, meshes.placed.items(), strict=False):
            row["first_vertex"], row["material"] = vertex, meshes.material_of[mesh]
        maps, texels = self._textures()
        self._parts = self._buffer("parts", layout.parts, f"{_BUILD}::Part")
        self._hanging = self._buffer("hanging", layout.hanging)
        self._box = self._buffer("box", layout.box, f"{_BUILD}::Box")
        self._starts = self._buffer("starts", 4 * (len(layout.hanging) + 1))
        self._bound: dict[str, Any] = {
            "trace_nodes": self._nodes.split(),
            "trace_triangles": self._triangles.split(),
            "trace_instances": self._instances.split(),
            "trace_meshes": self._buffer("meshes", rows, f"{_MASKED}::TracedMesh").read(),
            "trace_maps": maps.read(),
            "trace_texels": texels.split(),
            "trace_corners": meshes.indices.split("u32"),
            "trace_vertices": meshes.attributes.split("vec4u"),
            "trace_materials": meshes.materials.read(),
        }
        self._bind()

    def _bind(self) -> None:
        fields = self._fields
        masked = any(m.alpha_mode == "mask" for m in self._meshes.material_list)
        root = self._root.read().declaring(TRACE_INSTANCED=self._layout.instanced, TRACE_MASKED=masked)
        self.bindings: dict[str, Any] = {
            "trace_root": root.telling(_FIELDS.format(module="fields" if fields else "no_fields")),
            **(fields.bindings if fields else {}),
            **self._bound,
        }

    def see(self, fields: Field | None) -> None:
        """From now on, rays meet these implicit surfaces, which are another's."""
        assert not self._own_fields, "its own would be left without an owner"
        self._fields = fields
        self._bind()

    def beside(self, fields: Field | None) -> World:
        """The same triangles with other implicit surfaces; it owns nothing, so it must not outlive this world."""
        made = copy.copy(self)
        made._buffers, made._own_meshes, made._own_fields = [], False, False
        made.see(fields)
        return made

    def _textures(self) -> tuple[Buffer, Buffer]:
        """The materials' textures: where each lies, and the texels of all."""
        materials = self._meshes.material_list
        rows = np.zeros(len(MAPS) * max(1, len(materials)), self._gpu.dtype(f"{_MASKED}::Map"))
        images: dict[int, tuple[int, NDArray[np.uint8]]] = {}
        texels = 0
        for i, material in enumerate(materials):
            for j, name in enumerate(MAPS):
                texture: Texture | None = getattr(material, f"{name}_texture")
                if texture is None:
                    continue
                pixels = texture.image.pixels
                if id(texture.image) not in images:
                    images[id(texture.image)] = (texels, pixels)
                    texels += pixels.shape[0] * pixels.shape[1]
                wrap = _WRAP[texture.wrap_u] | _WRAP[texture.wrap_v] << 2 | (texture.filter == "nearest") << 4
                wrap |= (name in ("base_color", "emissive")) << 5
                row = rows[len(MAPS) * i + j]
                row["first"] = images[id(texture.image)][0]
                row["height"], row["width"] = pixels.shape[:2]
                row["wrap"] = wrap
        packed = self._buffer("texels", 4 * max(1, texels))
        for first, pixels in images.values():
            self._gpu.write(packed, pixels, 4 * first)
        return self._buffer("maps", rows, f"{_MASKED}::Map"), packed

    # --- building -------------------------------------------------------------------------------------------------

    def build(self) -> None:
        """Make the whole tree anew, on the device."""
        gpu, layout, meshes = self._gpu, self._layout, self._meshes
        self._upper: Steps | None = None
        self.depth = 0
        if not layout.leaves:
            return
        scope = {
            **self._bound,
            "parts": self._parts.read(),
            "part_count": gpu.constant(len(layout.parts)),
            "group_boxes": self._boxes.read(),
            "trace_positions": meshes.positions.split("f32"),
        }
        # The upper tree takes no more than its logarithm where it is made by pairs; the lower ones have the rest.
        room = STACK - 2
        least = max(1, len(layout.hanging) - 1).bit_length() + 3
        lower = self._cluster(layout.leaves, layout.groups, 0, "triangle", scope, self._finish_groups, room - least)
        layout.instances["root"] = gpu.read_buffer(self._roots)[layout.instances["group"]]
        gpu.write(self._instances, layout.instances)
        self._scope = {
            **self._bound,
            "group_boxes": self._box.read(),
            "hanging": self._hanging.read(),
            "instances": self._instances.read(),
            "root_boxes": self._boxes.read(),
            "starts": self._starts.read(),
        }
        first, room = layout.leaves - layout.groups, room - lower.depth
        upper = self._cluster(len(layout.hanging), 1, first, "instance", self._scope, self._finish_top, room)
        self.depth = lower.depth + upper.depth
        if self.depth > STACK - 2:
            raise GpuError(f"tracing: a tree of {self.depth} levels; {STACK - 2} can be followed")
        gpu.write(self._starts, np.array(upper.starts, np.uint32))
        self._upper = upper

    def _cluster(
        self,
        leaves: int,
        groups: int,
        first: int,
        kind: str,
        scope: Mapping[str, Any],
        finish: Callable[[Parts], object],
        room: int,
    ) -> Steps:
        """Make the trees of one level, no deeper than ``room`` if pairing can do it."""
        triangles = {"trace_triangles": self._triangles.split(write=True)} if kind == "triangle" else {}
        with Clustering(self._gpu, self._nodes, leaves=leaves, groups=groups, first_node=first) as clustering:
            clustering.sort(f"{kind}_keys", scope)
            scope = {**scope, **triangles}
            clusters, steps = clustering.cluster(f"{kind}_leaves", scope)
            if steps.depth > room:
                clusters, steps = clustering.cluster(f"{kind}_leaves", scope, paired=True)
            finish(clusters)
            self._gpu.submit()
        return steps

    def _finish_groups(self, clusters: Parts) -> None:
        self._gpu.compute("tracing.roots", _BUILD, "write_roots").bind(
            clusters_in=clusters,
            leaf_count=self._gpu.constant(self._layout.groups),
            roots=self._roots.read_write(),
            root_boxes=self._boxes.read_write(),
        ).dispatch_line(self._layout.groups)

    def _finish_top(self, clusters: Parts) -> None:
        self._gpu.compute("tracing.roots", _BUILD, "write_top").bind(
            clusters_in=clusters, trace_root_out=self._root.read_write()
        ).dispatch(1)

    # --- motion ---------------------------------------------------------------------------------------------------

    def move(self, transforms: Mapping[int, Mat4]) -> None:
        """Place instances anew, without a new build: for rays that are recorded from now on.

        What was recorded before is submitted first. The upper tree keeps its shape; after long ways :meth:`build` makes
        it a better one. Only rays see the motion: what a frame draws stays where the scene has it.

        Args:
            transforms: 4×4 (row-major, column vectors) by the instance's index in the scene.

        Raises:
            ParameterError: no such instance, one that is part of world space (see ``movable``), or a flat transform.
        """
        gpu, layout = self._gpu, self._layout
        count = len(layout.instances) - 1
        for index in transforms:
            if not 0 <= index < count:
                raise ParameterError(f"instances[{index}]: there are {count}")
            if not layout.instances["group"][index]:
                raise ParameterError(f"instances[{index}]: is placed once; World(…, movable=True) lets it move")
        if not transforms:
            return
        indices = np.array(list(transforms))
        matrices = np.empty((len(indices), 4, 4))
        for i, (index, transform) in enumerate(transforms.items()):
            matrix = np.asarray(transform, np.float64)
            if matrix.shape != (4, 4) or not np.isfinite(matrix).all() or is_flat(matrix[None])[0]:
                raise ParameterError(
                    f"instances[{index}]: the transform is not 4×4 finite numbers that have an inverse"
                )
            matrices[i] = matrix
        if gpu.recording:
            gpu.submit()
        rows = layout.instances[indices]
        place(rows, from_origin(matrices, layout.origins[indices]))
        layout.instances[indices] = rows
        first, end = int(indices.min()), int(indices.max()) + 1
        gpu.write(self._instances, layout.instances[first:end], layout.instances.itemsize * first)
        assert self._upper is not None, "a world with instances has a tree"
        refit = {**self._scope, "trace_nodes": self._nodes.split(write=True)}
        for step, (start, stop) in enumerate(itertools.pairwise(self._upper.starts)):
            gpu.compute("tracing.refit", _BUILD, "refit").bind(refit, step=gpu.constant(step)).dispatch_line(
                stop - start
            )

    # --- life -----------------------------------------------------------------------------------------------------

    @property
    def triangle_count(self) -> int:
        """Triangles in the tree: those of a mesh that is placed several times count once."""
        return self._layout.leaves

    @property
    def fields(self) -> Field | None:
        """The scene's implicit surfaces on the device; None where it has none."""
        return self._fields

    def resources(self) -> list[Resource]:
        """What the world holds on the device, without meshes and implicit surfaces that are another's."""
        fields = self._fields.resources() if self._fields and self._own_fields else ()
        return [*self._buffers, *(self._meshes.resources() if self._own_meshes else ()), *fields]

    def close(self) -> None:
        """Free all device memory, once what was recorded has been submitted."""
        if self._gpu.recording:
            self._gpu.submit()
        for buffer in self._buffers:
            buffer.destroy()
        self._buffers.clear()
        if self._own_meshes:
            self._meshes.close()
        if self._fields and self._own_fields:
            self._fields.close()
        self._gpu.forget_groups()
