"""Buffers and textures, each counted in the ledger, and how a shader sees them.

A *slot* is what a shader sees of a resource: its WESL declaration and its layout entry, derived from the resource and
the way it is bound (sampled, written, as uniform …). A *bound* resource is a slot with the native object behind it.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
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
    "rg32uint": 8,
    "rgba32uint": 16,
    "depth32float": 4,
    "depth32float-stencil8": 8,  # as drivers pad it
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
    "rg32uint": (np.uint32, 2),
    "rgba32uint": (np.uint32, 4),
    "depth32float": (np.float32, 1),
}


def texel_dtype(format: str) -> tuple[Any, int]:
    """numpy scalar and channel count of a texture format."""
    return _NUMPY[format]


@dataclass(frozen=True)
class Slot:
    """How a shader sees a resource: a declaration of ``{name}``, the struct or import that it needs before it, and the
    functions that read and write a resource of several bindings (:class:`Parts`).

    ``untrusted``: its preamble holds code that a user wrote, so what it is linked into is compiled with every check on.
    """

    declaration: str
    layout: tuple[tuple[str, Any], ...]
    visibility: int
    preamble: str = ""
    accessors: str = ""
    untrusted: bool = False

    def __hash__(self) -> int:
        if (known := self.__dict__.get("_hash")) is None:  # a frame looks its pipelines up by their slots
            known = hash((self.declaration, self.layout, self.visibility, self.preamble))
            object.__setattr__(self, "_hash", known)
        return known

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

    def declaring(self, **constants: bool) -> Bound:
        """The same, with constants that shaders may import beside it: branches on them cost nothing."""
        return self.telling("\n".join(f"const {name} = {str(value).lower()};" for name, value in constants.items()))

    def telling(self, text: str, *, untrusted: bool = False) -> Bound:
        """The same, with WESL declarations (and imports, a line each) that shaders may import beside it.

        Args:
            untrusted: a user wrote some of it.
        """
        preamble = "\n".join([*filter(None, [self.slot.preamble]), text])
        return Bound(replace(self.slot, preamble=preamble, untrusted=untrusted or self.slot.untrusted), self.native)


@dataclass(frozen=True)
class Parts:
    """A buffer as several bindings, since one holds no more than the adapter's limit (128 MiB on a software one).

    Bound as ``name``, a shader imports ``name_at(index)`` and, where it may write, ``name_put(index, value)``.
    """

    bounds: tuple[Bound, ...]

    def named(self, name: str) -> dict[str, Bound]:
        """The bindings, by the names that the functions use."""
        return {f"{name}_{i}": bound for i, bound in enumerate(self.bounds)}


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
        return iter(list(self._entries.values()))  # another thread may add to them

    @property
    def total(self) -> int:
        """Bytes of everything."""
        return sum(size for _, _, size in self)

    def by_owner(self) -> dict[str, int]:
        """Bytes by owner."""
        totals: Counter[str] = Counter()
        for owner, _, size in self:
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


class Resource(Closing):
    """Something in the ledger that can be destroyed once."""

    def __init__(self, ledger: Ledger, owner: str, label: str, size: int, native: Any) -> None:
        self.owner, self.label, self.size_bytes, self.native = owner, label, size, native
        self._ledger, self._serial = ledger, next(_serial)
        self._bounds: dict[str, Bound] = {}
        self._parts: dict[str, Parts] = {}
        ledger.add(self._serial, owner, label, size)

    def destroy(self) -> None:
        """Free the device memory and its line in the ledger."""
        if self.native is not None:
            self.native.destroy()
            self._ledger.remove(self._serial)
            self.native = None

    def close(self) -> None:
        """As :meth:`destroy`."""
        self.destroy()


class Buffer(Resource):
    """A device buffer of elements of one WESL type.

    Attributes:
        element: WESL type of an element: ``f32``, ``vec4f``, or a struct as ``package::wesl::light::Light``.
        dtype: numpy layout of an element.
    """

    element: str = "u32"
    dtype: np.dtype[Any] = np.dtype("<u4")
    part_bytes: int = 128 << 20

    def split(self, element: str | None = None, *, write: bool = False) -> Parts:
        """As however many storage bindings its size takes, read through ``name_at``; written too, in compute only.

        Args:
            element: WESL type to see it as, if not its own; one of the scalars and vectors below.
        """
        kind = f"split {element} {write}"
        if kind not in self._parts:
            self._parts[kind] = self._split(element, write)
        return self._parts[kind]

    def _split(self, element: str | None, write: bool) -> Parts:
        if element is None and "::" in self.element:
            (name, preamble), stride = self._named(), self.dtype.itemsize
        else:
            name, preamble = element or self.element, ""
            stride = _STRIDES[name]
        shift = (self.part_bytes // stride).bit_length() - 1  # elements of a part: a power of two
        count = max(1, -(-self.size_bytes // (stride << shift)))
        access = "read_write" if write else "read"
        layout = (("buffer", (("type", "storage" if write else "read-only-storage"),)),)
        bounds = []
        for i in range(count):
            start = i * (stride << shift)
            slot = Slot(
                f"var<storage, {access}> {{name}}: array<{name}>;",
                layout,
                _COMPUTE if write else _ALL,
                preamble,
                _accessors(name, count, shift, write) if i == 0 else "",
            )
            size = min(self.size_bytes - start, stride << shift)
            bounds.append(Bound(slot, {"buffer": self.native, "offset": start, "size": size}))
        return Parts(tuple(bounds))

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

    def window(self, offset: int, size: int, element: str, *, write: bool = False) -> Bound:
        """As the storage binding of ``size`` bytes from ``offset`` on, a multiple of 256; written in compute only.

        Args:
            element: WESL type to see it as, a scalar or vector, or "atomic<u32>" where it may be written.
        """
        key = f"window {offset} {size} {element} {write}"
        if key not in self._bounds:
            access, kind = ("read_write", "storage") if write else ("read", "read-only-storage")
            slot = Slot(
                f"var<storage, {access}> {{name}}: array<{element}>;",
                (("buffer", (("type", kind),)),),
                _COMPUTE if write else _ALL,
            )
            self._bounds[key] = Bound(slot, {"buffer": self.native, "offset": offset, "size": size})
        return self._bounds[key]

    def _bound(self, declaration: str, kind: str, visibility: int, size: int) -> Bound:
        if kind not in self._bounds:
            name, preamble = self._named()
            slot = Slot(declaration.replace("ELEMENT", name), (("buffer", (("type", kind),)),), visibility, preamble)
            self._bounds[kind] = Bound(slot, {"buffer": self.native, "offset": 0, "size": size})
        return self._bounds[kind]


_STRIDES = {"u32": 4, "i32": 4, "f32": 4, "vec2u": 8, "vec2f": 8, "vec4u": 16, "vec4f": 16}


def _accessors(element: str, count: int, shift: int, write: bool) -> str:
    """WESL functions over the parts of a buffer; NAME stands for what it is bound as."""

    def cases(statement: str) -> str:
        if count == 1:
            return statement.format(part=0, index="i")
        mask = (1 << shift) - 1
        body = "".join(
            f"{f'case {part}u' if part < count - 1 else 'default'}: {{ {statement.format(part=part, index='k')} }} "
            for part in range(count)
        )
        return f"let k = i & {mask}u; switch i >> {shift}u {{ {body}}}"

    read = f"fn NAME_at(i: u32) -> {element} {{ {cases('return NAME_{part}[{index}];')} }}"
    put = f"fn NAME_put(i: u32, value: {element}) {{ {cases('NAME_{part}[{index}] = value;')} }}"
    return f"{read}\n{put}" if write else read


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
            view = self._aspect("depth-only") if self.has_stencil else self.view()
            scalar = "u32" if self.format.endswith("uint") else "f32"
            wesl = f"texture_depth_{suffix}" if depth else f"texture_{suffix}<{scalar}>"
            kind = "depth" if depth else "uint" if scalar == "u32" else "float"
            if self.format in ("r32float", "rg32float", "rgba32float"):
                kind = "unfilterable-float"
            layout = (("texture", (("sample_type", kind), ("view_dimension", self.dimension))),)
            self._bounds["sampled"] = Bound(Slot(f"var {{name}}: {wesl};", layout, _ALL), view)
        return self._bounds["sampled"]

    @property
    def has_stencil(self) -> bool:
        """Whether its format has stencil values."""
        return self.format.endswith("stencil8")

    def stencil(self) -> Bound:
        """The stencil values as ``texture_2d<u32>``."""
        if "stencil" not in self._bounds:
            layout = (("texture", (("sample_type", "uint"), ("view_dimension", "2d"))),)
            slot = Slot("var {name}: texture_2d<u32>;", layout, _ALL)
            self._bounds["stencil"] = Bound(slot, self._aspect("stencil-only"))
        return self._bounds["stencil"]

    def _aspect(self, aspect: str) -> Any:
        format = {"depth-only": "depth32float", "stencil-only": "stencil8"}[aspect]
        return self.native.create_view(dimension=self.dimension, aspect=aspect, format=format)

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
