"""Depth of triangles seen from lights, drawn by compute passes into all maps at once.

A data-centre GPU has few units that rasterise and many that compute: on an H200, 100,000 triangles into one map of
1024² texels take its rasteriser 0.3 ms. So triangles are sorted by the size of their boxes on the map (as in Laine and
Karras 2011, *High-performance software rasterization on GPUs*), and depth is kept by an atomic maximum of its bits
(Karis et al. 2021, *Nanite virtualized geometry*), whose order is that of the depths, as these are not negative:

- ``bin``, a thread a triangle and map, drops what is beside the map, culled, or between the centres of texels; fills
  what is small; and lists the others.
- ``medium``, an indirect dispatch, has 32 threads a triangle of at most 64×64 texels.
- ``large``, an indirect dispatch, has up to 64 workgroups a triangle, which take turns at its blocks of 64×64 texels
  and leave out those that are outside of an edge. Triangles that cross the near plane, or reach too far aside, are
  clipped there.

It draws what a rasteriser does: corners are snapped to 1/256 texel, edge functions are whole numbers and exact, and a
texel's centre on an edge belongs to one of its two triangles (top-left rule), so that neighbours leave no gap and do
not overlap. The products of a large triangle's edges have 46 bits; a block takes their value at its corner, which fits
32 bits, or else is too far from 0 to change its sign within the block. Depths are reversed-Z, of the snapped corners,
and 0 where nothing was drawn.

Both lists share a buffer that has a place for every triangle and map, so that none can overflow; large triangles get
more workgroups than one while there is room for them. Where that buffer would be very large, maps are drawn in turns.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tyndall.content.contract import Cull
from tyndall.content.outline import Placed
from tyndall.gpu.device import LINE, Gpu, GpuError
from tyndall.gpu.resources import Bound, Buffer, Parts, Resource

MODULE = "package::content::rasterize"
_PART = f"{MODULE}::RasterPart"
_MIRRORED, _DOUBLE_SIDED = 1, 2  # as rasterize.wesl has them
CULLS: tuple[Cull, ...] = ("none", "front", "back")  # as rasterize.wesl numbers them
_ALIGNED = 256  # bytes at which a binding may begin
_LARGE_ARGUMENTS = 16  # bytes from a turn's arguments to those of its large triangles
_EXTRA = 1 << 16  # workgroups, beyond one for each, that large triangles may have
_ITEM_BYTES = 64 << 20  # a list of this size is for several maps; of a single one, whatever it takes


class Triangles:
    """Placed triangles on the device, for threads that each take one.

    Attributes:
        count: of triangles, once for each placement.
        parts: how many placements.
        bindings: what ``rasterize.wesl`` reads them from.
    """

    def __init__(
        self, gpu: Gpu, placed: Sequence[Placed], streams: tuple[Buffer, Buffer, Bound], *, owner: str
    ) -> None:
        """``streams`` are positions, indices and instances."""
        rows = np.zeros(len(placed) + 1, gpu.dtype(_PART))
        self.count, self.parts = 0, len(placed)
        for row, p in zip(rows, placed, strict=False):
            row["first_triangle"], row["triangle_base"] = self.count, p.first_index // 3
            row["vertex_base"], row["instance"] = p.first_vertex, p.instance
            row["faces"] = _MIRRORED * p.mirrored | _DOUBLE_SIDED * p.mesh.material.double_sided
            self.count += p.mesh.triangle_count
        rows[-1]["first_triangle"] = self.count
        positions, indices, instances = streams
        self._parts = gpu.buffer("raster.parts", rows, owner=owner, element=_PART)
        self.bindings: dict[str, Bound | Parts] = {
            "raster_parts": self._parts.read(),
            "raster_positions": positions.split("f32"),
            "raster_indices": indices.split("u32"),
            "raster_instances": instances,
        }

    def resources(self) -> list[Resource]:
        """What it holds on the device."""
        return [self._parts]


@dataclass(frozen=True)
class DepthStack:
    """Square maps in one buffer of words, the bits of their depths, row by row from the top.

    Attributes:
        size: texels along a side.
        layers: how many maps.
        words: the buffer; ``words.split("u32")`` reads it. Word ``layer · stride + y · size + x``.
    """

    size: int
    layers: int
    words: Buffer

    @staticmethod
    def stride_of(size: int) -> int:
        """Words from one map to the next."""
        return -(-4 * size * size // _ALIGNED) * (_ALIGNED // 4)

    @classmethod
    def bytes_of(cls, size: int, layers: int) -> int:
        """Of the buffer that so many maps need."""
        return 4 * cls.stride_of(size) * layers

    @property
    def stride(self) -> int:
        """Words from one map to the next."""
        return self.stride_of(self.size)


def draws(gpu: Gpu, triangles: Sequence[Triangles], size: int, layers: int) -> bool:
    """Whether this adapter's buffers are large enough."""
    limit = gpu.limits["max-storage-buffer-binding-size"]
    fits = all(8 * (t.count + _EXTRA) <= limit for t in triangles) and DepthStack.bytes_of(size, 1) <= limit
    return fits and DepthStack.bytes_of(size, layers) <= gpu.limits["max-buffer-size"]


