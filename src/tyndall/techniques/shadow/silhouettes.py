"""The outline that each light sees, found on the device: two passes over triangles and edges, for all lights at once.

Every triangle gets a weight: 1 if it faces the light as it is wound, −1 if it faces away, and 0 if it need not count,
because it belongs to a closed part and faces away from a light outside. An edge's weight is the sum over its triangles,
in the direction in which each runs along it; where that is not 0, the edge is on the outline, and is written as many
times (Bergeron 1986; Kim et al. 2008). Since each triangle's weight is decided once, the outline has no gaps, whatever
rounding does to a triangle that the light only grazes.

A light inside a closed part sees no face of it; there, both sides count (:meth:`Outline.is_inside`).

What casts with both sides is two sheets, one of the triangles that face the light and one of the others, and its
outline is theirs together. A technique may ask for one sheet at a time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tyndall.content.outline import Outline
from tyndall.gpu.device import LINE
from tyndall.gpu.resources import Bound, Buffer
from tyndall.techniques.contract import Unsupported, View

Sheet = Literal["both", "facing", "turned"]
_SHEETS: tuple[Sheet, ...] = ("both", "facing", "turned")  # as silhouettes.wesl numbers them
_MODULE = "package::techniques::shadow::silhouettes"
_WORDS = 8  # of a light's arguments: those of two indirect draws, of sides and of caps
_BATCH_BYTES = 64 << 20  # outlines of this size are found at once; of a single light, whatever it takes


@dataclass(frozen=True)
class Silhouette:
    """The outline of one content for one light.

    Attributes:
        sides: ``vec4u`` records: two vertices and an instance; what casts lies to the left of the way from one to the
            other, as the light sees it.
        segments: the sides' ends in the world, two ``vec4f`` a side; None where they are not wanted.
        caps: ``vec4u`` records: three vertices, counter-clockwise for the light, and an instance.
        arguments: of two indirect draws, ``draw(6 or 3 vertices a side)`` at ``offset`` and ``draw(3 a cap)`` 16 bytes
            on.
        first_side, first_cap: of this light in ``sides`` and ``caps``.
    """

    light: int
    outline: Outline
    sides: Buffer
    segments: Buffer | None
    caps: Buffer
    arguments: Buffer
    offset: int
    first_side: Bound
    first_cap: Bound


def has_turned(view: View, outlines: Sequence[Outline]) -> bool:
    """Whether something casts with both sides."""
    return any(not outline.closed or any(map(any, _insides(view, outline))) for outline in outlines)


def _insides(view: View, outline: Outline) -> list[list[bool]]:
    """For each light and part, whether the light is inside; neither moves, so it is found out once."""
    found: list[list[bool]] = view.keep(
        f"insides {id(outline)}", outline, lambda: [outline.is_inside(light) for light in view.scene.lights]
    )
    return found


def silhouettes(
    view: View, outlines: Sequence[Outline], *, caps: bool, segments: bool = False, sheet: Sheet = "both"
) -> Iterator[list[Silhouette]]:
    """For each light in turn, the silhouettes of all outlines. Passes for a light must be recorded before the next one
    is asked for, since lights share buffers.

    Args:
        caps: whether triangles are wanted too.
        segments: whether the sides' ends are.
        sheet: of which triangles.

    Raises:
        Unsupported: more edges than a buffer of this adapter can hold.
    """
    count = len(view.scene.lights)
    found = [_Extraction(view, f"outline{i}", outline, caps, segments, sheet) for i, outline in enumerate(outlines)]
    batch = min((one.batch for one in found), default=count)
    for first in range(0, count, max(1, batch)):
        lights = range(first, min(first + batch, count))
        for one in found:
            one.run(lights)
        for light in lights:
            yield [one.of(light, light - first) for one in found]


class _Extraction:
    """The buffers of one outline."""

    def __init__(self, view: View, label: str, outline: Outline, caps: bool, segments: bool, sheet: Sheet) -> None:
        self._view, self._outline, self._caps, self._sheet = view, outline, caps, sheet
        gpu, lights = view.gpu, max(1, len(view.scene.lights))
        inside = _insides(view, outline)
        self.capacity = (2 if any(map(any, inside)) else 1) * outline.most_records
        self.cap_capacity = outline.triangles if caps else 0
        sides = 48 if segments else 16
        each = sides * self.capacity + 16 * self.cap_capacity + 4 * outline.triangles
        largest = max((32 if segments else 16) * self.capacity, 16 * self.cap_capacity)
        limit = gpu.limits["max-storage-buffer-binding-size"]
        if largest > limit:
            raise Unsupported(
                f"{view.technique.name}: {outline.edges:,} edges are more than this adapter's buffers hold "
                f"({limit >> 20} MiB); use shadow_map"
            )
        self.batch = max(1, min(lights, _BATCH_BYTES // max(1, each), limit // max(16, largest)))

        def buffer(name: str, size: int, element: str = "u32", usage: str = "storage") -> Buffer:
            return view.buffer(f"{label}.{name}", lambda: max(16, size), element=element, usage=usage)

        self.facings = buffer("facings", 4 * self.batch * outline.triangles)
        self.sides = buffer("sides", 16 * self.batch * self.capacity, "vec4u")
        self.segments = buffer("segments", 32 * self.batch * self.capacity, "vec4f") if segments else None
        self.caps = buffer("caps", 16 * self.batch * self.cap_capacity, "vec4u")
        self.arguments = buffer("arguments", 4 * _WORDS * self.batch, "atomic<u32>", "storage indirect")
        self.modes = view.buffer(f"{label}.modes", lambda: _modes(inside, outline.parts), element="u32")

    def run(self, lights: range) -> None:
        view, outline = self._view, self._outline
        gpu = view.gpu
        gpu.clear_buffer(self.arguments)
        bound = {
            **view.scope,
            **outline.bindings,
            "outline_modes": self.modes,
            "facings": self.facings.read_write(),
            "silhouette_arguments": self.arguments.read_write(),
            "sides_out": self.sides.read_write(),
            "caps_out": self.caps.read_write(),
            "sheet": gpu.constant(_SHEETS.index(self._sheet)),
            "first_light": gpu.constant(lights.start),
            "part_count": gpu.constant(outline.parts),
            "triangle_count": gpu.constant(outline.triangles),
            "edge_count": gpu.constant(outline.edges),
            "side_capacity": gpu.constant(self.capacity),
            "cap_capacity": gpu.constant(self.cap_capacity),
        }
        if self.segments:
            bound["segments_out"] = self.segments.read_write()
        for entry, threads in (("facing", outline.triangles), ("edges", outline.edges)):
            made = (
                gpu.compute(f"{view.owner}.silhouettes", _MODULE, entry)
                .bind(bound)
                .features(caps=self._caps, segments=self.segments is not None)
            )
            prepared = made.prepare()
            groups = max(1, -(-threads // prepared.workgroup[0]))
            prepared.run(min(groups, LINE), -(-groups // LINE), len(lights))

    def of(self, light: int, slot: int) -> Silhouette:
        gpu = self._view.gpu
        return Silhouette(
            light,
            self._outline,
            self.sides,
            self.segments,
            self.caps,
            self.arguments,
            4 * _WORDS * slot,
            gpu.constant(slot * self.capacity),
            gpu.constant(slot * self.cap_capacity),
        )


def _modes(inside: list[list[bool]], parts: int) -> NDArray[Any]:
    """A bit a light and part: whether both sides count."""
    bits = np.array(inside, np.uint8).reshape(-1)
    padded = np.zeros(max(32, -(-len(bits) // 32) * 32), np.uint8)
    padded[: len(bits)] = bits
    return np.packbits(padded.reshape(-1, 32), axis=1, bitorder="little").view("<u4").ravel()
