"""Buffers and textures, each counted in the ledger, and how a shader sees them.

A *slot* is what a shader sees of a resource: its WESL declaration and its layout entry, derived from the resource and
the way it is bound (sampled, written, as uniform …). A *bound* resource is a slot with the native object behind it.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import numpy as np
import wgpu

_COMPUTE = wgpu.ShaderStage.COMPUTE
_ALL = wgpu.ShaderStage.COMPUTE | wgpu.ShaderStage.VERTEX | wgpu.ShaderStage.FRAGMENT

BYTES_PER_TEXEL = {
    "r8unorm": 1,
    "rgba8unorm": 4,
    "rgba8unorm-srgb": 4,
    "r16float": 2,
    "rg16float": 4,
    "rgba16float": 8,
    "r32float": 4,
    "rg32float": 8,
    "rgba32float": 16,
    "r32uint": 4,
    "rgba32uint": 16,
    "depth32float": 4,
}
_NUMPY = {
    "r8unorm": (np.uint8, 1),
    "rgba8unorm": (np.uint8, 4),
    "rgba8unorm-srgb": (np.uint8, 4),
    "r16float": (np.float16, 1),
    "rg16float": (np.float16, 2),
    "rgba16float": (np.float16, 4),
    "r32float": (np.float32, 1),
    "rg32float": (np.float32, 2),
    "rgba32float": (np.float32, 4),
    "r32uint": (np.uint32, 1),
    "rgba32uint": (np.uint32, 4),
    "depth32float": (np.float32, 1),
}


def texel_dtype(format: str) -> tuple[Any, int]:
    """numpy scalar and channel count of a texture format."""
    return _NUMPY[format]


@dataclass(frozen=True)
class Slot:
    """How a shader sees a resource: a declaration of ``{name}``, and the struct or import that it needs before it."""

    declaration: str
    layout: tuple[tuple[str, Any], ...]
    visibility: int
    preamble: str = ""

    def entry(self, binding: int) -> dict[str, Any]:
        (kind, items) = self.layout[0]
        return {"binding": binding, "visibility": self.visibility, kind: dict(items)}


_serial = itertools.count()


class Bound:
    """A slot with its native resource. ``key`` is unique while the resource lives, so bind groups can be cached by
    it.
    """

    __slots__ = ("key", "native", "slot")

    def __init__(self, slot: Slot, native: Any) -> None:
        self.slot, self.native, self.key = slot, native, next(_serial)


class Ledger:
    """Bytes by label and owner of everything that lives on the device."""

    def __init__(self) -> None:
        self._entries: dict[int, tuple[str, str, int]] = {}

    def add(self, serial: int, owner: str, label: str, size: int) -> None:
        self._entries[serial] = (owner, label, size)

    def remove(self, serial: int) -> None:
        self._entries.pop(serial, None)

    def __iter__(self) -> Iterator[tuple[str, str, int]]:
        """(owner, label, bytes) of each resource."""
        return iter(self._entries.values())

    @property
    def total(self) -> int:
        """Bytes of everything."""
        return sum(size for _, _, size in self._entries.values())

    def by_owner(self) -> dict[str, int]:
        """Bytes by owner."""
        totals: Counter[str] = Counter()
        for owner, _, size in self._entries.values():
            totals[owner] += size
        return dict(totals)


class Closing:
    """Something that a ``with`` block closes at its end."""

    def close(self) -> None:
        """Free what is held; a second call does nothing."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Resource:
    """Something in the ledger that can be destroyed once."""

    def __init__(self, ledger: Ledger, owner: str, label: str, size: int, native: Any) -> None:
        self.owner, self.label, self.size_bytes, self.native = owner, label, size, native
        self._ledger, self._serial = ledger, next(_serial)
        self._bounds: dict[str, Bound] = {}
        ledger.add(self._serial, owner, label, size)

    def destroy(self) -> None:
        """Free the device memory and its line in the ledger."""
        if self.native is not None:
            self.native.destroy()
            self._ledger.remove(self._serial)
            self.native = None