def rasterize(
    gpu: Gpu,
    label: str,
    triangles: Sequence[Triangles],
    layers: Bound,
    stack: DepthStack,
    cull: Cull,
    make_buffer: Callable[[str, int, str, str], Buffer],
    *,
    chained: bool = True,
) -> None:
    """Draw the depth of triangles into all maps of a stack, which it clears first.

    Args:
        label: of the passes.
        layers: ``shadow_layers``, a row a map with ``view_proj``.
        cull: faces to leave out, as the light sees them; double-sided materials are always drawn whole.
        make_buffer: gives a buffer of a label, bytes, element and usage; the same one when it is asked again.
        chained: as one pass; else each dispatch is a pass of its own, ``label.bin`` …, so that it is timed.

    Raises:
        GpuError: more triangles or texels than this adapter's buffers hold.
    """
    if not draws(gpu, triangles, stack.size, stack.layers):
        raise GpuError(
            f"{label}: {stack.layers} maps of {stack.size}² texels, or their triangles, are more than this adapter's "
            "buffers hold"
        )
    gpu.clear_buffer(stack.words)
    if not triangles or not stack.layers:
        return
    limit = gpu.limits["max-storage-buffer-binding-size"]
    map_bytes = 4 * stack.stride
    most = max(t.count for t in triangles)
    turn = max(1, min(stack.layers, limit // map_bytes, min(_ITEM_BYTES, limit) // (8 * most)))
    turns = [(t, first) for t in triangles for first in range(0, stack.layers, turn)]
    extra = min(_EXTRA, 63 * turn * most)
    item_words = 2 * (turn * most + extra)
    items = make_buffer("items", 4 * item_words, "u32", "storage")
    counts = make_buffer("counts", _ALIGNED * len(turns), "atomic<u32>", "storage indirect")
    gpu.clear_buffer(counts)
    with gpu.chain(label) if chained else contextlib.nullcontext():
        for number, (t, first) in enumerate(turns):
            maps = min(turn, stack.layers - first)
            begin = _ALIGNED * number
            scope: dict[str, Any] = {
                **t.bindings,
                "shadow_layers": layers,
                "raster_depths": stack.words.window(first * map_bytes, maps * map_bytes, "atomic<u32>", write=True),
                "first_layer": gpu.constant(first),
                "part_count": gpu.constant(t.parts),
                "triangle_count": gpu.constant(t.count),
                "item_words": gpu.constant(item_words),
                "most_extra": gpu.constant(extra),
                "map_size": gpu.constant(stack.size),
                "map_stride": gpu.constant(stack.stride),
                "cull": gpu.constant(CULLS.index(cull)),
            }
            sort = gpu.compute(f"{label}.bin", MODULE, "bin").bind(
                scope,
                raster_items=items.read_write(),
                raster_counts=counts.window(begin, _ALIGNED, "atomic<u32>", write=True),
            )
            prepared = sort.prepare()
            groups = -(-t.count // prepared.workgroup[0])
            prepared.run(min(groups, LINE), -(-groups // LINE), maps)
            for entry, arguments in (("medium", begin), ("large", begin + _LARGE_ARGUMENTS)):
                listed = gpu.compute(f"{label}.{entry}", MODULE, entry).bind(
                    scope, raster_items=items.read(), raster_counts=counts.window(begin, _ALIGNED, "u32")
                )
                listed.prepare().run_indirect(counts, arguments)
