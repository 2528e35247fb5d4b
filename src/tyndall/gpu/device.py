"""The device: adapter choice, resources, passes and their times.

A pass is one expression whose name is its label, its timer and its line in every report::

    gpu.compute("volumetric.froxel.scatter", "package::techniques::volumetric::froxel", "scatter")
        .bind(camera=camera, params=params, scattering=grid.write())
        .dispatch(190, 90, 128)

``bind`` names what the shader may import from ``package::bindings``; the layout holds what it does import. Pipelines,
bind groups and layouts are cached, so that the same expression costs little in the next frame. Passes are recorded
into one encoder until :meth:`Gpu.submit`. Inside ``with gpu.together():`` the pipelines that are not there yet are
built side by side, each in a thread, while what is to be recorded waits in order.

A device may be used from several threads. Each records, submits and discards passes of its own, and all share what is
cached: so what one thread prepares (:meth:`Gpu.aside`) another one finds made.
"""

from __future__ import annotations

import contextlib
import logging
import os
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from time import perf_counter
from typing import Any, Self

import numpy as np
import wgpu
from numpy.typing import NDArray

from tyndall.gpu import driver_types
from tyndall.gpu import params as declared
from tyndall.gpu.passes import Passes
from tyndall.gpu.resources import (
    BYTES_PER_TEXEL,
    Bound,
    Buffer,
    Closing,
    Ledger,
    ParamsBuffer,
    Parts,
    Resource,
    Sampler,
    Slot,
    Texture,
    texel_dtype,
)
from tyndall.gpu.shader import Linker, create_module, diagnose

log = logging.getLogger("tyndall")

_FEATURES = ("timestamp-query", "float32-blendable", "depth32float-stencil8")
_LIMITS = (
    "max-texture-dimension-2d",
    "max-texture-dimension-3d",
    "max-texture-array-layers",
    "max-storage-buffer-binding-size",
    "max-buffer-size",
    "max-sampled-textures-per-shader-stage",
    "max-storage-textures-per-shader-stage",
    "max-storage-buffers-per-shader-stage",
    "max-color-attachment-bytes-per-sample",
    "max-compute-workgroup-storage-size",
    "max-compute-invocations-per-workgroup",
    "max-compute-workgroup-size-x",
    "max-compute-workgroup-size-y",
    "max-compute-workgroup-size-z",
)
_RANK_TYPE = {"DiscreteGPU": 0, "IntegratedGPU": 1, "VirtualGPU": 2, "Unknown": 3, "CPU": 4}
_BACKENDS = ("Vulkan", "Metal", "D3D12")
_MAX_TIMED_PASSES = 2048
_MOST_PREPARED = 1024
_UPLOAD_CHUNK = 64 << 20
LINE = 32_768  # workgroups in a row of a one-dimensional dispatch


class GpuError(RuntimeError):
    """No usable adapter, or a request beyond its limits. One line."""


def adapters() -> list[wgpu.GPUAdapter]:
    """The adapters of this machine that can draw a frame, best first: discrete, integrated, virtual, software.

    OpenGL is left out: it has no float targets and too few storage bindings for the frame.
    """
    # Where there is no desktop session the loader complains on stderr about the missing variable.
    lacking = sys.platform == "linux" and "XDG_RUNTIME_DIR" not in os.environ
    if lacking:
        os.environ["XDG_RUNTIME_DIR"] = tempfile.gettempdir()
    try:
        driver_types.look_up()
        found = [a for a in wgpu.gpu.enumerate_adapters_sync() if a.info["backend_type"] in _BACKENDS]
    finally:
        if lacking:
            del os.environ["XDG_RUNTIME_DIR"]  # other libraries of the process would take it for a desktop's
    return sorted(found, key=lambda a: _RANK_TYPE.get(a.info["adapter_type"], 3))


def choose_adapter(name: str | None = None) -> wgpu.GPUAdapter:
    """The first of :func:`choose_adapters`."""
    return choose_adapters(name)[0]


def choose_adapters(name: str | None = None) -> list[wgpu.GPUAdapter]:
    """The adapter of a name, and all others of this machine that are called the same.

    It is the adapter whose device name or backend contains ``name`` (any case), or else the best.

    ``$TYNDALL_ADAPTER`` stands in for a ``name`` that is not given.

    Raises:
        GpuError: none at all, or none of that name.
    """
    found = adapters()
    if not found:
        raise GpuError(
            "no graphics adapter answers; on Debian or Ubuntu, 'apt-get install mesa-vulkan-drivers' gives a "
            "software one"
        )
    asked = "" if name else " ($TYNDALL_ADAPTER)"
    name = name or os.environ.get("TYNDALL_ADAPTER") or None
    if name is None:
        best = found[0]
        if best.info["adapter_type"] == "CPU":
            log.warning("no GPU found: drawing with the software adapter %s", best.info["device"])
        return _alike(best, found)
    for adapter in found:
        info = adapter.info
        if name.lower() in f"{info['device']} {info['vendor']} {info['backend_type']} {info['adapter_type']}".lower():
            return _alike(adapter, found)
    known = ", ".join(f"'{a.info['device']}' ({a.info['backend_type']})" for a in found)
    raise GpuError(f"no adapter matches '{name}'{asked}; there are {known}")


def _alike(adapter: wgpu.GPUAdapter, found: Sequence[wgpu.GPUAdapter]) -> list[wgpu.GPUAdapter]:
    kind = ("device", "backend_type", "adapter_type")
    return [other for other in found if all(other.info[key] == adapter.info[key] for key in kind)]