class Buffer(Resource):
    """A device buffer of elements of one WESL type.

    Attributes:
        element: WESL type of an element: ``f32``, ``vec4f``, or a struct as ``package::wesl::light::Light``.
        dtype: numpy layout of an element.
    """

    element: str = "u32"
    dtype: np.dtype[Any] = np.dtype("<u4")

    def _named(self) -> tuple[str, str]:
        if "::" in self.element:
            return self.element.rpartition("::")[2], f"import {self.element};"
        return self.element, ""

    def read(self) -> Bound:
        """``var<storage, read> name: array<element>``."""
        return self._bound("var<storage, read> {name}: array<ELEMENT>;", "read-only-storage", _ALL, self.size_bytes)

    def read_write(self) -> Bound:
        """``var<storage, read_write> name: array<element>``, in compute only."""
        return self._bound("var<storage, read_write> {name}: array<ELEMENT>;", "storage", _COMPUTE, self.size_bytes)

    def uniform(self) -> Bound:
        """``var<uniform> name: element``, the first one."""
        return self._bound("var<uniform> {name}: ELEMENT;", "uniform", _ALL, self.dtype.itemsize)

    def _bound(self, declaration: str, kind: str, visibility: int, size: int) -> Bound:
        if kind not in self._bounds:
            name, preamble = self._named()
            slot = Slot(declaration.replace("ELEMENT", name), (("buffer", (("type", kind),)),), visibility, preamble)
            self._bounds[kind] = Bound(slot, {"buffer": self.native, "offset": 0, "size": size})
        return self._bounds[kind]


class ParamsBuffer(Resource):
    """The uniform of a dataclass of parameters (:mod:`tyndall.gpu.params`)."""

    bound: Bound

    @staticmethod
    def slot(name: str, struct: str) -> Slot:
        """The uniform of a struct of this name, with the WESL text that declares it."""
        return Slot(f"var<uniform> {{name}}: {name};", (("buffer", (("type", "uniform"),)),), _ALL, struct)


class Texture(Resource):
    """A device texture: 2-D, 2-D array (``layers``), 3-D (``depth``) with one mip level unless told otherwise."""

    format: str
    size: tuple[int, int, int]
    dimension: str  # "2d", "2d-array" or "3d"

    def __init__(self, ledger: Ledger, owner: str, label: str, size: int, native: Any) -> None:
        super().__init__(ledger, owner, label, size, native)
        self._views: dict[int | None, Any] = {}

    def view(self, *, layer: int | None = None) -> Any:
        """A native view: of everything, or of one layer as 2-D."""
        if layer not in self._views:
            part = {} if layer is None else {"base_array_layer": layer, "array_layer_count": 1}
            dimension = self.dimension if layer is None else "2d"
            self._views[layer] = self.native.create_view(dimension=dimension, **part)
        return self._views[layer]

    def sampled(self) -> Bound:
        """As a sampled texture: ``texture_2d<f32>``, ``texture_3d<f32>``, ``texture_depth_2d_array`` …"""
        if "sampled" not in self._bounds:
            suffix = self.dimension.replace("-", "_")
            depth = self.format.startswith("depth")
            scalar = "u32" if self.format.endswith("uint") else "f32"
            wesl = f"texture_depth_{suffix}" if depth else f"texture_{suffix}<{scalar}>"
            kind = "depth" if depth else "uint" if scalar == "u32" else "float"
            if self.format in ("r32float", "rg32float", "rgba32float"):
                kind = "unfilterable-float"
            layout = (("texture", (("sample_type", kind), ("view_dimension", self.dimension))),)
            self._bounds["sampled"] = Bound(Slot(f"var {{name}}: {wesl};", layout, _ALL), self.view())
        return self._bounds["sampled"]

    def write(self) -> Bound:
        """As a write-only storage texture, in compute only."""
        return self._storage("write", "write-only")

    def read_write(self) -> Bound:
        """As a read-write storage texture (r32float, r32uint and r32sint only, by WebGPU), in compute only."""
        return self._storage("read_write", "read-write")

    def _storage(self, wesl: str, access: str) -> Bound:
        if wesl not in self._bounds:
            layout = (
                ("storage_texture", (("access", access), ("format", self.format), ("view_dimension", self.dimension))),
            )
            declaration = f"var {{name}}: texture_storage_{self.dimension.replace('-', '_')}<{self.format}, {wesl}>;"
            self._bounds[wesl] = Bound(Slot(declaration, layout, _COMPUTE), self.view())
        return self._bounds[wesl]


class Sampler:
    """Not in the ledger: samplers take no memory."""

    def __init__(self, native: Any, comparison: bool) -> None:
        kind = "comparison" if comparison else "filtering"
        wesl = "sampler_comparison" if comparison else "sampler"
        self.bound = Bound(Slot(f"var {{name}}: {wesl};", (("sampler", (("type", kind),)),), _ALL), native)
