"""One frame.

::

    content ──▶ G-buffer            content ──from each light──▶ shadows ──▶ visibility
                                    content ──▶ occlusion of the ambient light
    G-buffer + lights + visibility ──▶ L_b ──▶ air: L_v, T ──▶ L_b·T + L_v ──▶ antialiasing ──▶ tone map ──▶ picture

:meth:`Renderer.draw` is this diagram as code.
"""

from __future__ import annotations

import copy
import itertools
import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tyndall.content.contract import Content
from tyndall.content.implicit import Fields
from tyndall.content.mesh import GBUFFER_TARGETS, Meshes
from tyndall.gpu.device import Gpu, GpuError
from tyndall.gpu.params import ParameterError, nearest
from tyndall.gpu.resources import Closing, Resource, Slot, Texture
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    HenyeyGreenstein,
    Implicit,
    Material,
    Medium,
    Motion,
    RectLight,
    Scene,
    Schlick,
    Solid,
    SpotLight,
    Volume,
    box_corners,
    transforms,
)
from tyndall.sdf.field import Field, check_snippets
from tyndall.sdf.marching import Marching
from tyndall.techniques import FAMILIES, Technique
from tyndall.techniques.contract import View
from tyndall.techniques.reflection.field_reflections import shows_surroundings
from tyndall.techniques.shadow.depth_maps import first_layers
from tyndall.techniques.volume import Filled
from tyndall.tracing.world import World

OWNER = "frame"
_CAMERA = "package::wesl::camera::Camera"
_LIGHT = "package::wesl::light::Light"
_MEDIUM = "package::wesl::medium::Medium"
_MODULE = "package::frame"
_PHASES = ("isotropic", "henyey_greenstein", "rayleigh", "gibbons", "schlick")  # as wesl/phase.wesl numbers them
_KINDS = ("directional", "point", "spot", "rect")  # as wesl/light.wesl numbers them
_DEPTH_OF = "fn depth_of(pixel: vec2u) -> f32 { return textureLoad(depth, pixel, 0); }"
_UNBOUNDED = 1e10

_IMAGES = {
    "normal_roughness": GBUFFER_TARGETS[0][0],
    "albedo_metallic": GBUFFER_TARGETS[1][0],
    "emissive": GBUFFER_TARGETS[2][0],
    "depth": "",  # Gpu.depth_format
    "base": "rgba16float",
    "inscatter": "rgba32float",
    "transmittance_map": "rgba16float",
    "lit": "rgba16float",
    "picture": "rgba8unorm",
}
# What `motion.wesl` asks for: where what a pixel shows was in the last frame.
_STILL = "fn place_before(pixel: vec2u, p: vec3f) -> vec3f { return p; }"
_MOVING = """\
import package::content::implicit::field_place_before;
fn place_before(pixel: vec2u, p: vec3f) -> vec3f { return field_place_before(pixel, p); }"""
_TARGETS = ("normal_roughness", "albedo_metallic", "emissive")
# Attributes of a renderer that are made for its scene: what a renderer beside it gives it when it takes over.
_OF_SCENE = (
    "scene", "_resources", "_images", "_content", "_fields", "_volumes", "_rays", "_targets", "_resolved", "_base",
    "_shows_surroundings", "_camera", "_scope", "_drawn", "_marched", "_views",
)  # fmt: skip
_REMEMBERED = 4  # sets of kinds whose pipelines are kept, so that going back and forth compiles nothing


