"""Implicit surfaces on the device: their programs, and the cells that say which part of one matters where.

Theory. A sphere tracer asks for the distance some twenty times a ray, and a scene of n parts answers each time with all
of them, though most are far from the ray. Lipschitz pruning (Barbier, Sanchez, Paris, Michel, Lambert, Boubekeur,
Paulin, Thonat: *Lipschitz Pruning: Hierarchical Simplification of Primitive-Based SDFs*, 2025) divides an object's box
into 16³ cells, then each of them into 4³: 64³. A cell walks its parent's program at its centre and leaves
out what cannot matter anywhere inside: of two joined values the one that is beyond the other by more than both can
change. What stays is a handful of instructions, and its value in the cell is that of the whole, bit for bit up to
rounding. Cells in which no surface can be hold no program, only the value at their centre. Where a fine cell's program
is still long, it is split once more, into eighths (``prune.wesl``). Below unions alone it is enough to compare every
leaf with the least of all, which needs no walk from one instruction to the next (``unions.wesl``): so ten thousand
primitives that all move are pruned anew in each frame.

Practice. Each object (:class:`~tyndall.scene.model.Implicit`) has cells in its own space. So placing an object
elsewhere is one buffer write, and nothing is pruned again; moving a part of it prunes that object alone. Programs of
four instructions or fewer need no cells, and what has no end has none: all of its program is run. Lists that do not fit
are the parent's, and where cells of all objects do not fit some have fewer: slower, never wrong.

Parts that move in one frame are best given together (:meth:`Field.move_all`): their transforms are then inverted and
written at once. Of many leaves that are only moved the places alone are sent, a tenth of what their slots hold, and the
device puts them into the slots.

What shaders need is in :attr:`Field.bindings`: five buffers, and in the bindings module itself a switch over the kinds
of primitives that are in use.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tyndall.gpu.device import ComputePass, Gpu, GpuError
from tyndall.gpu.params import ParameterError, nearest
from tyndall.gpu.resources import Buffer, Closing, ParamsBuffer, Resource
from tyndall.scene.model import Implicit, Material, placement, translations
from tyndall.sdf import paint
from tyndall.sdf.hull import Hull
from tyndall.sdf.marching import Marching
from tyndall.sdf.program import TURNED, Kinds, Leaf, Part, Program, compile_shape
from tyndall.sdf.shading import ShadedMaterial, Shadings
from tyndall.sdf.shading import validate as validate_shader
from tyndall.sdf.shape import Box, Floats, Painted, Shape
from tyndall.sdf.snippets import validate

OWNER = "implicit"
_OBJECT = "package::sdf::objects::ImplicitObject"
_JOB = "package::sdf::pruning::Job"
_MATERIAL = "package::sdf::march::FieldMaterial"
_PRUNE, _UNIONS = "package::sdf::prune", "package::sdf::unions"
_MARGIN = 0.02  # of its longest side, around an object's box
_DIVIDED = 4  # a program of more instructions has cells
_COARSE, _FINE = 16, 64  # cells along the longest side, of both levels
_SPLIT = 24  # instructions: a longer program's fine cells are split where their lists are long
_EIGHTHS = 512, 1 << 17, 1 << 20  # for each instruction, and at least and at most
_SPARE = 0.04  # of its longest side, by which an object's box grows beyond what it must hold
_ROOMY = 1.5  # times what an object's longest side must hold, from where on it shrinks
_LEAF_SLOTS = 7  # of a leaf with a name
_MANY = 256  # leaves, from where on their places are sent alone, and put into their slots by the device
_GAP = 256  # slots between two that move, for which they are written together
_COUNTERS = 8  # of an object: entries used, overflows, words of marks used by a job, eighths used
_LEAST_ENTRIES, _MOST_ENTRIES = 1 << 12, 1 << 23
_AMPLE_ENTRIES = 1 << 21  # up to here twice as many for each instruction
_PART_SIZE = 4096  # instructions for which one part is enough
_LONG = 96  # instructions: a longer program's leaves are sorted out first
_LONGEST = 32 * 1024  # of those; beyond, cells walk all of it; as in unions.wesl
_SEGMENT = 256  # of them, as in unions.wesl
_FEW_MARKS = 512  # instructions whose marks need no memory; as in prune.wesl
_MOST_MARKS = 1 << 23  # words
_MOST_SLOTS = 1 << 24  # before samples, whose place is a float


@dataclass(frozen=True, eq=False)
class _Parts:
    """The parts of a name in an object, or of several, as arrays over them; a copy of a part is one more of the same
    number. Slots and instructions are those of the program; ``leaf_at`` are the leaves as a slice where they can be.
    """

    name: str
    count: int
    numbers: NDArray[np.intp]
    slots: NDArray[np.intp]
    entries: NDArray[np.intp]
    leaves: NDArray[np.intp]
    before: Floats
    after: Floats
    factors: Floats
    rest: Floats  # (3, N)
    flat: NDArray[np.bool_]
    leaf_at: slice | NDArray[np.intp]
    spans: tuple[tuple[int, int], ...]  # of slots, that are written when they move
    is_straight: bool
    is_in_order: bool

    @classmethod
    def of(cls, name: str, parts: Sequence[Part]) -> _Parts:
        def integers(values: Iterable[int]) -> NDArray[np.intp]:
            return np.array(list(values), np.intp)

        before, after = np.array([p.before for p in parts]), np.array([p.after for p in parts])
        linear = np.concatenate([before[:, :3, :3], after[:, :3, :3]])
        numbers, slots, leaves = (integers(getattr(p, what) for p in parts) for what in ("number", "slot", "leaf"))
        return cls(
            name,
            int(numbers.max()) + 1,
            numbers,
            slots,
            integers(p.entry for p in parts),
            leaves,
            before,
            after,
            np.array([p.factor for p in parts]),
            np.ascontiguousarray((before[:, :3, 3] + after[:, :3, 3]).T),
            np.array([p.flat for p in parts]),
            _evenly(leaves),
            ((int(slots.min()), int(slots.max()) + _LEAF_SLOTS),),
            bool((linear == np.eye(3)).all()) and all(p.leaf >= 0 for p in parts),
            bool((numbers == np.arange(len(parts))).all()),
        )

    @classmethod
    def joined(cls, sets: Sequence[_Parts]) -> _Parts:
        """Those of several names, one after another, to be turned at once."""
        if len(sets) == 1:
            return sets[0]
        arrays = ("numbers", "slots", "entries", "leaves", "before", "after", "factors", "flat")
        together: dict[str, Any] = {what: np.concatenate([getattr(p, what) for p in sets]) for what in arrays}
        spans: list[tuple[int, int]] = []
        for low, high in sorted(span for parts in sets for span in parts.spans):
            if spans and low - spans[-1][1] <= _GAP:  # a write costs as much as that many slots
                spans[-1] = spans[-1][0], max(high, spans[-1][1])
            else:
                spans.append((low, high))
        return cls(
            name=", ".join(parts.name for parts in sets),
            count=sum(parts.count for parts in sets),
            rest=np.concatenate([parts.rest for parts in sets], axis=1),
            leaf_at=together["leaves"],
            spans=tuple(spans),
            is_straight=all(parts.is_straight for parts in sets),
            is_in_order=False,
            **together,
        )

    @cached_property
    def first_rows(self) -> NDArray[np.float32]:
        """(N, 4): first slots of leaves, with their factors at rest and whichever places were put into them."""
        made = np.zeros((len(self.slots), 4), np.float32)
        made[:, 3] = self.factors
        return made

    @cached_property
    def owned(self) -> NDArray[np.bool_]:
        """Which of them are one leaf, whose transform is among its own slots."""
        return self.leaves >= 0

    @cached_property
    def own(self) -> NDArray[np.intp]:
        """First slots of leaves."""
        return self.slots[self.owned]

    @cached_property
    def scopes(self) -> NDArray[np.intp]:
        """First slots of transforms around more than a leaf."""
        return self.slots[~self.owned]


def _leaves_plane(moves: Floats) -> bool:
    """Whether one of (N, 3 or 4, 3 or 4) turns what lies in the plane of x and y out of it."""
    return bool(moves[:, 2, :2].any() or moves[:, :2, 2].any())


def _evenly(numbers: NDArray[np.intp]) -> slice | NDArray[np.intp]:
    """As a slice where they are evenly spaced: numpy copies along those many times faster."""
    steps = np.diff(numbers)
    step = int(steps[0]) if len(steps) else 1
    if step < 1 or numbers[0] < 0 or (steps != step).any():
        return numbers
    return slice(int(numbers[0]), int(numbers[-1]) + 1, step)


def _entries(instructions: int) -> int:
    """How many entries lists of a program's cells may have in all: about twice what scenes were seen to need."""
    ample = min(8192 * instructions, _AMPLE_ENTRIES)
    return int(np.clip(max(ample, 4096 * instructions), _LEAST_ENTRIES, _MOST_ENTRIES))