@dataclass(frozen=True)
class Blend:
    """Colour blending of a render target: ``result = source·source_factor (op) destination·destination_factor``."""

    source: str = "one"
    destination: str = "one"
    operation: str = "add"

    def state(self) -> dict[str, Any]:
        part = {"src_factor": self.source, "dst_factor": self.destination, "operation": self.operation}
        return {"color": part, "alpha": part}


ADD = Blend()


@dataclass(frozen=True)
class Stencil:
    """What a fragment does to the stencil value: by the face it is of, and by the depth test.

    Attributes:
        front_pass, back_pass: where the depth test passes.
        front_fail, back_fail: where it fails.
    """

    front_pass: str = "keep"
    back_pass: str = "keep"
    front_fail: str = "keep"
    back_fail: str = "keep"


@dataclass(frozen=True)
class Raster:
    """Fixed-function state of a render pipeline.

    Attributes:
        targets: colour formats with their blending, in order of ``@location``.
        depth: depth format, or None.
        depth_compare: reversed-Z draws what is "greater".
        depth_bias, depth_slope_bias: added to the depth, in its smallest steps and per slope; triangles only.
        stencil: what is done to the stencil values of a depth format that has them; None leaves them alone.
        cull: "none", "front" or "back"; front faces are counter-clockwise.
        vertex_buffers: per buffer, (stride, ((shader location, format, offset), …)).
    """

    targets: tuple[tuple[str, Blend | None], ...] = ()
    depth: str | None = None
    depth_compare: str = "greater"
    depth_write: bool = True
    depth_bias: int = 0
    depth_slope_bias: float = 0.0
    stencil: Stencil | None = None
    cull: str = "none"
    topology: str = "triangle-list"
    vertex_buffers: tuple[tuple[int, tuple[tuple[int, str, int], ...]], ...] = ()


# All that a pipeline is built from: module, entry points, names and slots of what is bound, overlay, features, state.
_ProgramKey = tuple[
    str,
    tuple[str, ...],
    tuple[str, ...],
    tuple[Slot, ...],
    tuple[tuple[str, str], ...],
    tuple[tuple[str, bool], ...],
    Raster | None,
]


def _program_key(
    module: str,
    entries: tuple[str, ...],
    bound: Mapping[str, Bound],
    overlay: Mapping[str, str],
    features: Mapping[str, bool],
    state: Raster | None,
) -> _ProgramKey:
    slots = tuple(b.slot for b in bound.values())
    return module, entries, tuple(bound), slots, tuple(overlay.items()), tuple(features.items()), state


@dataclass
class _Program:
    pipeline: Any
    group_layout: Any
    used: tuple[tuple[int, str], ...]
    groups: dict[tuple[int, ...], Any]
    workgroup: tuple[int, int, int]  # of a compute pipeline


class _Waiting(threading.local):
    """What a thread has not recorded yet, in order; None outside of :meth:`Gpu.together`."""

    kept: list[Callable[[], object]] | None = None


class _Calls:
    """Stands for a native pass that has not begun yet: keeps what is called of it, none of which answers anything."""

    def __init__(self) -> None:
        self._made: list[tuple[str, tuple[Any, ...], dict[str, Any]]] = []

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *args, **named: self._made.append((name, args, named))

    def repeat(self, native: Any) -> None:
        for name, args, named in self._made:
            getattr(native, name)(*args, **named)


@dataclass(frozen=True)
class Built:
    """A pipeline that was built, and the milliseconds that its parts took: linking its modules, making the driver's
    module of them (parsed and validated), and the pipeline (translated and compiled).
    """

    label: str
    link_ms: float
    module_ms: float
    pipeline_ms: float


class _Recording(threading.local):
    """What a thread records.

    Attributes:
        labels: of the passes that are timed.
        submitted: likewise, of the last submit.
        timed: whether its passes are: there is one set of timers.
    """

    def __init__(self) -> None:
        self.encoder: Any = None
        self.chain: Any = None
        self.labels: list[str] = []
        self.submitted: list[str] = []
        self.timed = True


def _of_thread(name: str) -> Any:
    """An attribute that is each thread's own."""
    return property(lambda gpu: getattr(gpu._recording, name), lambda gpu, value: setattr(gpu._recording, name, value))