class Renderer(Closing):
    """Draws a scene with one technique of each family.

    Args:
        scene: what is drawn.
        size: width and height in pixels.
        gpu: the device to draw on; the renderer makes its own, and closes it, when none is given.
        adapter: part of an adapter's name, for a device of its own.
        volumetric, shadow, occlusion, reflection, volume, antialiasing, tonemap: techniques, by name or as instances;
            by name they start from the scene's ``looks``.
        marching: when rays through implicit surfaces end; as the scene's ``looks`` have it unless given.
        seed: of everything random.

    Raises:
        GpuError: no adapter, or a size beyond its limits.
        ParameterError: a size that is not in whole pixels, an unknown technique, or a seed that is not of 32
            bits.
        Unsupported: the technique cannot draw this scene.
    """

    def __init__(
        self,
        scene: Scene,
        size: tuple[int, int] = (1280, 720),
        *,
        gpu: Gpu | None = None,
        adapter: str | None = None,
        volumetric: str | Technique | None = None,
        shadow: str | Technique | None = None,
        occlusion: str | Technique | None = None,
        reflection: str | Technique | None = None,
        volume: str | Technique | None = None,
        antialiasing: str | Technique | None = None,
        tonemap: str | Technique | None = None,
        marching: Marching | None = None,
        seed: int = 0,
    ) -> None:
        if not all(isinstance(side, (int, np.integer)) for side in size):
            raise ParameterError(f"size: {size!r} is not a width and a height in whole pixels")
        if min(size) < 1:
            raise GpuError(f"size: {size[0]}×{size[1]} is not a picture")
        if not 0 <= seed < 2**32:
            raise ParameterError(f"seed: {seed} is outside 0 … 4294967295")
        self.scene, self.size, self.seed = scene, size, seed
        self._marching = marching
        chosen = {
            "volumetric": volumetric,
            "shadow": shadow,
            "occlusion": occlusion,
            "reflection": reflection,
            "volume": volume,
            "antialiasing": antialiasing,
            "tonemap": tonemap,
        }
        techniques = {family: FAMILIES[family].make(name, scene.looks) for family, name in chosen.items()}
        self._own_gpu = gpu is None
        self.gpu = gpu or Gpu(adapter)
        self._views: dict[str, View] = {}
        self._resources: dict[Any, Resource] = {}
        self._beside: Renderer | None = None
        self._change: _Change | None = None
        self._asked: Scene | None = None
        self._gone: set[str] = set()
        self._known: list[Slot] = []
        self._images: dict[str, Texture] = {}
        self._content: list[Content] = []
        self._fields: Fields | None = None
        self._volumes: list[Filled] = []
        self._rays: _Rays | None = None
        self._frame = 0
        self._history = 0
        self._casters = True
        self._time: float | None = None
        self._moved = False
        self._uploaded = self._sent = 0
        self._previous: NDArray[np.float64] | None = None
        self._camera_seen: Camera | None = None
        self._camera_row: Any = None
        try:
            self._setup(techniques)
        except BaseException:
            self.close()
            raise

    def _setup(self, techniques: dict[str, Technique]) -> None:
        gpu, size = self.gpu, self.size
        if max(size) > (limit := gpu.limits["max-texture-dimension-2d"]):
            raise GpuError(f"size: {size[0]}×{size[1]} is beyond this adapter's limit of {limit} pixels a side")
        black = self._image("black", (1, 1), "rgba32float", "sampled")
        gpu.write_texture(black, np.zeros((1, 1, 4), np.float32))
        if self._beside is None:
            self._meshes = Meshes(gpu, self.scene)
        self._content = [self._meshes]
        if self.scene.implicits:
            marching = self._marching or Marching.of(self.scene.looks)
            before = self._beside._fields if self._beside else None
            self._fields = Fields(gpu, self.scene, size, marching, like=before.field if before else None)
            self._content.append(self._fields)
        self._rays = _Rays(self, self._beside._tree.made if self._beside else None)
        for number, volume in enumerate(self.scene.volumes):
            self._volumes.append(self._fill(volume, number))
        self._targets = _TARGETS if any(content.emits for content in self._content) else _TARGETS[:2]
        for name, format in _IMAGES.items():
            if name in _TARGETS and name not in self._targets:
                self._images[name] = black  # nothing shines by itself: a load outside of it is 0 as well
                continue
            drawn = name in _TARGETS or name in ("depth", "inscatter")
            stored = name != "depth" and (name not in _TARGETS or self._fields is not None)
            usage = " ".join(["sampled", *(["target"] if drawn else []), *(["storage"] if stored else [])])
            self._images[name] = self._image(name, size, format or gpu.depth_format, usage)
        self._resolved, self._base = self._images["lit"], self._images["base"]
        self._shows_surroundings = shows_surroundings(self.scene)
        self._camera = self._buffer("camera", gpu.dtype(_CAMERA).itemsize, _CAMERA, "uniform", own=True)
        self._medium = self._buffer("medium", gpu.dtype(_MEDIUM).itemsize, _MEDIUM, "uniform")
        count = max(1, len(self.scene.lights))
        self._lights = self._buffer("lights", count * gpu.dtype(_LIGHT).itemsize, _LIGHT, "storage")
        if self._beside is None:
            gpu.write(self._medium, pack_medium(self.scene.medium, gpu.dtype(_MEDIUM)))
            gpu.write(self._lights, pack_lights(self.scene, gpu.dtype(_LIGHT)))
        self._scope: dict[str, Any] = {
            "camera": self._camera.uniform().telling(_MOVING if self._fields else _STILL),
            "medium": self._medium.uniform(),
            "lights": self._lights.read().declaring(**light_kinds(self.scene)),
            "black": black.sampled(),
            **{name: self._images[name].sampled() for name in _IMAGES if name not in ("depth", "picture")},
            "depth": self._images["depth"].sampled().telling(_DEPTH_OF),
            "inscatter_out": self._images["inscatter"].write(),
            "transmittance_out": self._images["transmittance_map"].write(),
        }
        self._drawn = self._marched = self._scope["depth"]
        if self._fields:
            self._marched = self._fields.depth.sampled().telling(_DEPTH_OF.replace("0);", "0).x;"))
            self._scope |= self._fields.bindings
            self._scope |= {f"{name}_out": self._images[name].write() for name in self._targets}
        for family, technique in techniques.items():
            self.use(family, technique)

    def _fill(self, volume: Volume, number: int) -> Filled:
        gpu = self.gpu
        medium, edge = (
            self._buffer(f"volume.{number}.{label}", size, element, "uniform")
            for label, size, element in (("medium", gpu.dtype(_MEDIUM).itemsize, _MEDIUM), ("edge", 16, "f32"))
        )
        gpu.write(medium, pack_medium(volume.medium, gpu.dtype(_MEDIUM)))
        gpu.write(edge, np.array([volume.edge, 0, 0, 0], np.float32))
        return Filled(volume, Field(gpu, [volume.surface], owner="volume"), medium.uniform(), edge.uniform())

    def _image(self, name: str, size: tuple[int, int], format: str, usage: str) -> Texture:
        made = self._held(
            (name, size, format, usage),
            lambda: self.gpu.texture(f"frame.{name}", size, format, owner=OWNER, usage=usage),
        )
        assert isinstance(made, Texture)
        return made

    def _buffer(self, label: str, size: int, element: str, usage: str, *, own: bool = False) -> Any:
        return self._held(
            (label, size, element, usage, object() if own else None),
            lambda: self.gpu.buffer(f"frame.{label}", size, owner=OWNER, element=element, usage=usage),
        )

    def _held(self, key: Any, make: Callable[[], Resource]) -> Resource:
        """What the renderer beside this one has of this description, or a new one."""
        shared = self._beside._resources.get(key) if self._beside else None
        self._resources[key] = shared or make()
        return self._resources[key]

    def use(self, family: str, technique: str | Technique) -> Technique:
        """Switch to another technique of a family; the old one's memory is freed, and temporal history begins anew:
        while the camera stands still, the old technique's light would linger in it.

        Raises:
            ParameterError: an unknown technique.
            Unsupported: it cannot draw this scene; the one in use stays.
        """
        made = FAMILIES[family].make(technique, self.scene.looks)
        made.supports(self.scene)
        if family in self._views:
            self._views.pop(family).close()
            if family == "shadow":
                for content in self._content:
                    content.forget_bundles()
            self.gpu.forget_groups()
            self._history = 0
            self._resolved, self._base = self._images["lit"], self._images["base"]
        owner = f"{family}.{made.name}"
        self._views[family] = View(
            self.gpu,
            self.scene,
            self.size,
            owner,
            made,
            self._images,
            make_world=self._tree.get,
            fields=self._fields.field if self._fields else None,
        )
        if not self._casts_rays():
            self._tree.close()
        return made

    def _casts_rays(self) -> bool:
        return any(view.technique.casts_rays for view in self._views.values())

    @property
    def world(self) -> World:
        """The scene for rays; built when it is asked for first, freed by :meth:`use` once no technique casts any."""
        return self._tree.get()

    @property
    def _tree(self) -> _Rays:
        assert self._rays is not None, "the renderer is closed"
        return self._rays

    def technique(self, family: str) -> Any:
        """The technique in use."""
        return self._views[family].technique

    # --- the frame ------------------------------------------------------------------------------------------------

    def draw(
        self,
        camera: Camera | None = None,
        *,
        time: float | None = None,
        jitter: bool = True,
        casters: bool = True,
    ) -> float:
        """Record and submit one frame, without waiting for it; returns the host's time in milliseconds.

        Args:
            camera: in place of the scene's.
            time: seconds at which the scene's ``motion`` is asked where things are; None leaves them.
            jitter: False draws through the pixels' centres whatever the antialiasing technique.
            casters: False leaves shadow maps empty, so that light reaches everything.

        Raises:
            ParameterError: ``motion`` moves what is not there.
            Exception: what a change that was asked for (:meth:`replace`) failed with, once; what is drawn stays.
        """
        begin = perf_counter()
        if self._change is not None and self._change.ready.done():
            self._follow()
        if time is not None and time != self._time and self.scene.motion:
            moves = self.scene.motion(time)
            self._move({name: moves[name] for name in moves if name not in self._gone} if self._gone else moves)
            self._time = time
        try:
            with self.gpu.together():
                self._record(camera or self.scene.camera, jitter, casters)
        except BaseException:
            self._discard()  # half a frame must not precede the next one
            raise
        self.gpu.submit()
        self._frame += 1
        self._history += 1
        self._moved = False
        return (perf_counter() - begin) * 1e3

    def _discard(self) -> None:
        """What was recorded did not happen."""
        self.gpu.discard()
        for view in self._views.values():
            view.forget()
        for field in [*([self._fields.field] if self._fields else []), *(filled.field for filled in self._volumes)]:
            field.forget()

    def _record(self, camera: Camera, jitter: bool, casters: bool) -> None:
        gpu, images = self.gpu, self._images
        if self._casts_rays():
            _ = self.world  # its build submits what is recorded, so it comes first
        if casters != self._casters:
            self._casters, self._history = casters, 0
        self._update(camera, jitter)
        emissive = "emissive" in self._targets
        # Clearing, and drawing a depth that is there already, takes a GPU that mostly computes more than a millisecond.
        alone = self._fields is not None and not self.scene.instances
        marched = alone and not any(view.technique.tests_depth for view in self._views.values())
        self._scope["depth"] = self._marched if marched else self._drawn
        scope = self._scope

        targets = [(images[name].view(), (0.0, 0.0, 0.0, 0.0)) for name in self._targets]
        if self._fields:
            field = self._fields.field
            self._uploaded = field.uploaded - self._sent
            self._fields.update(follows=any(view.technique.reads_motion for view in self._views.values()))
            self._scope |= self._fields.bindings
            self._sent = field.uploaded
        # Its stencil, where it has one, is cleared with it: drivers pack the two, and clear both at once or neither.
        clear = 0 if images["depth"].has_stencil else None
        if not alone:
            with gpu.render("gbuffer.mesh", targets, (images["depth"].view(), 0.0), stencil=clear) as native:
                for content in self._content:
                    content.draw_gbuffer(native, scope, emissive=emissive)
        for content in self._content:
            depth = None if marched else images["depth"]
            content.march_gbuffer(scope, depth, emissive=emissive, alone=alone)

        shadow = self._view("shadow")
        shadow.maps_wanted = self.technique("volumetric").reads_maps
        shadow.air_wanted = self.technique("volumetric").lights_air or bool(self._volumes) or self._shows_surroundings
        visibility = self.technique("shadow").render(shadow, self._content if casters else [])
        occlusion = self.technique("occlusion").render(self._view("occlusion"))
        scope = {**scope, **visibility.bindings, **occlusion.bindings}
        overlay = {
            "package::visibility": visibility.module,
            "package::surface_visibility": visibility.surfaces,
            "package::occlusion": occlusion.module,
            **visibility.overlay,
        }

        gpu.compute("lighting", _MODULE, "lighting").bind(scope, lit_out=images["base"].write()).overlay(
            overlay
        ).dispatch(*self.size)

        base = images["base"]
        if self._fields:
            mirror = self._view("reflection", scope, overlay)
            base = self.technique("reflection").render(mirror, base, self._fields.bindings)
        if self._volumes:
            base = self.technique("volume").render(self._view("volume", scope, overlay), base, self._volumes)
        self._base, scope = base, {**scope, "base": base.sampled()}

        air = self._view("volumetric", scope, overlay)
        air.images = {**images, **({"shadow_maps": visibility.maps} if visibility.maps else {})}
        self.technique("volumetric").render(air)

        gpu.compute("composite", _MODULE, "composite").bind(scope, lit_out=images["lit"].write()).overlay(
            overlay
        ).dispatch(*self.size)

        smooth = self._view("antialiasing", scope)
        self._resolved = self.technique("antialiasing").render(smooth, images["lit"])

        self.technique("tonemap").render(self._view("tonemap", scope), self._resolved, images["picture"])

    def _view(self, family: str, scope: dict[str, Any] | None = None, overlay: dict[str, str] | None = None) -> View:
        view = self._views[family]
        view.scope, view.overlay, view.frame = scope or self._scope, overlay or {}, self._frame
        if self._camera_seen is not None:
            view.camera = self._camera_seen
        return view

    def _update(self, camera: Camera, jitter: bool) -> None:
        shift = self.technique("antialiasing").jitter(self._frame) if jitter else (0.0, 0.0)
        if self._moved:
            self._history = min(self._history, 8)
        if camera != self._camera_seen:
            self._history = 0 if self._camera_seen is None else min(self._history, 8)
            self._camera_seen = camera
            self._camera_row = pack_camera(camera, self.scene, self.size, self.gpu.dtype(_CAMERA))
        row = shifted(self._camera_row, shift)
        row["previous_view_proj"] = row["still_view_proj"] if self._previous is None else self._previous
        row["frame"], row["seed"], row["history"] = self._frame, self.seed, self._history
        row["moved"] = self._moved
        self._previous = row["still_view_proj"]
        self.gpu.write(self._camera, row)

    # --- motion ---------------------------------------------------------------------------------------------------

    def place(self, which: int | str, transform: ArrayLike) -> None:
        """From the next frame on, an implicit surface stands elsewhere. It is one small upload, and nothing of its
        field is evaluated anew.

        Args:
            which: its number in ``scene.implicits``, or its name.
            transform: 4×4, from its own space to the world, in place of the one that it has.

        Raises:
            ParameterError: there is none such, or a transform that has no inverse.
        """
        which = self._number(which, self.scene.implicits)
        assert self._fields is not None
        matrix = transforms("transform", transform)[0]
        if np.shape(transform) != (4, 4):
            raise ParameterError(f"transform: shape {np.shape(transform)} is not (4, 4)")
        self._fields.place(which, matrix)
        self._moved = True
        self._reach(which)

    def move(self, name: str, moves: ArrayLike) -> None:
        """From the next frame on, objects or parts of a name are moved from where they stand at rest; as in
        :class:`~tyndall.scene.model.Scene`, ``motion``. Maps of lights are not fitted anew to parts: a scene's
        ``room`` says how far they may go.

        Args:
            moves: one 4×4 transform, (N, 4, 4) for N objects or parts of that name, or (N, 3) ways in metres.

        Raises:
            ParameterError: no such name, or what are no transforms.
        """
        self._move({name: moves})

    def _move(self, moves: Mapping[str, ArrayLike]) -> None:
        """As :meth:`move`, of several names: their parts move together, which costs less than one after another."""
        parts: dict[str, ArrayLike] = {}
        for name, value in moves.items():
            objects = self._objects(name)
            given = value if isinstance(value, np.ndarray) else np.empty(0)
            if objects or given.shape[1:] != (3,):  # ways of parts are written as they are
                given = transforms(name, value)
            if len(given) < len(objects):
                raise ParameterError(f"{name}: {len(given)} transforms for {len(objects)} objects")
            for index, matrix in zip(objects, given, strict=False):
                self.place(index, matrix @ np.asarray(self.scene.implicits[index].transform))
            if self._fields and name in self._fields.parts:
                parts[name] = given[len(objects) :]
            elif not objects:
                self._unknown(name)
            elif len(given) > len(objects):
                raise ParameterError(f"{name}: {len(given)} transforms for {len(objects)} objects")
        if self._fields and parts:
            self._fields.field.move_all(parts)
            self._moved = True

    def edit(self, name: str, **changes: Any) -> None:
        """From the next frame on, the primitives of a name have other parameters: ``edit("ball", radius=0.3)``. Some
        numbers are uploaded; as with :meth:`move`, maps of lights are not fitted anew.

        Raises:
            ParameterError: no such name, a part that is no primitive, or a value that it does not allow.
        """
        if self._fields is None or name not in self._fields.parts:
            self._unknown(name)
        else:
            self._fields.field.edit(name, **changes)
            self._moved = True

    def _objects(self, name: str) -> list[int]:
        return [i for i, one in enumerate(self.scene.implicits) if name and one.name == name]

    def _number(self, which: int | str, implicits: Sequence[Implicit]) -> int:
        """The number of one of several implicit surfaces."""
        if isinstance(which, str):
            found = [i for i, one in enumerate(implicits) if one.name == which]
            if not which or not found:
                known = sorted({one.name for one in implicits if one.name})
                raise ParameterError(f"no object '{which}'{nearest(which, known)}")
            if len(found) > 1:
                raise ParameterError(f"which: {len(found)} implicit surfaces are called '{which}'; give a number")
            return found[0]
        if which not in range(len(implicits)):
            raise ParameterError(f"which: the scene has {len(implicits)} implicit surfaces, and no {which}")
        return which

    def _unknown(self, name: str) -> None:
        raise ParameterError(f"no object or part '{name}'{nearest(name, sorted(self._names))}")

    @property
    def _names(self) -> set[str]:
        """Of objects and parts."""
        return {one.name for one in self.scene.implicits if one.name} | (self._fields.parts if self._fields else set())

    # --- another set of shapes ------------------------------------------------------------------------------------

    def reshape(self, which: int | str, shape: Solid | None = None, *, material: Material | None = None) -> None:
        """An implicit surface gets another shape, or another material, or both; see :meth:`replace`. It stays where it
        was placed; the parts of another shape are at rest.

        Args:
            which: its number in what was asked for last (at first ``scene.implicits``), or its name.

        Raises:
            ParameterError: there is none such, a flat shape, or neither shape nor material.
            SnippetError: a user's code that does not compile.
            Unsupported: a technique in use cannot draw it.
        """
        if shape is None and material is None:
            raise ParameterError("reshape: neither a shape nor a material")
        asked = list(self._wanted.implicits)
        number = self._number(which, asked)
        before = asked[number]
        asked[number] = replace(before, shape=shape or before.shape, material=material or before.material)
        self.replace(asked)

    def add(self, implicit: Implicit) -> None:
        """One more implicit surface, after the others; see :meth:`replace`, and :meth:`reshape` for what it raises."""
        self.replace([*self._wanted.implicits, implicit])

    def remove(self, which: int | str) -> None:
        """One implicit surface fewer; see :meth:`replace`. The scene's ``motion`` may go on moving it.

        Args:
            which: as of :meth:`reshape`.

        Raises:
            ParameterError: there is none such.
        """
        asked = list(self._wanted.implicits)
        del asked[self._number(which, asked)]
        self.replace(asked)

    def replace(
        self,
        implicits: Iterable[Implicit],
        *,
        motion: Motion | None = None,
        room: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None,
    ) -> None:
        """The scene is to have these implicit surfaces, as soon as it can.

        Another set of kinds of shapes, of snippets above all, is other shaders. So what the new ones need is prepared
        beside what is drawn, by a thread of its own, pipelines included; :meth:`draw` goes on drawing the old ones,
        and takes the new ones with the first frame for which they are ready. What stays is not moved: objects that are
        among both are where :meth:`place`, :meth:`move` and :meth:`edit` have left them by then. Where the set of kinds
        and the number of objects are the same, and no expression nests deeper, nothing is compiled. Of what is asked
        for meanwhile the last is prepared next. Until then the device holds the techniques' own images twice.

        What is wrong with a shape is told here. What only the preparation finds, such as too little memory, the next
        :meth:`draw` or :meth:`settle` raises, and what is drawn stays.

        Args:
            motion: in place of the scene's.
            room: likewise.

        Raises:
            ParameterError: what are no implicit surfaces.
            SnippetError: a user's code that does not compile.
            Unsupported: a technique in use cannot draw them.
        """
        wanted = self._wanted
        asked = wanted.with_(implicits=implicits, motion=motion or wanted.motion, room=room or wanted.room)
        drawn = {id(one) for one in wanted.implicits}
        for one in asked.implicits:
            if id(one) not in drawn:
                check_snippets(self.gpu, one)
        for view in self._views.values():
            view.technique.supports(asked)
        self._asked = asked
        if self._change is None:
            self._prepare()

    @property
    def pending(self) -> bool:
        """Whether something was asked for (:meth:`replace`) that is not drawn yet."""
        return self._change is not None

    def settle(self) -> None:
        """Wait until all that was asked for is ready, and take it; the next frame shows it.

        Raises:
            Exception: as :meth:`draw`.
        """
        while self._change is not None:
            self._follow()

    @property
    def _wanted(self) -> Scene:
        return self._asked or self.scene

    def _prepare(self) -> None:
        assert self._asked is not None
        techniques = {family: view.technique for family, view in self._views.items()}
        camera = self._camera_seen or self.scene.camera
        thread = ThreadPoolExecutor(1, "tyndall.prepare")
        ready = thread.submit(copy.copy(self)._ready, self, self._asked, techniques, camera)
        thread.shutdown(wait=False)
        self._change = _Change(self._asked, techniques, ready)

    def _ready(self, beside: Renderer, scene: Scene, techniques: dict[str, Technique], camera: Camera) -> Renderer:
        """Make this copy of a renderer one of another scene, which shares with it what does not depend on implicit
        surfaces, and has all pipelines that its frames need.
        """
        self._beside, self._own_gpu, self._change, self.scene = beside, False, None, scene
        self._views, self._resources, self._images, self._content, self._volumes = {}, {}, {}, [], []
        self._fields = self._rays = None
        with self.gpu.aside():
            try:
                self._setup(techniques)
                for frame in range(2):  # the first has no past, so it may have other shaders
                    self._frame, self._history = frame, frame
                    with self.gpu.together():
                        self._record(camera, jitter=True, casters=True)
                    self._discard()
            except BaseException:
                self.close()
                raise
        return self

    def _follow(self) -> None:
        """Wait for what is being prepared, take it, and begin to prepare what was asked for since."""
        change = self._change
        assert change is not None
        failure = change.ready.exception()
        self._change = None
        if failure is None:
            try:
                self._take_over(change.ready.result())
            except Exception as error:
                failure = error
        elif any(self.technique(family) is not one for family, one in change.techniques.items()):
            failure = None  # what it shared may have been freed with the technique
            change = None
        if change is not None and self._asked is change.scene:
            self._asked = None
        if self._asked is not None:
            self._prepare()
        if failure is not None:
            raise failure

    def _take_over(self, ready: Renderer) -> None:
        """Draw from now on what another renderer has prepared; what this one has made for its scene is freed."""
        names, techniques = self._names, {family: view.technique for family, view in self._views.items()}
        kept = dict(_kept(self.scene.implicits, ready.scene.implicits))
        try:
            for technique in techniques.values():
                technique.supports(ready.scene)  # others may be in use by now
            if ready._fields and self._fields:
                ready._fields.carry(self._fields, kept)
        except BaseException:
            ready.close()
            raise
        self.gpu.submit()
        old = copy.copy(self)
        for name in _OF_SCENE:
            setattr(self, name, getattr(ready, name))
        self._tree.take(old._tree)
        old._beside, old._own_gpu = self, False
        old.close()
        self._meshes.forget_bundles()
        for family, technique in techniques.items():
            if self.technique(family) is not technique:
                self.use(family, technique)
        self._gone = (self._gone | names) - self._names
        for index in kept:
            self._reach(index)
        self._time = self._camera_seen = None
        self._history = self._sent = 0
        self._remember()

    def _remember(self) -> None:
        """Let go of the pipelines of sets of kinds that were drawn long ago."""
        if self._fields is None:
            return
        slot = self._fields.field.bindings["implicit_objects"].slot
        self._known = [*(one for one in self._known if one != slot), slot]
        for one in self._known[:-_REMEMBERED]:
            self.gpu.forget_programs(one)
        self._known = self._known[-_REMEMBERED:]

    @property
    def uploaded(self) -> int:
        """Bytes that the last frame's implicit surfaces were sent to the device anew: 0 where nothing has moved."""
        return self._uploaded

    def _reach(self, index: int) -> None:
        """Let the scene's box hold an object where it has been placed."""
        assert self._fields is not None
        if (bounds := self.scene.implicits[index].bounds_at(self._fields.placed(index))) is not None:
            self._hold(*bounds)

    def _hold(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
        """Let the scene's box hold another one: by more than it needs, so that maps are seldom fitted anew."""
        lower, upper = self.scene.bounds
        if (low >= lower).all() and (high <= upper).all():
            return
        spare = 0.25 * (np.maximum(high, upper) - np.minimum(low, lower))
        corners = np.where(low < lower, low - spare, lower), np.where(high > upper, high + spare, upper)
        self.scene = self.scene.with_(room=tuple(tuple(float(x) for x in corner) for corner in corners))
        for view in self._views.values():
            view.scene = self.scene
        if self._camera_seen is not None:
            self._camera_row = pack_camera(self._camera_seen, self.scene, self.size, self.gpu.dtype(_CAMERA))

    def dim(self, factor: float) -> None:
        """From the next frame on, all lights shine with this factor of their intensity, ≥ 0; what is ambient stays."""
        rows = pack_lights(self.scene, self.gpu.dtype(_LIGHT))
        rows["intensity"] *= np.float32(factor)
        self.gpu.write(self._lights, rows)

    def restart(self) -> None:
        """Forget temporal history: the next frame is like the first."""
        self._frame = self._history = 0
        self._previous = self._camera_seen = None

    # --- results --------------------------------------------------------------------------------------------------

    def picture(self) -> NDArray[np.uint8]:
        """(height, width, 3) uint8: the tone-mapped picture."""
        return np.ascontiguousarray(self.gpu.read_texture(self._images["picture"])[..., :3])

    def develop(self, radiance: NDArray[np.float32]) -> NDArray[np.uint8]:
        """(height, width, 3) uint8: linear light of that shape, exposed and tone-mapped as a frame is.

        It comes in the place of the frame drawn last.
        """
        light = np.zeros((*radiance.shape[:2], 4), np.float16)
        light[..., :3] = np.clip(radiance, 0, np.finfo(np.float16).max)
        self._update(self.scene.camera, jitter=False)
        self._resolved = self._images["lit"]
        self.gpu.write_texture(self._resolved, light)
        self.technique("tonemap").render(self._view("tonemap"), self._resolved, self._images["picture"])
        self.gpu.submit()
        self.restart()
        return self.picture()

    def radiance(self) -> NDArray[np.float32]:
        """(height, width, 3) float32: linear light after antialiasing, before exposure and tone mapping."""
        return np.ascontiguousarray(self.gpu.read_texture(self._resolved)[..., :3].astype(np.float32))

    def base(self) -> NDArray[np.float32]:
        """(height, width, 3) float32: ``L_b``, the surfaces' light before the air."""
        return np.ascontiguousarray(self.gpu.read_texture(self._base)[..., :3].astype(np.float32))

    def inscattered(self) -> NDArray[np.float32]:
        """(height, width, 3) float32: ``L_v``, the light that the air scatters towards the camera."""
        return np.ascontiguousarray(self.gpu.read_texture(self._images["inscatter"])[..., :3])

    def transmittance(self) -> NDArray[np.float32]:
        """(height, width, 3) float32 in 0..1: ``T``, what the air lets through."""
        return np.ascontiguousarray(
            self.gpu.read_texture(self._images["transmittance_map"])[..., :3].astype(np.float32)
        )

    def depth(self) -> NDArray[np.float32]:
        """(height, width) float32: metres along the view axis, infinite for the background."""
        gpu = self.gpu
        # A depth beside a stencil cannot be copied to the host as it is.
        with gpu.texture("frame.depth_copy", self.size, "r32float", owner=OWNER) as plain:
            gpu.compute("depth", _MODULE, "copy_depth").bind(self._scope, depth_out=plain.write()).dispatch(*self.size)
            raw = gpu.read_texture(plain)[..., 0].astype(np.float32)
        gpu.forget_groups()
        with np.errstate(divide="ignore"):
            return np.float32(self._camera_seen.near if self._camera_seen else 1) / raw

    def surface(self, name: str) -> NDArray[Any]:
        """What the G-buffer holds of what each pixel shows, (height, width) or (height, width, 3).

        Args:
            name: "normals" (world, of unit length), "roughness", "albedo", "metallic" or "emissive", all float32 and 0
                for the background; of implicit surfaces "ids", the object's number from 1 on and 0 for anything else,
                and "steps", how many the march through the pixel took, both uint32.

        Raises:
            ParameterError: an unknown name.
        """
        images: dict[str, tuple[str, Any]] = {
            "normals": ("normal_roughness", slice(0, 3)),
            "roughness": ("normal_roughness", 3),
            "albedo": ("albedo_metallic", slice(0, 3)),
            "metallic": ("albedo_metallic", 3),
            "emissive": ("emissive", slice(0, 3)),
        }
        if name in ("ids", "steps"):
            if self._fields is None:
                return np.zeros(self.size[::-1], np.uint32)
            return self._fields.found()[name]
        if name not in images:
            raise ParameterError(f"surface: no '{name}'{nearest(name, [*images, 'ids', 'steps'])}")
        image, channels = images[name]
        if name == "emissive" and name not in self._targets:
            return np.zeros((*self.size[::-1], 3), np.float32)
        texels = self.gpu.read_texture(self._images[image]).astype(np.float32)
        if image == "albedo_metallic":
            texels /= 255
            texels[..., :3] **= 2  # as albedo.wesl has it
        return np.ascontiguousarray(texels[..., channels])

    def timings(self) -> dict[str, float]:
        """GPU milliseconds of the last frame by pass name, and "frame" for the whole; waits for it.

        Empty where the adapter has no timers. Passes of one name are added up.
        """
        sums: defaultdict[str, float] = defaultdict(float)
        for label, milliseconds in self.gpu.timings():
            sums[label] += milliseconds
        return dict(sums)

    def memory(self) -> dict[str, int]:
        """Bytes that this renderer holds on the device, by owner: "frame", "mesh", "shadow.shadow_map",
        "volumetric.froxel" … Others on the same device do not count; ``gpu.ledger`` has everything.
        """
        totals: Counter[str] = Counter()
        held = [content.resources() for content in self._content] + [view.resources() for view in self._views.values()]
        if self._rays and self._rays.made:
            held.append(self._rays.made.resources())
        held += [filled.field.resources() for filled in self._volumes]
        for resource in itertools.chain(self._resources.values(), *held):
            totals[resource.owner] += resource.size_bytes
        return dict(totals)

    def close(self) -> None:
        """Free everything this renderer made, once what is being prepared is."""
        if self._change is not None:
            ready, self._change = self._change.ready, None
            if ready.exception() is None:
                ready.result().close()
        self.gpu.discard()
        for view in self._views.values():
            view.close()
        if self._rays:
            self._rays.close()
        beside = self._beside
        for content in self._content:
            if beside is None or content is not beside._meshes:
                content.close()
        for filled in self._volumes:
            filled.field.close()
        for key, resource in self._resources.items():
            if beside is None or beside._resources.get(key) is not resource:
                resource.destroy()
        self._views.clear()
        self._content.clear()
        self._volumes.clear()
        self._resources.clear()
        self._rays = None
        self.gpu.forget_groups()
        if self._own_gpu:
            self.gpu.close()


class _Rays:
    """The scene for rays, built when it is asked for first.

    Args:
        beside: what a renderer beside this one has built of the same triangles.

    Attributes:
        made: it, once it is built.
    """

    def __init__(self, renderer: Renderer, beside: World | None) -> None:
        self._gpu, self._scene, self._meshes = renderer.gpu, renderer.scene, renderer._meshes
        self._fields = renderer._fields.field if renderer._fields else None
        self._beside = beside
        self.made: World | None = None

    def get(self) -> World:
        if self.made is None:
            self.made = (
                self._beside.beside(self._fields)
                if self._beside
                else World(self._gpu, self._scene, meshes=self._meshes, fields=self._fields)
            )
        return self.made

    def take(self, old: _Rays) -> None:
        """The tree of the renderer beside, which gives way to this one."""
        if self.made is not None and (old.made is not None or self._beside is not None):
            self.close()
        if old.made is not None:
            self.made, old.made = old.made, None
            self.made.see(self._fields)
        self._beside = None

    def close(self) -> None:
        if self.made is not None:
            self.made.close()
            self.made = None


@dataclass(frozen=True, eq=False)
class _Change:
    """What is being prepared: of which scene, for which techniques, and the renderer that will be ready."""

    scene: Scene
    techniques: dict[str, Technique]
    ready: Future[Renderer]


def _kept(old: Sequence[Implicit], new: Sequence[Implicit]) -> Iterator[tuple[int, int]]:
    """Numbers, among the new and among the old, of objects that are the same, or are called the same."""
    numbers = {id(one): number for number, one in enumerate(old)}
    names = [Counter(one.name for one in some if one.name) for some in (old, new)]
    called = {one.name: number for number, one in enumerate(old) if names[0][one.name] == 1}
    for number, one in enumerate(new):
        before = numbers.get(id(one))
        if before is None and names[1][one.name] == 1:
            before = called.get(one.name)
            if before is not None and old[before].transform != one.transform:
                before = None
        if before is not None:
            yield number, before


# --- packing ------------------------------------------------------------------------------------------------------


def view_matrix(camera: Camera) -> NDArray[np.float64]:
    """World to camera space, 4×4 for column vectors: x right, y up, the camera looks along -z."""
    position = np.asarray(camera.position)
    back = position - np.asarray(camera.target)
    back /= np.linalg.norm(back)
    right = np.cross(camera.up, back)
    right /= np.linalg.norm(right)
    rotation = np.array([right, np.cross(back, right), back])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, -rotation @ position
    return matrix


def projection_matrix(camera: Camera, aspect: float) -> NDArray[np.float64]:
    """Camera space to reversed-Z clip space with an infinite far plane."""
    f = 1 / math.tan(camera.fov / 2)
    return np.array([[f / aspect, 0, 0, 0], [0, f, 0, 0], [0, 0, 0, camera.near], [0, 0, -1, 0]])


def pack_camera(camera: Camera, scene: Scene, size: tuple[int, int], dtype: np.dtype[Any]) -> Any:
    """The camera's uniform, for samples at the pixels' centres."""
    aspect = size[0] / size[1]
    view = view_matrix(camera)
    tangent = math.tan(camera.fov / 2)
    row = np.zeros((), dtype)
    row["view_proj"] = row["still_view_proj"] = (projection_matrix(camera, aspect) @ view).T
    row["position"], row["near"] = camera.position, camera.near
    row["right"], row["up"] = view[0, :3] * tangent * aspect, view[1, :3] * tangent
    row["forward"] = -view[2, :3]
    row["exposure"] = 2.0**camera.exposure
    row["light_count"] = len(scene.lights)
    row["ambient"], row["background"] = scene.ambient, scene.background
    row["size"] = size
    row["start"], row["reach"] = depth_range(camera, scene)
    row["power"] = lights_power(scene, float(row["reach"] - row["start"])) or 1.0
    return row


def shifted(row: Any, shift: tuple[float, float]) -> Any:
    """A copy of a camera's uniform whose samples lie that many pixels (right, down) of the pixels' centres."""
    moved = row.copy()
    if not any(shift):
        return moved
    width, height = row["size"]
    ndc = (-2 * shift[0] / width, 2 * shift[1] / height)  # the picture moves against the samples
    moved["jitter"] = ndc
    for axis in range(2):
        # clip.xy += ndc·clip.w; the matrix is stored by columns.
        moved["view_proj"][:, axis] += np.float32(ndc[axis]) * row["view_proj"][:, 3]
    return moved


def lights_power(scene: Scene, depth: float) -> float:
    """Sum of the lights' illuminances in lux; of a near one at the nearest air, or ``depth`` away where it is in it.

    A scale for what is kept in half floats, and no more exact than that.
    """
    low, high = air_box(scene)
    total = 0.0
    for light in scene.lights:
        area = 1.0
        if not isinstance(light, DirectionalLight):
            outside = np.maximum(0, np.maximum(low - light.position, light.position - high))
            area = max(float(outside @ outside), depth**2)
        total += max(light.color) * light.intensity / area
    return total


def air_box(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower and upper corner of the medium, or of the scene where the medium is everywhere."""
    if scene.medium.bounds is None:
        return scene.bounds
    low, high = scene.medium.bounds
    return np.array(low), np.array(high)


def depth_range(camera: Camera, scene: Scene) -> tuple[float, float]:
    """View depths between which the medium lies: its box, or from the camera to the scene's far side."""
    depth = (box_corners(*air_box(scene)) - np.asarray(camera.position)) @ -view_matrix(camera)[2, :3]
    start = 0.0 if scene.medium.bounds is None else max(0.0, float(depth.min()))
    return start, max(float(depth.max()), start + 10 * camera.near)


def pack_medium(medium: Medium, dtype: np.dtype[Any]) -> Any:
    """The medium's uniform."""
    row = np.zeros((), dtype)
    row["scattering"], row["extinction"] = medium.scattering, medium.extinction
    row["phase_kind"] = _PHASES.index(medium.phase.kind)
    if isinstance(medium.phase, HenyeyGreenstein):
        row["phase_parameter"] = medium.phase.g
    elif isinstance(medium.phase, Schlick):
        row["phase_parameter"] = medium.phase.k
    row["lower"], row["upper"] = medium.bounds or ((-_UNBOUNDED,) * 3, (_UNBOUNDED,) * 3)
    return row


def light_kinds(scene: Scene) -> dict[str, bool]:
    """What shaders may know of the lights when they are compiled."""
    return {"LIGHTS_RECT": any(isinstance(light, RectLight) for light in scene.lights)}


def pack_lights(scene: Scene, dtype: np.dtype[Any]) -> NDArray[Any]:
    """The lights' storage buffer, at least one row."""
    rows = np.zeros(max(1, len(scene.lights)), dtype)
    for row, light, first in zip(rows, scene.lights, first_layers(scene), strict=False):
        row["kind"] = _KINDS.index(light.kind)
        row["intensity"] = np.multiply(light.color, light.intensity)
        row["first_layer"] = first
        if not isinstance(light, DirectionalLight):
            row["position"] = light.position
        if isinstance(light, (DirectionalLight, SpotLight, RectLight)):
            row["direction"] = np.asarray(light.direction) / np.linalg.norm(light.direction)
        row["radius"] = light.extent
        if isinstance(light, SpotLight):
            row["cone_scale"], row["cone_offset"] = light.cone
        if isinstance(light, RectLight):
            row["across"], row["along"] = light.axes
    return rows