def _matrices(given: Floats) -> Floats:
    """(N, 4, 4) of transforms, or of (N, 3) ways."""
    return given if given.ndim == 3 else translations(given)


def _least_stretches(linear: Floats) -> Floats:
    """(N,) least singular values of (N, 3, 3); 1 of turns, without a decomposition."""
    turns = np.abs(np.einsum("nji,njk->nik", linear, linear) - np.eye(3)).max(axis=(1, 2)) < 1e-9
    stretches = np.ones(len(linear))
    if not turns.all():
        stretches[~turns] = np.linalg.svd(linear[~turns], compute_uv=False)[:, -1]
    return stretches


@dataclass(eq=False)
class _Object:
    """An object on the device."""

    implicit: Implicit
    program: Program
    first_word: int
    first_slot: int
    first_material: int
    levels: int
    first_cell: int
    first_entry: int
    capacity: int
    box: Box
    first_eighth: int = 0
    eighths: int = 0
    dirty: bool = True
    moves: dict[str, Floats] = dataclasses.field(default_factory=dict)
    edits: dict[str, dict[str, Any]] = dataclasses.field(default_factory=dict)
    parts: dict[str, _Parts] = dataclasses.field(default_factory=dict)
    joined: dict[tuple[str, ...], _Parts] = dataclasses.field(default_factory=dict)
    turned: set[str] = dataclasses.field(default_factory=set)  # names of parts that are
    moved: bool = False  # since the box was fitted
    hull: Hull | None = None
    sizes: Floats | None = None  # (leaves,) ≤ 1, powers of two: how much smaller than at rest leaves may be
    has_hull: bool = False  # was looked for
    jobs: list[Any] | None = None
    halves: Floats | None = None  # (3, leaves) of the leaves' boxes in their own spaces, and their middles
    middles: Floats = dataclasses.field(default_factory=lambda: np.zeros((3, 0)))

    def __post_init__(self) -> None:
        self.at_rest = self.implicit.shape
        # An edit changes leaves, and a field of the same shapes may come to have the same program.
        self.program = dataclasses.replace(self.program, leaves=list(self.program.leaves))
        self.placement = np.array(self.implicit.transform, np.float64)
        placements = np.array([leaf.placement for leaf in self.program.leaves])
        self.linear = placements[:, :3, :3].copy()  # of the leaves, and (3, leaves) where they are
        self.places = np.ascontiguousarray(placements[:, :3, 3].T)
        self.is_straight = bool((self.linear == np.eye(3)).all())
        self.leaf_slots = np.array([leaf.slot for leaf in self.program.leaves])

    def together(self, sets: Sequence[_Parts]) -> _Parts:
        """:meth:`_Parts.joined`, once for all frames."""
        names = tuple(parts.name for parts in sets)
        if names not in self.joined:
            self.joined[names] = _Parts.joined(sets)
        return self.joined[names]

    def parts_of(self, name: str) -> _Parts:
        """Its parts of a name that it has."""
        if name not in self.parts:
            if held := next((part.held for part in self.program.names[name] if part.held), ""):
                raise ParameterError(f"{name}: it is inside of a {held}, which is made for where it is at rest")
            self.parts[name] = _Parts.of(name, self.program.names[name])
        return self.parts[name]

    def leaves(self) -> list[tuple[Leaf, float]]:
        """The leaves, each with what its values are multiplied by."""
        sizes = np.ones(len(self.program.leaves)) if self.sizes is None else self.sizes
        factors = (float(self.program.slots[leaf.slot, 3]) for leaf in self.program.leaves)
        return [(leaf, factor * size) for leaf, factor, size in zip(self.program.leaves, factors, sizes, strict=True)]

    @property
    def shape(self) -> Shape:
        shape: Any = self.implicit.shape
        made: Shape = shape
        return made

    @property
    def cells(self) -> int:
        return sum((_COARSE**3, _FINE**3)[: self.levels])

    @property
    def is_long(self) -> bool:
        """Whether its leaves are sorted out before the coarse cells walk its program."""
        return self.levels > 1 and _LONG < self.program.size <= _LONGEST

    @property
    def is_union(self) -> bool:
        """Whether its leaves are best compared with the whole alone; the passes for that hold 32 values at most."""
        return self.is_long and self.program.sag >= 0 and self.program.is_short_reaching and self.program.values <= 32


