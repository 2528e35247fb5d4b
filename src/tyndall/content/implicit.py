"""Implicit surfaces in a frame: marched by compute, and put into the depth that everything else is drawn into.

**G-buffer.** After the meshes are drawn, ``field_march`` follows each pixel's ray to the first surface that is nearer
than what the pixel shows already, and keeps its depth, object and number of steps; ``field_resolve`` writes the normal
and the material of what was found; ``field_depth`` is a full-screen triangle that hands the depths to the depth buffer.
March and resolve are apart, as they need different registers and one of them is done for hits alone. Both are compute,
since GPUs that mostly compute shade fragments many times slower.

**Motion.** Where a technique asks for it (``reads_motion``), what a pixel shows is followed back to the last frame: an
object by its transform, and where parts of it have moved by themselves, ``flow`` runs the object's program once more
with the places that its leaves had (``flow.wesl``).

**From a light.** What a light sees is marched the same way into an image of depths, texel by texel of the map that is
to be drawn, and a full-screen triangle draws that image into the map: so every technique that works on maps shows the
shadows of implicit surfaces. They have no outline, and techniques that extrude outlines take them from such a map.
For shadows on planes, one pass marches from each pixel of a plane towards all lights, a bit a light
(``flattened``), and an outline (``silhouette``) is where the light's own march meets anything before the plane.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.content.contract import PLANE_FORMAT, SHADE_TARGET, Casters, Cull, Prepared
from tyndall.content.mesh import MAP_FORMAT
from tyndall.content.outline import Outline
from tyndall.content.rasterize import Triangles
from tyndall.gpu.device import Gpu, Raster
from tyndall.gpu.resources import Bound, Buffer, Resource, Texture
from tyndall.scene.model import Implicit, Material, Scene
from tyndall.sdf import paint
from tyndall.sdf.field import Field
from tyndall.sdf.marching import Marching
from tyndall.sdf.shading import shines
from tyndall.sdf.shape import Named

MODULE = "package::content::implicit"
OWNER = "implicit"
_TILE = 8  # pixels along a tile's side; as in implicit.wesl
_MOST_TILED = 64  # objects; of more, tiles would take more memory than they save time
_ID_BITS = 20  # as in implicit.wesl


class Fields:
    """The implicit surfaces of a scene on the device, and the images that they are marched into.

    Args:
        like: as of :class:`~tyndall.sdf.field.Field`.

    Attributes:
        field: the objects.
        emits: whether a material does, so that the G-buffer has a target for it.
        parts: names of parts of the shapes.
    """

    def __init__(
        self,
        gpu: Gpu,
        scene: Scene,
        size: tuple[int, int],
        marching: Marching | None = None,
        *,
        like: Field | None = None,
    ) -> None:
        self._gpu, self._size, self._lights = gpu, size, len(scene.lights)
        self._placed = [np.asarray(one.transform) for one in scene.implicits]
        self._moves = self._parts_move = False
        self._before: dict[int, NDArray[np.float64]] = {}
        self._motion: Buffer | None = None
        self._flow: Texture | None = None
        self._starts: Buffer | None = None
        self._images: dict[str, Texture] = {}
        self._maps: dict[tuple[int, int], Texture] = {}
        self._shade: Texture | None = None
        self.emits = any(shines(material) for one in scene.implicits for material in materials_of(one))
        self.parts = {
            node.name for one in scene.implicits for node in paint.nodes_of(one.shape) if isinstance(node, Named)
        }
        self.field = Field(gpu, scene.implicits, marching=marching, like=like)
        try:
            for name, format in (("depth", "r32float"), ("ids", "r32uint")):
                self._images[name] = gpu.texture(f"field.{name}", size, format, owner=OWNER)
            if len(scene.implicits) <= _MOST_TILED:
                starts = 4 * math.prod(-(-side // _TILE) for side in size) * len(scene.implicits)
                self._starts = gpu.buffer("field.starts", starts, owner=OWNER, element="f32")
            self._flow = gpu.texture("field.flow", (1, 1), "rgba16float", owner=OWNER)
            self._motion = gpu.buffer("field.motion", self._still(), owner=OWNER, element=f"{MODULE}::Motion")
        except BaseException:
            self.close()
            raise

    @property
    def depth(self) -> Texture:
        """What the last march found, r32float: reversed-Z, 0 where nothing was met."""
        return self._images["depth"]

    @property
    def bindings(self) -> dict[str, Bound]:
        """What the last march found: ``field_depth`` (reversed-Z, 0: nothing) and ``field_ids`` (see
        ``implicit.wesl``); and ``field_motion`` and ``field_flow``.
        """
        assert self._motion is not None
        assert self._flow is not None
        images = {f"field_{name}": image.sampled() for name, image in self._images.items()}
        return {**images, "field_motion": self._motion.read(), "field_flow": self._flow.sampled()}

    # --- motion ---------------------------------------------------------------------------------------------------

    def place(self, index: int, transform: NDArray[np.float64]) -> None:
        """An object stands elsewhere from the next frame on."""
        self.field.place(index, transform)
        self._before.setdefault(index, self._placed[index])
        self._placed[index] = np.array(transform)

    def placed(self, index: int) -> NDArray[np.float64]:
        """4×4: where an object stands."""
        return self._placed[index]

    def carry(self, old: Fields, kept: Mapping[int, int]) -> None:
        """As :meth:`tyndall.sdf.field.Field.carry`; no object is taken to be moving."""
        for index, before in kept.items():
            self._placed[index] = old._placed[before]
        self.field.carry(old.field, kept)

    def update(self, *, follows: bool) -> None:
        """Bring the device up to date, at the beginning of a frame.

        Args:
            follows: the way of parts that move by themselves is asked for, beyond that of their objects;
                :attr:`bindings` may be others then.
        """
        moved = self.field.moved_parts() & (follows and self.field.remembers)
        self.field.update()
        self._follows, self._parts_move = follows, bool(moved.any())
        if self._parts_move and self._flow is not None and self._flow.size[:2] != self._size:
            self._flow.destroy()
            self._flow = self._gpu.texture("field.flow", self._size, "rgba16float", owner=OWNER)
        if self._before or self._moves or self._parts_move:
            assert self._motion is not None
            rows = self._still()
            rows["parts"] = moved
            for index, before in self._before.items():
                matrix = before @ np.linalg.inv(self._placed[index])
                rows[index]["x"], rows[index]["y"], rows[index]["z"] = matrix[:3]
            self._gpu.write(self._motion, rows)
        self._moves = bool(self._before) or self._parts_move
        self._before.clear()

    def _still(self) -> NDArray[Any]:
        rows = np.zeros(len(self._placed), self._gpu.dtype(f"{MODULE}::Motion"))
        rows["x"], rows["y"], rows["z"] = np.eye(4)[:3]
        return rows

    # --- drawing --------------------------------------------------------------------------------------------------

    def draw_gbuffer(self, native_pass: Any, scope: Mapping[str, Bound], *, emissive: bool) -> None:
        """Nothing: it is marched."""

    def march_gbuffer(self, scope: Mapping[str, Bound], depth: Texture | None, *, emissive: bool, alone: bool) -> None:
        """Put what is nearer than the G-buffer's depth into it; ``scope`` binds ``camera``, ``depth`` and the targets
        as ``…_out``.

        Args:
            depth: None where :attr:`depth` is all that is asked for.
            alone: nothing was drawn before, and nothing cleared.
        """
        gpu, images = self._gpu, self._images
        bound = {**scope, **self.field.bindings}
        features = {"alone": alone, "tiled": self._starts is not None}
        if self._starts is not None:
            bound["field_starts"] = self._starts.read_write()
            across, down = (-(-side // _TILE) for side in self._size)
            gpu.compute("gbuffer.field_tiles", MODULE, "tiles").bind(bound).dispatch(across, down, len(self._placed))
            bound["field_starts"] = self._starts.read()
        gpu.compute("gbuffer.field_march", MODULE, "march").bind(
            bound, field_depth_out=images["depth"].write(), field_ids_out=images["ids"].write()
        ).features(**features).dispatch(*self._size)
        gpu.compute("gbuffer.field_resolve", MODULE, "resolve").bind(bound, **self.bindings).features(
            scene_emits=emissive, alone=alone
        ).dispatch(*self._size)
        if self._parts_move:
            assert self._flow is not None
            gpu.compute("gbuffer.field_flow", MODULE, "flow").bind(
                bound, **self.bindings, **self.field.before, field_flow_out=self._flow.write()
            ).dispatch(*self._size)
        if self._follows:
            self.field.remember()
        if depth is None:
            return
        stencil = 0 if alone and depth.has_stencil else None
        with gpu.render("gbuffer.field_depth", depth=(depth.view(), 0.0 if alone else None), stencil=stencil) as native:
            self._cover(native, Raster(depth=depth.format), "depth_fragment", self.bindings)

    def prepare(self, what: Prepared, scope: Mapping[str, Bound], size: tuple[int, int], owner: str) -> None:
        """March what is then drawn; see :class:`~tyndall.content.contract.Content`."""
        march = self._gpu.compute(f"{owner}.field_{what}", MODULE, f"march_{what}").bind(
            {**scope, **self.field.bindings}
        )
        if what == "flattened":
            shade = self._shaded(size)
            march.bind(shade_out=shade.write()).dispatch(*shade.size)
        else:
            self._drawn = self._map(size)
            march.bind(field_depth_out=self._drawn.write()).dispatch(*size)

    def draw_depth(self, native_pass: Any, scope: Mapping[str, Bound], cull: Cull, casters: Casters = "all") -> None:
        """Draw the depths that were marched last; what has no faces has none to leave out."""
        self._cover(native_pass, Raster(depth=MAP_FORMAT), "depth_fragment", {"field_depth": self._drawn.sampled()})

    def draw_flattened(self, native_pass: Any, scope: Mapping[str, Bound]) -> None:
        """Darken the pixels of a plane from which something was met on the way to the light."""
        assert self._shade is not None
        state = Raster(targets=(SHADE_TARGET,), depth=PLANE_FORMAT, depth_compare="equal", depth_write=False)
        self._cover(native_pass, state, "flat_fragment", {**scope, "field_shade": self._shade.sampled()})

    def draw_silhouette(self, native_pass: Any, scope: Mapping[str, Bound], targets: int) -> None:
        """Darken what a light sees of it, a channel of ``targets`` images for each plane that it is in front of."""
        self._cover(
            native_pass,
            Raster(targets=(SHADE_TARGET,) * targets),
            "silhouette_fragment",
            {**scope, "field_depth": self._drawn.sampled()},
            has_many_planes=targets > 1,
        )

    def _cover(
        self, native_pass: Any, state: Raster, fragment: str, bindings: Mapping[str, Bound], **features: bool
    ) -> None:
        """A triangle over all of the target."""
        pipeline, group = self._gpu.raster(
            MODULE, state, bindings, vertex="cover", fragment=fragment, features=features
        )
        native_pass.set_pipeline(pipeline)
        native_pass.set_bind_group(0, group)
        native_pass.draw(3)

    def _map(self, size: tuple[int, int]) -> Texture:
        """The image of depths for maps of a size, which all maps share one after another."""
        if size not in self._maps:
            self._maps[size] = self._gpu.texture("field.map", size, "r32float", owner=OWNER)
        return self._maps[size]

    def _shaded(self, size: tuple[int, int]) -> Texture:
        """A bit a light and pixel."""
        if self._shade is None:
            layers = max(1, -(-self._lights // 32))
            self._shade = self._gpu.texture(
                "field.shade", (*size, layers), "r32uint", owner=OWNER, dimension="2d-array"
            )
        return self._shade

    def found(self) -> dict[str, NDArray[np.uint32]]:
        """ "ids" and "steps" of the last march, (height, width) each: the object's number from 1 on, 0 for none."""
        raw = self._gpu.read_texture(self._images["ids"])[..., 0]
        return {"ids": raw & np.uint32((1 << _ID_BITS) - 1), "steps": raw >> np.uint32(_ID_BITS)}

    # --- what polygons have ---------------------------------------------------------------------------------------

    def outline(self) -> Outline | None:
        """None: it has no edges."""
        return None

    def triangles(self) -> Triangles | None:
        """None: it has none."""
        return None

    def casts_beside_outline(self) -> bool:
        """True: all of it."""
        return True

    # --- life -----------------------------------------------------------------------------------------------------

    def resources(self) -> list[Resource]:
        """What is held on the device."""
        shade = [self._shade] if self._shade else []
        own = [one for one in (self._motion, self._starts, self._flow) if one]
        return [*self.field.resources(), *own, *self._images.values(), *self._maps.values(), *shade]

    def forget_bundles(self) -> None:
        """Free what a shadow technique was drawn from; the next one may need other images."""
        for image in [*self._maps.values(), *([self._shade] if self._shade else [])]:
            image.destroy()
        self._maps.clear()
        self._shade = None

    def close(self) -> None:
        """Free all device memory."""
        self.forget_bundles()
        for image in self._images.values():
            image.destroy()
        self._images.clear()
        for one in (self._motion, self._starts, self._flow):
            if one:
                one.destroy()
        self._motion = self._starts = self._flow = None
        self.field.close()


def materials_of(implicit: Implicit) -> list[Material]:
    """The materials of an implicit surface: its own, and those of its parts."""
    return [implicit.material, *paint.materials_of(implicit.shape)]