class Gpu(Closing):
    """A device with its caches, ledger and timers.

    Args:
        adapter: part of an adapter's name; see :func:`choose_adapters`.
        rank: which of the adapters that are called the same, modulo their number, so that processes may share a
            machine's GPUs out among themselves by their own numbers.

    Attributes:
        rank: its place among the adapters that are called the same.
        built: the pipelines so far, in the order in which they were done.
    """

    _encoder, _chain = _of_thread("encoder"), _of_thread("chain")
    _labels, _submitted_labels = _of_thread("labels"), _of_thread("submitted")

    def __init__(self, adapter: str | None = None, *, rank: int = 0) -> None:
        alike = choose_adapters(adapter)
        self.rank = rank % len(alike)
        native = alike[self.rank]
        self.adapter = native
        self.adapter_info: dict[str, Any] = dict(native.info)
        features = [f for f in _FEATURES if f in native.features]
        limits = {name: native.limits[name] for name in _LIMITS if native.limits.get(name)}
        self.device = native.request_device_sync(label="tyndall", required_features=features, required_limits=limits)
        self.features = frozenset(features)
        self.limits: Mapping[str, int] = {**native.limits, **limits}
        self.ledger = Ledger()
        self.part_bytes: int = self.limits["max-storage-buffer-binding-size"]
        self.linker = Linker.of_package()
        self.built: list[Built] = []
        self._programs: dict[_ProgramKey, _Program | Future[_Program]] = {}
        self._builders = ThreadPoolExecutor(_threads(), thread_name_prefix="tyndall.pipelines")
        self._waiting = _Waiting()
        self._prepared: dict[Any, Any] = {}  # passes and pipelines with their groups, by all that they were made of
        self._samplers: dict[Any, Sampler] = {}
        self._constants: dict[int, Buffer] = {}
        self._recording = _Recording()
        self._timed = "timestamp-query" in self.features
        if self._timed:
            self._queries = self.device.create_query_set(type="timestamp", count=2 * _MAX_TIMED_PASSES)
            usage = wgpu.BufferUsage
            size = 16 * _MAX_TIMED_PASSES
            made = (
                self.device.create_buffer(label=f"timers.{label}", size=size, usage=bits)
                for label, bits in (
                    ("resolved", usage.QUERY_RESOLVE | usage.COPY_SRC),
                    ("readback", usage.COPY_DST | usage.MAP_READ),
                )
            )
            self._timers = [Resource(self.ledger, "timers", native.label, size, native) for native in made]
            self._resolved, self._readback = (timer.native for timer in self._timers)
            self._period = _timestamp_period(self.device)
        self._passes = Passes(self._queries if self._timed else None)

    @property
    def depth_format(self) -> str:
        """Of the picture's depth: with a stencil beside it where the adapter has that."""
        return "depth32float-stencil8" if "depth32float-stencil8" in self.features else "depth32float"

    # --- resources ------------------------------------------------------------------------------------------------

    def texture(
        self,
        label: str,
        size: tuple[int, ...],
        format: str,
        *,
        owner: str,
        dimension: str = "2d",
        usage: str = "sampled storage",
        mips: int = 1,
        data: NDArray[Any] | None = None,
    ) -> Texture:
        """A texture of (width, height), (width, height, layers) or (width, height, depth) texels.

        Args:
            usage: words of "sampled", "storage", "target"; copies are always allowed.
            data: texels of the first mip level, C-contiguous, rows first.

        Raises:
            GpuError: beyond the adapter's limits or memory.
        """
        width, height, depth = (*size, 1)[:3] if len(size) == 2 else size
        limit = self.limits["max-texture-dimension-3d" if dimension == "3d" else "max-texture-dimension-2d"]
        layers = self.limits["max-texture-array-layers"]
        asked = f"{label}: {width}×{height}×{depth} texels"
        if max(width, height) > limit or (dimension == "3d" and depth > limit):
            raise GpuError(f"{asked}; this adapter's limit is {limit}")
        if dimension != "3d" and depth > layers:
            raise GpuError(f"{asked}; this adapter's limit is {layers} layers")
        flags = {
            "sampled": wgpu.TextureUsage.TEXTURE_BINDING,
            "storage": wgpu.TextureUsage.STORAGE_BINDING,
            "target": wgpu.TextureUsage.RENDER_ATTACHMENT,
        }
        bits = wgpu.TextureUsage.COPY_SRC | wgpu.TextureUsage.COPY_DST
        for word in usage.split():
            bits |= flags[word]
        try:
            native = self.device.create_texture(
                label=label,
                size=(width, height, depth),
                format=format,
                usage=bits,
                dimension="3d" if dimension == "3d" else "2d",
                mip_level_count=mips,
            )
        except wgpu.GPUError as error:
            raise GpuError(f"{asked}: {_cause(error)}") from None
        bytes_ = 0
        for level in range(mips):
            w, h = max(1, width >> level), max(1, height >> level)
            d = max(1, depth >> level) if dimension == "3d" else depth
            bytes_ += w * h * d * BYTES_PER_TEXEL[format]
        texture = Texture(self.ledger, owner, label, bytes_, native)
        texture.format, texture.size, texture.dimension = format, (width, height, depth), dimension
        if data is not None:
            self.write_texture(texture, data)
        return texture

    def write_texture(self, texture: Texture, data: NDArray[Any], *, mip: int = 0, layer: int = 0) -> None:
        """Upload the texels of one mip level (of one layer)."""
        width, height = (max(1, n >> mip) for n in texture.size[:2])
        depth = max(1, texture.size[2] >> mip) if texture.dimension == "3d" else 1
        self.device.queue.write_texture(
            {"texture": texture.native, "mip_level": mip, "origin": (0, 0, layer)},
            np.ascontiguousarray(data),
            {"bytes_per_row": width * BYTES_PER_TEXEL[texture.format], "rows_per_image": height},
            (width, height, depth),
        )

    def buffer(
        self,
        label: str,
        data: NDArray[Any] | int,
        *,
        owner: str,
        element: str = "u32",
        usage: str = "storage",
    ) -> Buffer:
        """A buffer from an array, or of a number of bytes.

        Args:
            element: WESL type of an element; a struct's layout is read from its WESL source.
            usage: words of "storage", "uniform", "vertex", "index", "indirect"; copies are always allowed.

        Raises:
            GpuError: larger than the adapter allows, or than its memory.
        """
        size = data if isinstance(data, int) else data.nbytes
        size = max(16, -(-size // 4) * 4)
        if size > self.limits["max-buffer-size"]:
            raise GpuError(f"{label}: {size} bytes; a buffer of this adapter holds {self.limits['max-buffer-size']}")
        bits = wgpu.BufferUsage.COPY_SRC | wgpu.BufferUsage.COPY_DST
        for word in usage.split():
            bits |= getattr(wgpu.BufferUsage, word.upper())
        try:
            native = self.device.create_buffer(label=label, size=size, usage=bits)
        except wgpu.GPUError as error:
            raise GpuError(f"{label}: {size} bytes: {_cause(error)}") from None
        result = Buffer(self.ledger, owner, label, size, native)
        result.element, result.part_bytes = element, self.part_bytes
        if "::" in element:
            result.dtype = self.linker.dtype(element)
        if not isinstance(data, int):
            self.write(result, data)
        return result

    def write(self, buffer: Buffer | ParamsBuffer, data: NDArray[Any], offset: int = 0) -> None:
        """Copy an array into a buffer, at a byte offset, before the next submit."""
        raw = np.ascontiguousarray(data).reshape(-1).view(np.uint8)
        if len(raw) % 4:
            raw = np.concatenate([raw, np.zeros(-len(raw) % 4, np.uint8)])
        for start in range(0, len(raw), _UPLOAD_CHUNK):
            chunk = raw[start : start + _UPLOAD_CHUNK]
            self.device.queue.write_buffer(buffer.native, offset + start, chunk)
            if len(raw) > _UPLOAD_CHUNK:
                self.device.queue.submit([])

    def clear_buffer(self, buffer: Buffer, offset: int = 0, size: int | None = None) -> None:
        """Fill a buffer, or ``size`` bytes of it from ``offset`` on, with zeros, between the passes recorded before and
        after.
        """
        self._record(lambda: self.encoder.clear_buffer(buffer.native, offset, size))

    def copy_buffer(self, source: Buffer, target: Buffer) -> None:
        """Copy all of a buffer into another of its size, between the passes recorded before and after."""
        size = source.size_bytes
        self._record(lambda: self.encoder.copy_buffer_to_buffer(source.native, 0, target.native, 0, size))

    def dtype(self, struct: str) -> np.dtype[Any]:
        """The numpy layout of a WESL struct, by its path."""
        return self.linker.dtype(struct)

    def params(self, label: str, instance: Any, *, owner: str) -> ParamsBuffer:
        """The uniform buffer of a declared parameter set; shaders see it as the struct that its fields declare."""
        packed = declared.pack(instance)
        bits = wgpu.BufferUsage.UNIFORM | wgpu.BufferUsage.COPY_DST
        native = self.device.create_buffer(label=label, size=packed.nbytes, usage=bits)
        result = ParamsBuffer(self.ledger, owner, label, packed.nbytes, native)
        name = f"{type(instance).__name__}Params"
        slot = ParamsBuffer.slot(name, declared.struct_wesl(type(instance), name))
        result.bound = Bound(slot, {"buffer": native, "offset": 0, "size": packed.nbytes})
        self.write(result, packed)
        return result

    def constant(self, value: int) -> Bound:
        """A uniform ``u32`` that holds ``value``, for a pass that is repeated with an index."""
        if value not in self._constants:
            data = np.array([value, 0, 0, 0], np.uint32)
            buffer = self.buffer(f"constant {value}", data, owner="constants", element="u32", usage="uniform")
            if self._constants.setdefault(value, buffer) is not buffer:  # another thread was first
                buffer.destroy()
        return self._constants[value].uniform()

    def sampler(
        self, *, filter: str = "linear", u: str = "clamp-to-edge", v: str = "clamp-to-edge", compare: str | None = None
    ) -> Bound:
        """A sampler, or a comparison sampler."""
        key = (filter, u, v, compare)
        if key not in self._samplers:
            descriptor: dict[str, Any] = {
                "mag_filter": filter,
                "min_filter": filter,
                "mipmap_filter": "nearest" if compare else filter,
                "address_mode_u": u,
                "address_mode_v": v,
                "address_mode_w": "clamp-to-edge",
            }
            if compare is not None:
                descriptor["compare"] = compare
            self._samplers[key] = Sampler(self.device.create_sampler(**descriptor), compare is not None)
        return self._samplers[key].bound

    def read_texture(self, texture: Texture, *, layer: int | None = None) -> NDArray[Any]:
        """The texels of the first mip level as (height, width, channels), or (depth, height, width, channels)."""
        self.submit()
        width, height, depth = texture.size
        dtype, channels = texel_dtype(texture.format)
        row = width * BYTES_PER_TEXEL[texture.format]
        origin = (0, 0, layer or 0)
        if layer is not None:
            depth = 1
        raw = self.device.queue.read_texture(
            {"texture": texture.native, "mip_level": 0, "origin": origin},
            {"bytes_per_row": row, "rows_per_image": height},
            (width, height, depth),
        )
        texels = np.frombuffer(raw, dtype).reshape(depth, height, width, channels)
        return texels[0] if depth == 1 else texels

    def read_buffer(self, buffer: Buffer) -> NDArray[Any]:
        """The buffer's elements, with its dtype."""
        self.submit()
        return np.frombuffer(self.device.queue.read_buffer(buffer.native), buffer.dtype)

    # --- passes ---------------------------------------------------------------------------------------------------

    @property
    def encoder(self) -> Any:
        """The encoder of the passes since the last submit."""
        self._catch_up()
        if self._encoder is None:
            self._encoder = self.device.create_command_encoder(label="tyndall")
            self._labels = []
        return self._encoder

    def timestamps(self, label: str) -> dict[str, Any] | None:
        """Timestamp writes for a pass of this name; None where the adapter has no timers or too many passes ran."""
        if (slot := self._timer(label)) is None:
            return None
        return {
            "query_set": self._queries,
            "beginning_of_pass_write_index": slot,
            "end_of_pass_write_index": slot + 1,
        }

    def _timer(self, label: str) -> int | None:
        """The first of the two queries of a pass of this name."""
        recording = self._recording
        if not self._timed or not recording.timed or len(recording.labels) >= _MAX_TIMED_PASSES:
            return None
        recording.labels.append(label)
        return 2 * len(recording.labels) - 2

    def _begin_compute(self, label: str) -> Any:
        """A new pass."""
        encoder = self.encoder  # a new one begins a new list of timers
        return self._passes.begin(encoder, label, self._timer(label))

    def compute(self, label: str, module: str, entry: str = "main") -> ComputePass:
        """A compute pass of one dispatch; see the module's docstring."""
        return ComputePass(self, label, module, entry)

    @contextlib.contextmanager
    def chain(self, label: str) -> Iterator[None]:
        """One compute pass of this name around all that is dispatched inside the block, in order, timed as one."""
        self._record(partial(self._begin_chain, label))
        try:
            yield
        finally:
            self._record(self._end_chain)

    def _begin_chain(self, label: str) -> None:
        self._chain = self._begin_compute(label)

    def _end_chain(self) -> None:
        chain, self._chain = self._chain, None
        self._passes.end(chain)

    @property
    def _kept(self) -> list[Callable[[], object]] | None:
        return self._waiting.kept

    @contextlib.contextmanager
    def together(self) -> Iterator[None]:
        """Build the pipelines that passes inside the block still lack side by side, each in a thread of its own.

        What is recorded from the first of these passes on waits, in order, and is recorded at the block's end, or when
        it is submitted or the encoder asked for. So what is wrong with a shader is raised there, on the caller's
        thread, and what has been recorded since the last submit is forgotten then.
        """
        if self._kept is not None:
            yield
            return
        self._waiting.kept = []
        try:
            yield
            self._catch_up()
        except BaseException:
            self.discard()
            raise
        finally:
            self._waiting.kept = None

    def _record(self, record: Callable[[], object], *, ready: bool = True) -> None:
        """Record something now, or in its turn where something before it, or itself, waits for a pipeline."""
        if self._kept is None or (ready and not self._kept):
            record()
        else:
            self._kept.append(record)

    def _catch_up(self) -> None:
        if self._kept:
            kept, self._waiting.kept = self._kept, []
            for record in kept:
                record()

    @contextlib.contextmanager
    def render(
        self,
        label: str,
        targets: Sequence[tuple[Any, tuple[float, float, float, float] | None]] = (),
        depth: tuple[Any, float | None] | None = None,
        *,
        depth_read_only: bool = False,
        stencil: int | None = None,
    ) -> Iterator[Any]:
        """A render pass on native views. ``None`` as the clear value keeps what is there.

        A read-only depth buffer is tested against, and shaders may read it in the same pass. ``stencil`` is what the
        stencil values are cleared to, of a depth format that has them.
        """
        descriptor: dict[str, Any] = {
            "label": label,
            "color_attachments": [
                {
                    "view": view,
                    "load_op": "load" if clear is None else "clear",
                    "store_op": "store",
                    "clear_value": clear or (0, 0, 0, 0),
                }
                for view, clear in targets
            ],
        }
        if depth is not None:
            view, clear_depth = depth
            descriptor["depth_stencil_attachment"] = (
                {"view": view, "depth_read_only": True}
                if depth_read_only
                else {
                    "view": view,
                    "depth_load_op": "load" if clear_depth is None else "clear",
                    "depth_store_op": "store",
                    "depth_clear_value": clear_depth or 0.0,
                }
            )
            descriptor["depth_stencil_attachment"] |= (
                {"stencil_read_only": True}
                if stencil is None
                else {"stencil_load_op": "clear", "stencil_store_op": "store", "stencil_clear_value": stencil}
            )
        if self._kept:
            calls = _Calls()
            yield calls
            self._kept.append(partial(self._render, descriptor, calls))
            return
        native = self._begin_render(descriptor)
        try:
            yield native
        finally:
            native.end()

    def _begin_render(self, descriptor: dict[str, Any]) -> Any:
        encoder = self.encoder
        stamps = self.timestamps(descriptor["label"])
        return encoder.begin_render_pass(**descriptor, **({"timestamp_writes": stamps} if stamps else {}))

    def _render(self, descriptor: dict[str, Any], calls: _Calls) -> None:
        native = self._begin_render(descriptor)
        calls.repeat(native)
        native.end()

    def raster(
        self,
        module: str,
        state: Raster,
        bindings: Mapping[str, Any],
        *,
        vertex: str = "vertex",
        fragment: str | None = "fragment",
        overlay: Mapping[str, str] | None = None,
        features: Mapping[str, bool] | None = None,
    ) -> tuple[Any, Any]:
        """(pipeline, bind group) for drawing; record them into a render pass or a bundle."""
        bound = _all_bound(bindings)
        entries = (vertex,) if fragment is None else (vertex, fragment)
        key = _key(module, entries, bound, overlay or {}, features or {}, state)
        made: tuple[Any, Any] | None = self._prepared.get(key)
        if made is None:
            program = self._program(_program_key(module, entries, bound, overlay or {}, features or {}, state))
            made = self._prepare(key, (program.pipeline, self._group(program, bound)))
        return made

    def bundle(self, label: str, state: Raster, *, depth_read_only: bool = False) -> Any:
        """A render bundle encoder for passes with the formats of ``state``: recorded once, replayed at no cost."""
        return self.device.create_render_bundle_encoder(
            label=label,
            color_formats=[format for format, _ in state.targets],
            depth_stencil_format=state.depth,
            depth_read_only=depth_read_only,
        )

    @contextlib.contextmanager
    def aside(self) -> Iterator[None]:
        """This thread's passes inside the block are not timed: the timers are those of the thread that draws."""
        before, self._recording.timed = self._recording.timed, False
        try:
            yield
        finally:
            self._recording.timed = before

    def submit(self) -> None:
        """Send the recorded passes to the device."""
        self._catch_up()
        if self._encoder is None:
            return
        if self._labels:
            count = 2 * len(self._labels)
            self._encoder.resolve_query_set(self._queries, 0, count, self._resolved, 0)
            self._encoder.copy_buffer_to_buffer(self._resolved, 0, self._readback, 0, 8 * count)
        self.device.queue.submit([self._encoder.finish()])
        self._submitted_labels, self._labels, self._encoder = self._labels, [], None

    @property
    def recording(self) -> bool:
        """Whether passes wait to be submitted."""
        return self._encoder is not None or bool(self._kept)

    def discard(self) -> None:
        """Forget the passes recorded since the last submit."""
        self._encoder, self._chain, self._labels = None, None, []
        if self._kept:
            self._kept.clear()

    def timings(self) -> list[tuple[str, float]]:
        """(name, milliseconds) of each pass of the last submit, and ("frame", first begin to last end). Waits for it.

        Empty where the adapter has no timestamp queries.
        """
        labels = self._submitted_labels
        if not labels:
            self.wait()
            return []
        self._readback.map_sync(wgpu.MapMode.READ, 0, 16 * len(labels))
        try:
            raw = np.frombuffer(self._readback.read_mapped(0, 16 * len(labels)), np.uint64).astype(np.float64)
        finally:
            self._readback.unmap()
        stamps = raw.reshape(-1, 2) * self._period * 1e-6
        if self.adapter_info["adapter_type"] == "CPU":
            # Mesa's software adapter runs passes one after another, but may stamp a pass's beginning only when its
            # work is done; the end of the pass before is when it really began.
            stamps[1:, 0] = stamps[:-1, 1]
        times = [(label, float(max(0.0, end - begin))) for label, (begin, end) in zip(labels, stamps, strict=True)]
        return [*times, ("frame", float(stamps[:, 1].max() - stamps[:, 0].min()))]

    def wait(self) -> None:
        """Block until the device has finished all submitted work."""
        self.submit()
        # wgpu-py 0.32 declares the callback of on_submitted_work_done wrongly; reading four bytes back waits as well.
        fence = self.device.create_buffer(size=4, usage=wgpu.BufferUsage.COPY_SRC)
        self.device.queue.read_buffer(fence)
        fence.destroy()

    def check_wgsl(self, text: str) -> tuple[int, int, str] | None:
        """Line, column (from 1) and message of the first fault that the driver finds in WGSL; None: there is none."""
        return diagnose(self.device, text)

    # --- pipelines ------------------------------------------------------------------------------------------------

    def _program(self, key: _ProgramKey) -> _Program:
        """A pipeline: the one that is there, or that is being built once it is, or else built now."""
        found = self._programs.get(key)
        if isinstance(found, _Program):
            return found
        if found is None:
            program = self._build(*key)
        else:
            try:
                program = found.result()
            except BaseException:
                self._programs.pop(key, None)  # to be tried anew
                raise
        self._programs[key] = program
        return program

    def _begun(self, key: _ProgramKey) -> _Program | None:
        """A pipeline; inside :meth:`together` None while it is being built."""
        found = self._programs.get(key)
        if isinstance(found, _Program):
            return found
        if self._kept is None:
            return self._program(key)
        if found is None:
            self._programs[key] = self._builders.submit(self._build, *key)
        return None

    def _build(
        self,
        module: str,
        entries: tuple[str, ...],
        names: tuple[str, ...],
        slots: tuple[Slot, ...],
        overlay: tuple[tuple[str, str], ...],
        features: tuple[tuple[str, bool], ...],
        state: Raster | None,
    ) -> _Program:
        # Runs in several threads at once: it may read the linker and call the device, and touch nothing else.
        label = f"{module.removeprefix('package::').replace('::', '/')}.{entries[0]}"
        begin = perf_counter()
        linked = self.linker.link(module, entries, _bindings_module(names, slots), dict(overlay), dict(features))
        after_link = perf_counter()
        trusted = not any(slot.untrusted for slot in slots)
        native = create_module(self.device, self.linker, linked, label, trusted=trusted)
        after_module = perf_counter()
        used = tuple((i, names[i]) for i in sorted(linked.used))
        layout_entries = [slots[i].entry(i) for i, _ in used]
        stages = wgpu.ShaderStage.VERTEX | wgpu.ShaderStage.FRAGMENT if state is not None else wgpu.ShaderStage.COMPUTE
        for entry in layout_entries:
            entry["visibility"] &= stages
        group_layout = self.device.create_bind_group_layout(label=label, entries=layout_entries)
        layout = self.device.create_pipeline_layout(label=label, bind_group_layouts=[group_layout])
        pipeline: Any
        workgroup = (0, 0, 0)
        if state is None:
            workgroup = self.linker.workgroup(linked, entries[0])
            pipeline = self.device.create_compute_pipeline(
                label=label, layout=layout, compute={"module": native, "entry_point": entries[0]}
            )
        else:
            pipeline = self.device.create_render_pipeline(**_raster_descriptor(label, layout, native, entries, state))
        times = (after_link - begin, after_module - after_link, perf_counter() - after_module)
        self.built.append(Built(label, *(round(1e3 * seconds, 3) for seconds in times)))
        return _Program(pipeline, group_layout, used, {}, workgroup)

    def _group(self, program: _Program, bound: Mapping[str, Bound]) -> Any:
        key = tuple(bound[name].key for _, name in program.used)
        group = program.groups.get(key)
        if group is None:
            if len(program.groups) > 256:
                program.groups.clear()
            group = program.groups[key] = self.device.create_bind_group(
                layout=program.group_layout,
                entries=[{"binding": i, "resource": bound[name].native} for i, name in program.used],
            )
        return group

    def _prepare[T](self, key: Any, made: T) -> T:
        """Keep what a pass of the next frame looks up whole, without asking for its program and its group apart."""
        if len(self._prepared) >= _MOST_PREPARED:
            self._prepared.clear()
        self._prepared[key] = made
        return made

    def forget_groups(self) -> None:
        """Drop cached bind groups, so that destroyed resources are not kept alive by them."""
        self._prepared.clear()
        for program in list(self._programs.values()):  # other threads may add to them
            if isinstance(program, _Program):
                program.groups.clear()

    def forget_programs(self, slot: Slot) -> None:
        """Drop the pipelines of all shaders that were linked with what this slot declares and tells."""
        self._prepared.clear()
        for key in list(self._programs):
            if slot in key[3]:
                self._programs.pop(key, None)

    # --- life -----------------------------------------------------------------------------------------------------

    def close(self) -> None:
        """Free everything. The ledger then holds what others forgot to destroy."""
        self.discard()
        self._builders.shutdown(cancel_futures=True)  # waits for what uses the device
        for buffer in self._constants.values():
            buffer.destroy()
        self._constants.clear()
        self._prepared.clear()
        self._programs.clear()
        self._samplers.clear()
        if self._timed:
            self._queries.destroy()
            for timer in self._timers:
                timer.destroy()
            self._timed = False
        self.device.destroy()


class ComputePass:
    """A compute pass under construction."""

    def __init__(self, gpu: Gpu, label: str, module: str, entry: str) -> None:
        self._gpu, self._label, self._module, self._entry = gpu, label, module, entry
        self._bound: dict[str, Bound] = {}
        self._overlay: Mapping[str, str] = {}
        self._features: Mapping[str, bool] = {}

    def bind(self, scope: Mapping[str, Any] | None = None, **resources: Any) -> Self:
        """Give names to resources: a :class:`Bound`, :class:`Parts`, or a texture (sampled), buffer (read) or
        parameter buffer.
        """
        if scope:
            self._bound.update(_all_bound(scope))
        if resources:
            self._bound.update(_all_bound(resources))
        return self

    def overlay(self, modules: Mapping[str, str]) -> Self:
        """Let virtual modules stand for real ones: ``{"package::visibility": "package::techniques::…"}``."""
        self._overlay = modules
        return self

    def features(self, **switches: bool) -> Self:
        """Switches for ``@if`` in the shader."""
        self._features = switches
        return self

    def dispatch(self, width: int, height: int = 1, depth: int = 1) -> None:
        """Run one thread for each element of the given size (rounded up to whole workgroups; the shader checks)."""
        self.prepare().over(width, height, depth)

    def dispatch_line(self, count: int) -> None:
        """Run one thread for each of ``count`` elements, in rows of :data:`LINE` workgroups: the limit of one dimension
        is 65,535. The shader's index is ``(workgroup.y · LINE + workgroup.x) · size + local``.
        """
        self.prepare().line(count)

    def prepare(self) -> Prepared:
        """The same pass, to be run many times at little cost."""
        gpu, entries = self._gpu, (self._entry,)
        key = _key(self._module, entries, self._bound, self._overlay, self._features, self._label)
        made: Prepared | None = gpu._prepared.get(key)
        if made is None:
            program = _program_key(self._module, entries, self._bound, self._overlay, self._features, None)
            made = gpu._prepare(key, Prepared(gpu, self._label, program, self._bound))
        return made


class Prepared:
    """A compute pass with its pipeline and bindings. It keeps what is bound alive, so it must not outlive that."""

    def __init__(self, gpu: Gpu, label: str, key: _ProgramKey, bound: Mapping[str, Bound]) -> None:
        self._gpu, self._label, self._key = gpu, label, key
        self._program = gpu._begun(key)
        self._group = gpu._group(self._program, bound) if self._program else None
        self._bound = bound if self._program else dict(bound)

    def _built(self) -> _Program:
        if self._program is None:
            self._program = self._gpu._program(self._key)
            self._group = self._gpu._group(self._program, self._bound)
        return self._program

    @property
    def workgroup(self) -> tuple[int, int, int]:
        """The size of a workgroup. Waits for the pipeline."""
        return self._built().workgroup

    def over(self, width: int, height: int = 1, depth: int = 1) -> None:
        """As :meth:`ComputePass.dispatch`."""

        def dispatch(passes: Passes, native: Any, size: tuple[int, int, int]) -> None:
            passes.dispatch(native, -(-width // size[0]), -(-height // size[1]), -(-depth // size[2]))

        self._record(dispatch)

    def line(self, count: int) -> None:
        """As :meth:`ComputePass.dispatch_line`."""

        def dispatch(passes: Passes, native: Any, size: tuple[int, int, int]) -> None:
            groups = max(1, -(-count // size[0]))
            passes.dispatch(native, min(groups, LINE), -(-groups // LINE), 1)

        self._record(dispatch)

    def run(self, x: int, y: int = 1, z: int = 1) -> None:
        """Run that many workgroups: in a pass of its own, or as part of the chain that is open."""
        self._record(lambda passes, native, _: passes.dispatch(native, x, y, z))

    def run_indirect(self, arguments: Buffer, offset: int = 0) -> None:
        """As :meth:`run`, of the three numbers of workgroups that stand in a buffer at a byte offset."""
        self._record(lambda passes, native, _: passes.dispatch_indirect(native, arguments.native, offset))

    def _record(self, dispatch: Callable[[Passes, Any, tuple[int, int, int]], None]) -> None:
        if self._program is not None and not self._gpu._kept:
            self._encode(dispatch)
        else:
            self._gpu._record(partial(self._encode, dispatch), ready=self._program is not None)

    def _encode(self, dispatch: Callable[[Passes, Any, tuple[int, int, int]], None]) -> None:
        gpu, program = self._gpu, self._built()
        native = gpu._chain or gpu._begin_compute(self._label)
        try:
            gpu._passes.use(native, program.pipeline, self._group)
            dispatch(gpu._passes, native, program.workgroup)
        finally:
            if gpu._chain is None:
                gpu._passes.end(native)


def _threads() -> int:
    """How many pipelines are built at once: as many as the process has processors."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _key(
    module: str,
    entries: tuple[str, ...],
    bound: Mapping[str, Bound],
    overlay: Mapping[str, str],
    features: Mapping[str, bool],
    more: Any,
) -> tuple[Any, ...]:
    """What a pass is known by: bindings by their names and by what they are themselves, which the key keeps alive."""
    return (module, entries, more, *bound, *bound.values(), *overlay.items(), *features.items())


def _all_bound(resources: Mapping[str, Any]) -> Mapping[str, Bound]:
    if set(map(type, resources.values())) == {Bound}:  # as it is in most passes
        return resources
    bound: dict[str, Bound] = {}
    for name, value in resources.items():
        if type(value) is Bound:
            bound[name] = value
        elif isinstance(value, Parts):
            bound.update(value.named(name))
        else:
            bound[name] = _as_bound(value)
    return bound


def _as_bound(value: Any) -> Bound:
    if isinstance(value, Bound):
        return value
    if isinstance(value, Texture):
        return value.sampled()
    if isinstance(value, Buffer):
        return value.read()
    if isinstance(value, ParamsBuffer):
        return value.bound
    raise TypeError(f"{type(value).__name__} cannot be bound")


def _bindings_module(names: Sequence[str], slots: Sequence[Slot]) -> str:
    preambles = list(dict.fromkeys(slot.preamble for slot in slots if slot.preamble))
    told = [line for preamble in preambles for line in preamble.splitlines()]
    imports = list(dict.fromkeys(line for line in told if line.startswith("import")))
    structs = [line for line in told if not line.startswith("import")]
    lines = [
        f"@group(0) @binding({i}) {slot.declaration.format(name=name)}"
        for i, (name, slot) in enumerate(zip(names, slots, strict=True))
    ]
    accessors = [
        slot.accessors.replace("NAME", name.rpartition("_")[0])
        for name, slot in zip(names, slots, strict=True)
        if slot.accessors
    ]
    return "\n".join([*imports, *structs, *lines, *accessors, ""])


def _raster_descriptor(label: str, layout: Any, module: Any, entries: tuple[str, ...], state: Raster) -> dict[str, Any]:
    descriptor: dict[str, Any] = {
        "label": label,
        "layout": layout,
        "vertex": {
            "module": module,
            "entry_point": entries[0],
            "buffers": [
                {
                    "array_stride": stride,
                    "step_mode": "vertex",
                    "attributes": [
                        {"shader_location": location, "format": format, "offset": offset}
                        for location, format, offset in attributes
                    ],
                }
                for stride, attributes in state.vertex_buffers
            ],
        },
        "primitive": {"topology": state.topology, "cull_mode": state.cull, "front_face": "ccw"},
    }
    if len(entries) > 1:
        descriptor["fragment"] = {
            "module": module,
            "entry_point": entries[1],
            "targets": [
                {"format": format, **({"blend": blend.state()} if blend else {})} for format, blend in state.targets
            ],
        }
    if state.depth is not None:
        descriptor["depth_stencil"] = {
            "format": state.depth,
            "depth_write_enabled": state.depth_write,
            "depth_compare": state.depth_compare,
            "depth_bias": state.depth_bias,
            "depth_bias_slope_scale": state.depth_slope_bias,
        }
        if state.stencil is not None:
            s = state.stencil
            for face, passes, fails in (("front", s.front_pass, s.front_fail), ("back", s.back_pass, s.back_fail)):
                descriptor["depth_stencil"][f"stencil_{face}"] = {
                    "compare": "always", "pass_op": passes, "depth_fail_op": fails, "fail_op": "keep",
                }  # fmt: skip
    return descriptor


def _cause(error: Exception) -> str:
    """The innermost line of the driver's report, such as "Not enough memory left."."""
    return str(error).strip().splitlines()[-1].strip()


def _timestamp_period(device: wgpu.GPUDevice) -> float:
    """Nanoseconds of one timestamp tick; wgpu-py does not wrap the call, and 1 is what WebGPU promises."""
    try:
        from wgpu.backends.wgpu_native import _api as api

        return float(api.libf.wgpuQueueGetTimestampPeriod(device.queue._internal))
    except (ImportError, AttributeError):
        return 1.0


__all__ = [
    "ADD",
    "Blend",
    "Bound",
    "Buffer",
    "Gpu",
    "GpuError",
    "Raster",
    "Resource",
    "Stencil",
    "Texture",
    "adapters",
    "choose_adapter",
]