class Field(Closing):
    """The implicit surfaces of a scene on the device.

    Args:
        implicits: the objects.
        marching: when a ray ends.
        pruning: False runs whole programs everywhere: slower, the same picture.
        like: another field. Where this one has the same set of kinds, and stacks that are no deeper, its shaders are
            the same text, whatever the order: nothing is compiled.

    Attributes:
        bindings: what shaders that ask the field must have in their scope.
        uploaded: bytes written since :meth:`update` was called last.

    Raises:
        ParameterError: a shape that has no program.
        GpuError: more than the device holds.
        SnippetError: a user's code that does not compile.
    """

    def __init__(
        self,
        gpu: Gpu,
        implicits: Sequence[Implicit],
        *,
        marching: Marching | None = None,
        pruning: bool = True,
        owner: str = OWNER,
        like: Field | None = None,
    ) -> None:
        self._gpu, self._owner, self._pruning = gpu, owner, pruning
        self._marching = marching or Marching()
        self._kinds, self._shadings, self._stacks = Kinds(), Shadings(), (1, 1)
        self._compiled: dict[int, tuple[Any, Program]] = {}  # by the shapes' ids
        self._buffers: list[Buffer] = []
        self._params: ParamsBuffer | None = None
        self._before_buffer: Buffer | None = None  # slots as they were when `remember` was called last
        self._is_remembered = self._is_known = False  # as they are now; as they were in some frame
        self._objects: list[_Object] = []
        self._lists: dict[tuple[_Object, str], tuple[Buffer, Buffer]] = {}  # places and slots of many leaves of a name
        self._listed: set[tuple[_Object, str]] = set()  # whose last motion was sent as such a list
        self._waiting: set[tuple[_Object, str]] = set()  # and is not in the slots yet
        self._jobs_written: list[list[Any]] = []  # what the jobs' buffer holds: in motion mostly what it is to hold
        self.uploaded = 0
        try:
            self._upload(implicits, self._compile(implicits, like))
        except BaseException:
            self.close()
            raise

    def _compile(self, implicits: Sequence[Implicit], like: Field | None) -> list[Program]:
        """The objects' programs, with kinds and shaders numbered as another field has them if the set is the same."""
        shapes: list[Any] = [one.shape for one in implicits]
        kinds, programs = Kinds(like._kinds if like else None), []
        for shape in shapes:
            known = like._compiled.get(id(shape)) if like else None
            if known is None:
                programs.append(compile_shape(shape, kinds))
            else:
                programs.append(known[1])
                kinds.ask(known[1])
        if not kinds.is_tight:
            kinds, programs = kinds.tightened(programs)
        self._compiled = {id(shape): (shape, made) for shape, made in zip(shapes, programs, strict=True)}
        materials = [m for one, made in zip(implicits, programs, strict=True) for m in (one.material, *made.materials)]
        shaders = {m.shader for m in materials if isinstance(m, ShadedMaterial)}
        others = like._shadings if like else None
        self._kinds, self._shadings = kinds, Shadings(others if others and shaders >= set(others.shaders) else None)
        for material in materials:
            self._shadings.of(material)
        self._stacks = max([1, *(p.values for p in programs)]), max([1, *(p.places for p in programs)])
        if (
            like
            and self._knows_same(like)
            and self._stacks[0] <= like._stacks[0]
            and self._stacks[1] <= like._stacks[1]
        ):
            self._stacks = like._stacks
        return programs

    def _knows_same(self, like: Field) -> bool:
        return self._kinds.wesl() == like._kinds.wesl() and self._shadings.wesl() == like._shadings.wesl()

    def _buffer(self, label: str, data: NDArray[Any] | int, element: str) -> Buffer:
        size = data if isinstance(data, int) else data.nbytes
        if size > self._gpu.part_bytes:
            raise GpuError(
                f"{self._owner}.{label}: {size:,} bytes; shaders of this adapter see {self._gpu.part_bytes:,}"
            )
        buffer = self._gpu.buffer(f"{self._owner}.{label}", data, owner=self._owner, element=element)
        self._buffers.append(buffer)
        return buffer

    def _write(self, buffer: Buffer, data: NDArray[Any], offset: int = 0) -> None:
        self._gpu.write(buffer, data, offset)
        self.uploaded += data.nbytes

    def _upload(self, implicits: Sequence[Implicit], programs: Sequence[Program]) -> None:
        gpu = self._gpu
        words = slots = materials = cells = entries = 0
        for left, implicit, program in zip(range(len(implicits))[::-1], implicits, programs, strict=True):
            shape: Any = implicit.shape
            levels = self._levels(program, shape.box, gpu.part_bytes // 16 - cells - left * _COARSE**3)
            capacity = _entries(program.size) if levels else 0
            made = _Object(implicit, program, words, slots, materials, levels, cells, 0, capacity, shape.box)
            self._objects.append(made)
            words, slots = words + program.size, slots + len(program.slots)
            materials += 1 + len(program.materials)
            cells, entries = cells + made.cells, entries + made.capacity
        for made in self._objects:
            if made.levels > 1 and made.program.size > _SPLIT:
                each, least, most = _EIGHTHS
                wanted = min(max(each * made.program.size, least), most, gpu.part_bytes // 16 - cells)
                made.first_eighth, made.eighths = cells, wanted // 8 * 8
                cells += made.eighths
        room = max(0, gpu.part_bytes // 8 - words)
        if entries > room:
            for made in self._objects:
                made.capacity = made.capacity * room // entries
        entries = 0
        for made in self._objects:
            made.first_entry, entries = words + entries, entries + made.capacity
        listed = [m for o in self._objects for m in (o.implicit.material, *o.program.materials)]
        shaded = [self._shadings.of(m) for m in listed]
        for source in self._kinds.sources():
            validate(gpu, source)
        self._shadings.validate(gpu)
        self._words = np.concatenate([np.zeros((0, 2), np.uint32), *(self._placed_words(o) for o in self._objects)])
        numbers = self._shadings.numbers  # in rows after all slots
        rows = np.zeros((-(-len(numbers) // 4), 4), np.float32)
        rows.reshape(-1)[: len(numbers)] = numbers
        first_number = 4 * (1 + slots)
        placed = [self._placed_slots(o) for o in self._objects]
        self._slots = np.concatenate([np.zeros((1, 4), np.float32), *placed, rows])
        self._rows = np.zeros(max(1, len(self._objects)), gpu.dtype(_OBJECT))
        self._object_buffer = self._buffer("objects", self._rows, _OBJECT)
        self._slot_buffer = self._buffer("slots", self._slots, "vec4f")
        self._list_buffer = self._buffer("lists", 8 * max(1, words + entries), "vec2u")
        self._cell_buffer = self._buffer("cells", 16 * max(1, cells), "vec4u")
        self._counter_buffer = self._buffer("counters", 4 * _COUNTERS * max(1, len(self._objects)), "atomic<u32>")
        longest = max((o.program.size for o in self._objects if o.levels), default=1)
        marks = int(np.clip(_FINE**3 * -(-(longest - _FEW_MARKS) // 16), 64, min(_MOST_MARKS, gpu.part_bytes // 4)))
        self._marks_capacity = marks
        self._mark_buffer = self._buffer("marks", 4 * marks, "u32")
        words = max((-(-o.program.size // 32) for o in self._objects if o.is_long), default=0)
        self._alive_buffer = self._buffer("alive", 4 * max(1, _COARSE**3 * words), "u32")
        self._least_buffer = self._buffer("least", 4 * (_COARSE**3 if words else 1), "atomic<u32>")
        spans = np.zeros((max(1, self._words.shape[0]), 2), np.uint32)
        for made in self._objects:
            if made.is_long:
                spans[made.first_word : made.first_word + made.program.size] = made.program.spans
        self._span_buffer = self._buffer("spans", spans, "vec2u")
        most_jobs = sum(o.levels + o.program.size // _PART_SIZE for o in self._objects)
        self._job_buffer = self._buffer("jobs", self._gpu.dtype(_JOB).itemsize * max(1, most_jobs), _JOB)
        self._material_buffer = self._buffer("materials", self._materials(listed, shaded, first_number), _MATERIAL)
        self._params = gpu.params(f"{self._owner}.marching", self._marching, owner=self._owner)
        self._write(self._list_buffer, self._words)
        for index in range(len(self._objects)):
            self._describe(index)
        self.bindings = self._bind()

    def _levels(self, program: Program, box: Box, room: int) -> int:
        """How often an object's box is divided; by less than it should where there is no room for as many cells."""
        bounded = bool(np.isfinite(box[0]).all() and np.isfinite(box[1]).all())
        empty = bool((box[0] == box[1]).all())  # nothing is inside
        if not bounded or empty or not self._pruning or program.size <= _DIVIDED:
            return 0
        levels = 1 if program.size <= 8 else 2
        while levels and sum((_COARSE**3, _FINE**3)[:levels]) > room:
            levels -= 1
        return levels

    def _placed_words(self, made: _Object) -> NDArray[np.uint32]:
        words = made.program.words.copy()
        words[:, 1] += made.first_slot + 1
        return words

    def _placed_slots(self, made: _Object) -> NDArray[np.float32]:
        slots: NDArray[np.float32] = made.program.slots.copy()
        for row in made.program.payload_rows:
            if (at := int(slots[row, 0]) + made.first_slot + 1) > _MOST_SLOTS:
                raise GpuError(f"samples of grids: more than {4 * _MOST_SLOTS:,} numbers before them")
            slots[row, 0] = at
        rows = made.program.material_rows
        named = slots[rows, 2] >= 0
        slots[rows[named], 2] += made.first_material + 1
        return slots

    def _materials(
        self, listed: Sequence[Material], shaded: Sequence[tuple[int, int]], first_number: int
    ) -> NDArray[Any]:
        rows = np.zeros(max(1, len(listed)), self._gpu.dtype(_MATERIAL))
        for row, m, (shader, at) in zip(rows, listed, shaded, strict=False):
            row["base_color"], row["emissive"] = m.base_color[:3], m.emissive
            row["metallic"], row["roughness"] = m.metallic, m.roughness
            row["shader"], row["numbers"], row["lit"] = shader + 1, first_number + at, getattr(m, "lit", True)
            row["clear"] = m.reflections, m.transmission, m.ior, m.attenuation_distance
        return rows

    def _bind(self) -> dict[str, Any]:
        programs = [o.program for o in self._objects]
        constants = {
            "IMPLICIT_OBJECTS": len(programs),
            "IMPLICIT_VALUES": self._stacks[0],
            "IMPLICIT_PLACES": self._stacks[1],
        }
        shaded = str(not self._shadings.is_trusted).lower()
        text = "\n".join(
            [
                *(f"const {name} = {n}u;" for name, n in constants.items()),
                f"const IMPLICIT_SHADED = {shaded};",
                "fn implicit_number(i: u32) -> f32 { return implicit_slots[i >> 2u][i & 3u]; }",
                self._kinds.wesl(),
                self._shadings.wesl(),
            ]
        )
        assert self._params is not None
        return {
            "implicit_objects": self._object_buffer.read().telling(text, untrusted=not self.is_trusted),
            "implicit_slots": self._slot_buffer.read(),
            "implicit_lists": self._list_buffer.read(),
            "implicit_cells": self._cell_buffer.read(),
            "implicit_materials": self._material_buffer.read(),
            "implicit_marching": self._params.bound,
        }

    # --- what an object is on the device ---

    def _describe(self, index: int) -> None:
        """Write an object's row anew."""
        made, row = self._objects[index], self._rows[index]
        made.jobs = None
        program = made.program
        low, high = made.box
        longest = float(np.max(high - low)) if np.isfinite(high - low).all() else 0.0
        margin = _MARGIN * longest
        row["lower"] = np.maximum(low - margin, -1e30)
        row["upper"] = np.minimum(high + margin, 1e30)
        row["lipschitz"] = program.lipschitz
        row["begin"], row["count"] = made.first_word, program.size
        row["material"] = made.first_material
        row["cell"] = 0.0
        if made.levels:
            finest = (_COARSE, _FINE)[made.levels - 1]
            sides = np.maximum(high - low, 1e-6 * longest) + 2 * margin
            width = float(sides.max()) / finest
            blocks = np.ceil(sides / (width * finest / 4) - 1e-6).astype(int)  # of a quarter of the longest side
            row["cell"] = width
            row["counts"] = np.clip(blocks, 1, 4) * (finest // 4)
            row["first_cell"] = made.first_cell + (_COARSE**3 if made.levels > 1 else 0)
        self._write_row(index)

    def _write_row(self, index: int) -> None:
        """Write it with where the object stands."""
        placed, row = self._objects[index].placement, self._rows[index]
        row["to_local"] = np.linalg.inv(placed)[:3]
        row["factor"] = np.linalg.svd(placed[:3, :3], compute_uv=False)[-1]
        self._write(self._object_buffer, self._rows[index : index + 1], index * self._rows.itemsize)

    # --- motion ---

    def moved_parts(self) -> NDArray[np.bool_]:
        """(objects,): whether parts have moved since :meth:`update` was called last."""
        return np.array([made.moved for made in self._objects], bool)

    @property
    def remembers(self) -> bool:
        """Whether it is known where parts were: :meth:`remember` has been called."""
        return self._is_known

    def remember(self) -> None:
        """Record where all parts are, after what asks where they were."""
        if self._before_buffer is None:
            self._before_buffer = self._buffer("slots_before", self._slot_buffer.size_bytes, "vec4f")
        elif self._is_remembered:
            return
        self._gpu.copy_buffer(self._slot_buffer, self._before_buffer)
        self._is_remembered = self._is_known = True

    @property
    def before(self) -> dict[str, Any]:
        """What ``flow.wesl`` binds beyond :attr:`bindings`."""
        assert self._before_buffer is not None
        return {"implicit_slots_before": self._before_buffer.read()}

    def place(self, index: int, transform: Any) -> None:
        """An object stands elsewhere: one write, and nothing is pruned again."""
        self._objects[index].placement = placement(transform)
        self._write_row(index)

    def move(self, name: str, matrices: ArrayLike) -> None:
        """The parts of a name are moved from where they stand at rest, in the space that holds them.

        Only their numbers are written, and only the objects that they are in are pruned again, by :meth:`update`.

        Args:
            matrices: (N, 4, 4) transforms or (N, 3) ways in metres, for the N parts of that name in order.

        Raises:
            ParameterError: no such name, parts inside of a twist, bend or repetition without end, another number of
                transforms, or one that has no inverse or turns a flat part out of its plane.
        """
        self.move_all({name: matrices})

    def move_all(self, moves: Mapping[str, ArrayLike]) -> None:
        """As :meth:`move`, of the parts of several names; for less than one name after another costs."""
        wanted: dict[_Object, list[tuple[_Parts, Floats]]] = {}
        for name, matrices in moves.items():
            given: Floats = np.asarray(matrices)
            if given.dtype != np.float32 or given.ndim != 2:  # ways are added as they are
                given = np.asarray(given, np.float64)
            sets = self._parts(name)
            count = sum(parts.count for _, parts in sets)
            if given.shape not in ((count, 3), (count, 4, 4)):
                raise ParameterError(f"{name}: shape {given.shape} is neither ({count}, 4, 4) nor ({count}, 3)")
            if not np.isfinite(given).all():
                raise ParameterError(f"{name}: a transform is not finite")
            first = 0
            for made, parts in sets:
                wanted.setdefault(made, []).append((parts, given[first : first + parts.count]))
                first += parts.count
        for made, listed in wanted.items():
            self._move(made, listed)

    def _parts(self, name: str) -> list[tuple[_Object, _Parts]]:
        found = []
        for made in self._objects:
            if name in made.program.names:
                found.append((made, made.parts_of(name)))
        if not found:
            known = sorted({name for made in self._objects for name in made.program.names})
            raise ParameterError(f"no part '{name}'{nearest(name, known)}")
        return found

    def _move(self, made: _Object, listed: Sequence[tuple[_Parts, Floats]]) -> None:
        turned = []
        for parts, given in listed:
            moves = given if parts.is_in_order else given[parts.numbers]
            if moves.ndim == 2 and parts.is_straight:
                self._shift(made, parts, moves)
            else:
                turned.append((parts, _matrices(moves)))
        if turned:
            self._turn(made, made.together([parts for parts, _ in turned]), turned)
        for parts, given in listed:
            made.moves[parts.name] = given
        made.dirty = made.moved = True
        self._is_remembered = False

    def _shift(self, made: _Object, parts: _Parts, ways: Floats) -> None:
        """Write the places of leaves that are only moved."""
        made.places[:, parts.leaf_at] = places = parts.rest + ways.T
        rows = parts.first_rows
        for axis in range(3):  # one by one: numpy takes longer over many short rows
            rows[:, axis] = places[axis]
        whole = np.complex128  # a slot as one number
        self._slots.view(whole)[parts.slots + (made.first_slot + 1), 0] = rows.view(whole)[:, 0]
        if parts.name in made.turned:
            made.linear[parts.leaves] = np.eye(3)
            made.turned.discard(parts.name)
            self._flag(made.first_word + parts.entries, np.zeros(len(parts.entries), bool))
        if len(rows) < _MANY:
            self._send(made, parts)
            return
        if (made, parts.name) not in self._lists:
            numbers = (parts.slots + (made.first_slot + 1)).astype(np.uint32)
            self._lists[made, parts.name] = (
                self._buffer("leaf_places", rows, "vec4f"),
                self._buffer("leaf_slots", numbers, "u32"),
            )
        self._write(self._lists[made, parts.name][0], rows)
        self._listed.add((made, parts.name))
        self._waiting.add((made, parts.name))

    def _turn(self, made: _Object, parts: _Parts, listed: Sequence[tuple[_Parts, Floats]]) -> None:
        """Write the transforms of parts that are turned, or not leaves: of the names in ``listed``, all together."""
        moves = listed[0][1] if len(listed) == 1 else np.concatenate([moves for _, moves in listed])
        placed = parts.before @ moves @ parts.after
        linear, flat = moves[:, :3, :3], parts.flat
        if flat.any():
            if _leaves_plane(linear[flat]):
                name = next(one.name for one, moves in listed if _leaves_plane(moves[one.flat]))
                raise ParameterError(
                    f"{name}: it is turned out of the plane that it lies in; name what is extruded or revolved"
                )
            # Whatever is done across its plane changes nothing in it, and must not be its least stretch.
            linear = linear.copy()
            linear[flat, 2, 2] = np.abs(linear[flat, :2, :2]).sum(axis=(1, 2))
        stretch = _least_stretches(linear)
        if (stretch < 1e-9).any() or (moves[:, 2, 2][flat] == 0).any():
            name = next(one.name for one, moves in listed if (_least_stretches(moves[:, :3, :3]) < 1e-9).any())
            raise ParameterError(f"{name}: a transform that has no inverse")
        rows = np.linalg.inv(placed)[:, :3]
        factors = parts.factors * stretch
        for one, _ in listed:  # what is written whole must not be put back where it was
            self._listed.discard((made, one.name))
            self._waiting.discard((made, one.name))
        slots, leaves = self._slots[made.first_slot + 1 :], parts.owned
        if len(own := parts.own):
            slots[own, :3] = placed[leaves, :3, 3]
            slots[own, 3] = factors[leaves]
            slots[own[:, None] + (4, 5, 6)] = rows[leaves]
            made.linear[parts.leaves[leaves]] = placed[leaves, :3, :3]
            made.places[:, parts.leaves[leaves]] = placed[leaves, :3, 3].T
            turned = (np.abs(placed[leaves, :3, :3] - np.eye(3)) > 1e-12).any(axis=(1, 2))
            names = {one.name for one, _ in listed}
            if turned.any() or names & made.turned:
                made.turned |= names
                self._flag(made.first_word + parts.entries[leaves], turned)
        if len(scopes := parts.scopes):
            slots[scopes[:, None] + (0, 1, 2)] = rows[~leaves]
            slots[scopes + 3, 0] = factors[~leaves]
        self._send(made, parts)

    def _send(self, made: _Object, parts: _Parts) -> None:
        first = made.first_slot + 1
        for low, high in parts.spans:  # whatever lies between has its newest numbers in them, too
            self._write(self._slot_buffer, self._slots[first + low : first + high], 16 * (first + low))

    def _flag(self, entries: NDArray[np.intp], turned: NDArray[np.bool_]) -> None:
        """Say of leaves whether their places are turned, or only moved."""
        words = self._words[entries, 0]
        flagged = np.where(turned, words | TURNED, words & ~np.uint32(TURNED))
        if (flagged != words).any():
            self._words[entries, 0] = flagged
            low, high = int(entries.min()), int(entries.max()) + 1
            self._write(self._list_buffer, self._words[low:high], 8 * low)

    def _fit(self, made: _Object) -> None:
        """Let the object's box hold it where its parts are now; its cells stay as they are while they do."""
        made.moved = False
        if made.program.sag >= 0 and (made.turned or made.sizes is not None):
            self._shrink(made)
        box = self._hull(made) if made.program.sag >= 0 else None
        if box is None:
            if not made.has_hull:
                made.hull, made.has_hull = Hull.of(made.shape), True
            moves = {name: _matrices(given) for name, given in made.moves.items()}
            box = made.hull.box(moves) if made.hull else None
            if box is None:
                box = made.shape.moved({name: iter(given) for name, given in moves.items()}).box
        low, high = box
        if (low >= made.box[0]).all() and (high <= made.box[1]).all():
            if np.max(made.box[1] - made.box[0]) <= _ROOMY * np.max(high - low):
                return
            made.box = low, high  # a part is back from afar, and cells are best small
        spare = _SPARE * np.max(np.maximum(high, made.box[1]) - np.minimum(low, made.box[0]))
        lower = np.where(low < made.box[0], low - spare, made.box[0])
        upper = np.where(high > made.box[1], high + spare, made.box[1])
        made.box = lower, upper
        self._describe(self._objects.index(made))

    def _shrink(self, made: _Object) -> None:
        """Take note of leaves that motion makes smaller: what a smooth union adds to them is not, and so is more of
        their own boxes."""
        stretch = self._slots[made.first_slot + 1 + made.leaf_slots, 3] / made.program.slots[made.leaf_slots, 3]
        sizes = np.exp2(np.floor(np.log2(np.minimum(stretch, 1.0)) + 1e-3))
        if made.sizes is None or not np.array_equal(sizes, made.sizes):
            made.sizes, made.halves = sizes, None

    def _hull(self, made: _Object) -> Box:
        """The box of all leaves, where nothing but unions is above them."""
        if made.halves is None:
            boxes = np.array([leaf.shape.extent(leaf.sag / factor) for leaf, factor in made.leaves()])
            made.halves = 0.5 * (boxes[:, 1] - boxes[:, 0]).T
            made.middles = 0.5 * (boxes[:, 1] + boxes[:, 0]).T
        if made.is_straight and not made.turned:
            middles, halves = made.middles + made.places, made.halves
        else:
            middles = np.einsum("nij,jn->in", made.linear, made.middles) + made.places
            halves = np.einsum("nij,jn->in", np.abs(made.linear), made.halves)
        return (middles - halves).min(axis=1), (middles + halves).max(axis=1)

    def edit(self, name: str, **changes: Any) -> None:
        """Change parameters of the primitives of a name: ``edit("ball", radius=0.3)``. A few numbers are written.

        Raises:
            ParameterError: no such name, a part that is no primitive, or a value that it does not allow.
        """
        sets = self._parts(name)
        changed = [self._changed(made, parts, changes) for made, parts in sets]  # all are right, or none is edited
        for (made, parts), shapes in zip(sets, changed, strict=True):
            self._edit(made, parts, changes, shapes)

    def _edit(self, made: _Object, parts: _Parts, changes: Mapping[str, Any], shapes: Sequence[Any]) -> None:
        """Write the numbers of the primitives of a name."""
        for index, slot, shape in zip(parts.leaves.tolist(), parts.slots.tolist(), shapes, strict=True):
            leaf = made.program.leaves[index]
            made.program.leaves[index] = dataclasses.replace(leaf, shape=shape)
            numbers = np.zeros(8, np.float32)
            numbers[: len(shape.numbers)] = shape.numbers
            at = made.first_slot + 1 + slot
            self._slots[at + 1 : at + 3] = numbers.reshape(2, 4)
            self._slots[at + 3, 1] *= shape.lipschitz / leaf.shape.lipschitz
            self._write(self._slot_buffer, self._slots[at + 1 : at + 4], 16 * (at + 1))
        made.halves = None
        made.edits.setdefault(parts.name, {}).update(changes)
        if made.program.sag < 0:  # its box is that of the whole expression
            edited = made.shape.edited(parts.name, changes)
            made.implicit, made.has_hull = dataclasses.replace(made.implicit, shape=edited), False
        made.dirty = made.moved = True

    def carry(self, old: Field, kept: Mapping[int, int]) -> None:
        """What was placed, moved and edited in another field is so in this one as well.

        Args:
            kept: by numbers of objects here, those of the same objects there. Where the shape is another one, its parts
                stay at rest.
        """
        for index, before in kept.items():
            made, other = self._objects[index], old._objects[before]
            self.place(index, other.placement)
            if made.at_rest is not other.at_rest:
                continue
            for name, changes in other.edits.items():
                parts = made.parts_of(name)
                self._edit(made, parts, changes, self._changed(made, parts, changes))
            if other.moves:
                self._move(made, [(made.parts_of(name), given) for name, given in other.moves.items()])

    def _changed(self, made: _Object, parts: _Parts, changes: Mapping[str, Any]) -> list[Any]:
        """The primitives of a name with other parameters.

        Raises:
            ParameterError: they are not to be had.
        """
        name = parts.name
        if (parts.leaves < 0).any():
            raise ParameterError(f"{name}: is more than one primitive, and has no parameters")
        shapes = []
        for index in parts.leaves.tolist():
            leaf = made.program.leaves[index]
            known = [f.name for f in dataclasses.fields(leaf.shape)]
            for key in changes:
                if key not in known:
                    raise ParameterError(f"{name}: a {type(leaf.shape).__name__} has no {key}{nearest(key, known)}")
            try:
                shape: Any = dataclasses.replace(leaf.shape, **changes)
            except ParameterError as error:
                raise ParameterError(f"{name}: {error}") from None
            if getattr(shape, "payload", None) is not None or shape.lipschitz > leaf.shape.lipschitz * (1 + 1e-9):
                raise ParameterError(f"{name}: a {type(shape).__name__} with samples or a greater bound is a new shape")
            shapes.append(shape)
        return shapes

    def _jobs(self, index: int) -> list[Any]:
        """The divisions of an object, the coarse one first, each in as many parts as the marks take."""
        made, row = self._objects[index], self._rows[index]
        jobs = []
        for level in range(made.levels):
            scale = 4 ** (made.levels - 1 - level)
            counts = row["counts"] // scale
            blocks = int(np.prod(counts // 4))
            in_parts = level and not made.is_union
            parts = min(blocks, -(-made.program.size // _PART_SIZE)) if in_parts else 1
            for part in range(parts):
                job = np.zeros((), self._gpu.dtype(_JOB))
                job["lower"], job["width"] = row["lower"], row["cell"] * scale
                job["counts"], job["blocks"] = counts, counts // 4
                job["first_cell"] = made.first_cell + (_COARSE**3 if level else 0)
                job["first_parent"] = made.first_cell
                job["begin"], job["count"] = made.first_word, made.program.size
                job["is_root"] = level == 0
                first, end = blocks * part // parts, blocks * (part + 1) // parts
                job["first_block"], job["block_count"] = first, end - first
                job["first_entry"], job["capacity"] = made.first_entry, made.capacity
                job["counters"] = _COUNTERS * index
                job["marks_capacity"] = self._marks_capacity
                job["alive_words"] = -(-made.program.size // 32) if made.is_long and level == 0 else 0
                job["sag"], job["lipschitz"] = made.program.sag, made.program.lipschitz
                job["first_eighth"] = made.first_eighth
                job["eighths"] = made.eighths if level and part == parts - 1 else 0
                jobs.append(job)
        return jobs

    def forget(self) -> None:
        """What was recorded is never submitted: the next :meth:`update` records it again."""
        self._is_remembered = self._is_known = False
        for made in self._objects:
            made.dirty = True
        self._waiting = set(self._listed)

    def _put_in_place(self) -> None:
        """Record that places which were sent as a list of their own come to their slots."""
        for which in self._waiting:
            places, slots = self._lists[which]
            self._gpu.compute(f"{self._owner}.place", "package::sdf::places", "place").bind(
                leaf_places=places, leaf_slots=slots, implicit_slots=self._slot_buffer.read_write()
            ).dispatch_line(slots.size_bytes // 4)
        self._waiting.clear()

    def update(self) -> None:
        """Record the pruning of what has changed, before what asks the field."""
        self._put_in_place()
        for made in self._objects:
            if made.moved:
                self._fit(made)
        dirty = [i for i, made in enumerate(self._objects) if made.dirty and made.levels]
        for made in self._objects:
            made.dirty = False
        if not dirty:
            return
        gpu = self._gpu
        jobs = {}
        for i in dirty:
            made = self._objects[i]
            made.jobs = made.jobs or self._jobs(i)
            jobs[i] = made.jobs
        listed = [job for made in jobs.values() for job in made]
        made_of = [self._objects[i] for i, made in jobs.items() for _ in made]
        written = self._jobs_written
        if [id(made) for made in jobs.values()] != [id(made) for made in written]:
            table = np.zeros(len(listed), gpu.dtype(_JOB))
            for number, job in enumerate(listed):
                table[number] = job
            gpu.write(self._job_buffer, table)
            self._jobs_written = list(jobs.values())
        for i in dirty:
            gpu.clear_buffer(self._counter_buffer, 4 * _COUNTERS * i, 4 * _COUNTERS)
        scope = {
            "implicit_objects": self.bindings["implicit_objects"],
            "implicit_slots": self.bindings["implicit_slots"],
            "implicit_lists": self._list_buffer.read_write(),
            "implicit_cells": self._cell_buffer.read_write(),
            "implicit_counters": self._counter_buffer.read_write(),
            "implicit_marks": self._mark_buffer.read_write(),
            "implicit_jobs": self._job_buffer.read(),
            "implicit_least": self._least_buffer.read_write(),
            "implicit_alive": self._alive_buffer.read_write(),
            "implicit_spans": self._span_buffer.read(),
        }
        for number, job in enumerate(listed):
            if number:  # one job's marks are read before the next one begins
                gpu.clear_buffer(self._counter_buffer, 4 * (int(job["counters"]) + 2), 4)
            here = {**scope, "implicit_job": gpu.constant(number)}
            if int(job["alive_words"]):
                gpu.clear_buffer(self._least_buffer)
                size = 64 * int(job["block_count"]), -(-int(job["count"]) // _SEGMENT)
                self._pass("bound_leaves", here).dispatch(*size)
                self._pass("find_alive", here).dispatch(*size)
                self._pass("emit_alive", here).dispatch_line(64 * int(np.prod(job["counts"])))
                continue
            is_fine_union = not job["is_root"] and made_of[number].is_union
            self._pass("prune_union" if is_fine_union else "prune", here).dispatch_line(64 * int(job["block_count"]))
            if int(job["eighths"]):
                self._pass("split", here).dispatch_line(8 * int(np.prod(job["counts"])))

    def _pass(self, entry: str, scope: Mapping[str, Any]) -> ComputePass:
        # See pruning.wesl. Those that split cells have a list of their own each.
        shared = self._gpu.adapter_info["adapter_type"] != "CPU" and entry != "split"
        module = _PRUNE if entry in ("prune", "split") else _UNIONS
        return self._gpu.compute(f"{self._owner}.{entry}", module, entry).bind(scope).features(shared_loads=shared)

    def counters(self) -> NDArray[np.uint32]:
        """(objects, 2): entries of lists that pruning used, or wanted, and cells that had to keep their parent's.

        Waits for the device.
        """
        return self._gpu.read_buffer(self._counter_buffer).view(np.uint32).reshape(-1, _COUNTERS)[:, :2]

    # --- life ---

    @property
    def is_trusted(self) -> bool:
        """Whether no user's code is in it."""
        return self._kinds.is_trusted and self._shadings.is_trusted

    @property
    def size(self) -> int:
        """Instructions of all objects."""
        return sum(made.program.size for made in self._objects)

    def resources(self) -> list[Resource]:
        """What it holds on the device."""
        return [*self._buffers, *([self._params] if self._params else [])]

    def close(self) -> None:
        """Free all device memory, once what was recorded has been submitted."""
        if self._gpu.recording:
            self._gpu.submit()
        for resource in self.resources():
            resource.destroy()
        self._buffers.clear()
        self._lists.clear()
        self._listed.clear()
        self._waiting.clear()
        self._params = None
        self._gpu.forget_groups()


def check_snippets(gpu: Gpu, implicit: Implicit) -> None:
    """Let the driver check the types of a user's code in an object, its shapes' and its materials'.

    Raises:
        SnippetError: with the place in the user's file.
    """
    found: dict[int, Any] = {id(implicit.material): implicit.material}
    for node in paint.nodes_of(implicit.shape):
        if isinstance(node, Painted):
            found.setdefault(id(node.surface), node.surface)
        elif getattr(node, "untrusted", False):
            source: Any = getattr(node, "source", None)
            validate(gpu, source)
    for material in found.values():
        if isinstance(material, ShadedMaterial):
            validate_shader(gpu, material.shader)
