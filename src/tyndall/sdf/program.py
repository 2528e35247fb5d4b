"""A shape as a program for the device: instructions in post-order, and the numbers that they work with.

An instruction is two words: what to do, and where in the *slots* its numbers are. Its first word::

    bits  0 … 15  code     which primitive or modifier, as :class:`Kinds` numbers them
    bits 16 … 19  type     LEAF, COMBINE, ENTER, LEAVE
    bits 20 … 23  join     how a value joins the one before it: PUSH, UNION, INTERSECT, SUBTRACT
    bits 24 … 25  blend    HARD, POLYNOMIAL, EXPONENTIAL, ROOT
    bit  26       NEGATE   the value is taken negative: what is left of ``a − b`` where a does not matter
    bit  27       TURNED   the leaf's place is turned, not only moved
    bit  28       PLACED   of ENTER and LEAVE: it changes the place; of LEAVE also: the one before comes back
    bit  29       BORROWS  the leaf has no material of its own and cuts: what it cuts keeps its material
    bit  30       OPAQUE   of ENTER and LEAVE: nothing inside is pruned

A leaf joins what came before it at once, so that a union of a thousand spheres needs no stack. What remains of a
program where some nodes do not matter is a part of it in the same order, with a join here and there turned into a PUSH
(or a COMBINE into the negation of its second value); so the lists that pruning makes are programs as well.

Slots, in vec4f; ``k`` is the width of a smooth join, ``L`` the Lipschitz bound of the value in the object's space:

- LEAF: ``(translation, factor) (a) (b) (k, L, material or −1, margin)``, and where it may be turned the three rows of
  the transform from the object's to the leaf's space. The translation is subtracted; the rows hold theirs themselves.
- COMBINE: ``(k, L, −, −)``.
- ENTER and LEAVE of a modifier: ``(a) (b) (−, L, −, −)``; of an affine transform (code AFFINE) ``(row) (row) (row)
  (factor, L, s, −)``.

L is in the space around the scope: that of the object, or inside the last ENTER of an affine transform, which a name
may scale at any time. There places change by s/factor as fast as in the space around it, where s is what modifiers
between the two add.

A leaf that only unions lie above has a *margin* ≥ 0, others −1: where its value is above that of the whole by more than
the margin, it does not matter. A smooth union of width k is at least a − k where a still matters, so the margin is the
sum of k over the unions above (and what takes its place for the other blends). But where a is so high above one of
them, hardly anything of it is left for the next: if its share there is s, of 0 … 1, it is k·(1 − s)² above their union,
and what it changes is multiplied by s at each further one. That a change be 10⁻⁸ of the widest k at least, it can be no
more than 7.02 of those k above the whole, however many unions there are (fifteen, with equal shares, are the worst).

Affine transforms are multiplied into the leaves below, except around what changes places by itself and around parts
with a name, which move as one. Of a leaf without a name that is then only enlarged, or round about places that are its
parameters, parameters take them in: it is not TURNED, and has three rows less to read.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.params import ParameterError
from tyndall.scene.model import Material
from tyndall.sdf.modifiers import Turning
from tyndall.sdf.repetition import Repetition
from tyndall.sdf.shape import (
    Combination,
    Floats,
    Modifier,
    Named,
    Operation,
    Painted,
    Primitive,
    Shape,
    Transformed,
)

LEAF, COMBINE, ENTER, LEAVE = range(4)
PUSH, UNION, INTERSECT, SUBTRACT = range(4)
HARD, POLYNOMIAL, EXPONENTIAL, ROOT = range(4)
NEGATE, TURNED, PLACED, BORROWS, OPAQUE = (1 << bit for bit in range(26, 31))
AFFINE = 0xFFFF

_JOINS: dict[Operation, int] = {"union": UNION, "intersection": INTERSECT, "subtraction": SUBTRACT}
_BLENDS = {"polynomial": POLYNOMIAL, "exponential": EXPONENTIAL, "root": ROOT}
_MOST_NODES = 1 << 20
_MOST_WIDTHS = 7.02  # of smooth unions, by which a leaf that matters is above the whole: see above


class Kinds:
    """The primitives and modifiers of some programs, numbered as their first instructions come.

    Args:
        like: others, whose numbers it begins with.

    Attributes:
        version: grows with every new one: shaders that know fewer must be made anew.
    """

    def __init__(self, like: Kinds | None = None) -> None:
        self._primitives: dict[Any, tuple[int, Primitive]] = dict(like._primitives) if like else {}
        self._modifiers: dict[Any, tuple[int, Modifier]] = dict(like._modifiers) if like else {}
        self._asked: set[Any] = set()
        self.version: int = like.version if like else 0

    def of(self, shape: Primitive | Modifier) -> int:
        """Its number; the same for all whose WESL is the same."""
        known: dict[Any, tuple[int, Any]] = self._primitives if isinstance(shape, Primitive) else self._modifiers
        key = _source(shape)
        self._asked.add(key)
        if key not in known:
            known[key] = len(known), shape
            self.version += 1
        return known[key][0]

    def ask(self, program: Program) -> None:
        """Ask for all that a program has, which was compiled with these numbers."""
        tables: tuple[Any, Any] = self._primitives, self._modifiers
        for known, codes in zip(tables, program.codes, strict=True):
            keys: list[Any] = list(known)
            self._asked |= {keys[code] for code in np.unique(codes).tolist()}

    @property
    def is_tight(self) -> bool:
        """Whether it holds none that was never asked for."""
        return len(self._asked) == len(self._primitives) + len(self._modifiers)

    def tightened(self, programs: Sequence[Program]) -> tuple[Kinds, list[Program]]:
        """Those that were asked for alone, in the same order, and programs with their numbers."""
        made, tables = Kinds(), []
        for known in (self._primitives, self._modifiers):
            each: dict[Any, tuple[int, Any]] = known
            table = np.zeros(len(each), np.uint32)
            for key, (code, shape) in each.items():
                if key in self._asked:
                    table[code] = made.of(shape)
            tables.append(table)
        return made, [program.renumbered(*tables) for program in programs]

    def sources(self) -> list[Any]:
        """The texts among them that a user wrote (:class:`~tyndall.sdf.snippets.SnippetSource`)."""
        shapes: list[Any] = [shape for _, shape in (*self._primitives.values(), *self._modifiers.values())]
        return [shape.source for shape in shapes if getattr(shape, "untrusted", False)]

    @property
    def is_trusted(self) -> bool:
        """Whether none of them is a user's code."""
        return not self.sources()

    def wesl(self) -> str:
        """Text for the bindings module: ``implicit_primitive``, its numbers in the slots or given, ``implicit_enter``
        and ``implicit_leave``.
        """
        leaf, leaf_of, enter, leave, texts = [], [], [], [], []
        for code, shape in self._primitives.values():
            b = "implicit_slots[at + 1u]" if len(shape.numbers) > 4 or _payload(shape) is not None else "vec4f(0.0)"
            leaf.append((code, f"{_function(shape)}(p, implicit_slots[at], {b})"))
            leaf_of.append((code, f"{_function(shape)}(p, a, b)"))
            texts.append(getattr(shape, "wesl", ""))
        for code, modifier in self._modifiers.values():
            numbers = "implicit_slots[at], implicit_slots[at + 1u]"
            if modifier.warps:
                enter.append((code, f"{_function(modifier)}_enter(p, {numbers})"))
            if modifier.adjusts:
                leave.append((code, f"{_function(modifier)}_leave(d, p, {numbers})"))
            texts.append(getattr(modifier, "wesl", ""))
        return "\n".join(
            [
                *dict.fromkeys(text for text in texts if text),
                _switch("implicit_primitive(code: u32, p: vec3f, at: u32) -> f32", leaf, "0.0"),
                _switch("implicit_primitive_of(code: u32, p: vec3f, a: vec4f, b: vec4f) -> f32", leaf_of, "0.0"),
                _switch("implicit_enter(code: u32, p: vec3f, at: u32) -> vec3f", enter, "p"),
                _switch("implicit_leave(code: u32, d: f32, p: vec3f, at: u32) -> f32", leave, "d"),
            ]
        )


def _source(shape: Primitive | Modifier) -> Any:
    return getattr(shape, "source", None) or type(shape)


def _function(shape: Primitive | Modifier) -> str:
    """The WESL function, with its module."""
    if hasattr(shape, "wesl"):  # a user's, in the same text
        return str(shape.function)  # type: ignore[union-attr]
    default = "modifiers" if isinstance(shape, Modifier) else "profiles" if shape.dimension == 2 else "solids"
    return f"{getattr(shape, 'module', None) or f'package::sdf::{default}'}::{shape.code}"


def _payload(shape: Primitive) -> NDArray[np.float32] | None:
    """Samples of a field that is no formula."""
    return getattr(shape, "payload", None)


_CASES = 32  # of one switch: Mesa's software adapter makes a nest of them, and gives zeros below 80 levels


def _switch(signature: str, cases: Sequence[tuple[int, str]], otherwise: str) -> str:
    """A function of ``code``, whose cases are numbered from 0 but for gaps: one switch, or one of several of them."""
    if len(cases) <= _CASES:
        lines = [f"case {code}u: {{ return {value}; }}" for code, value in cases]
        body = f"switch code {{ {' '.join(lines)} default: {{ return {otherwise}; }} }}"
        return f"fn {signature} {{ {body if cases else f'return {otherwise};'} }}"
    name, arguments = signature.partition("(")[::2]
    names = ", ".join(part.partition(":")[0].strip() for part in arguments.partition(")")[0].split(","))
    texts, calls = [], []
    for i in range(0, len(cases), _CASES):
        texts.append(_switch(f"{name}_{i // _CASES}({arguments}", cases[i : i + _CASES], otherwise))
        calls.append(
            f"if code <= {cases[min(i + _CASES, len(cases)) - 1][0]}u {{ return {name}_{i // _CASES}({names}); }}"
        )
    return "\n".join([*texts, f"fn {signature} {{ {' '.join(calls)} return {otherwise}; }}"])


@dataclass(frozen=True, eq=False)
class Part:
    """A named part: where its place is in the slots, and what it is placed by, before and after its own motion.

    Attributes:
        number: its place among the parts of its name, parts before their own parts; copies of one part share it.
        slot: the first vec4f of its leaf or its transform.
        entry: its instruction.
        leaf: its number among the leaves; −1: it is more than one, and has a transform of its own.
        before, after: 4×4, from its parent's space to the object's (or the scope's), and from its own to its parent's.
        factor: distances at rest, of the leaf or the transform.
        held: what is around it whose numbers follow from where it is at rest, so that it cannot move; "" for nothing.
        flat: it is a shape in the plane, and stays in it.
    """

    number: int
    slot: int
    entry: int
    leaf: int
    before: Floats
    after: Floats
    factor: float
    held: str = ""
    flat: bool = False


@dataclass(frozen=True, eq=False)
class Leaf:
    """A leaf of a program: where its numbers are, what it is, its placement, and how far unions can be below it."""

    slot: int
    shape: Primitive
    placement: Floats
    sag: float


@dataclass(eq=False)
class Program:
    """A compiled shape.

    Attributes:
        words: (n, 2) uint32, its instructions; slots are numbered from 0.
        slots: (m, 4) float32.
        names: the parts of each name.
        leaves: in the order of their instructions.
        materials: in the order of their numbers in the slots.
        values: the deepest stack of values.
        places: the deepest stack of places.
        lipschitz: L of the whole.
        material_rows: slots whose third number is a material's, or −1.
        sag: by how much the whole can be below its least leaf; −1 where not all leaves have a margin.
        payload_rows: slots whose first number is that of another slot, where samples begin.
    """

    words: NDArray[np.uint32]
    slots: NDArray[np.float32]
    names: Mapping[str, list[Part]]
    leaves: list[Leaf]
    materials: list[Material]
    values: int
    places: int
    lipschitz: float
    material_rows: NDArray[np.intp]
    payload_rows: NDArray[np.intp]

    sag: float = -1.0

    @property
    def size(self) -> int:
        """Instructions."""
        return len(self.words)

    @property
    def codes(self) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
        """Which primitives its leaves are, and which modifiers its scopes."""
        words = self.words[:, 0]
        leaves, scopes = self._coded
        low = np.uint32(0xFFFF)
        return words[leaves] & low, words[scopes] & low

    @property
    def _coded(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        kinds, codes = self.words[:, 0] >> 16 & 0xF, self.words[:, 0] & 0xFFFF
        return kinds == LEAF, ((kinds == ENTER) | (kinds == LEAVE)) & (codes != AFFINE)

    def renumbered(self, primitives: NDArray[np.uint32], modifiers: NDArray[np.uint32]) -> Program:
        """The same where each primitive and each modifier has another number."""
        words = self.words.copy()
        for table, where, codes in zip((primitives, modifiers), self._coded, self.codes, strict=True):
            words[where, 0] = (words[where, 0] & ~np.uint32(0xFFFF)) | table[codes]
        return replace(self, words=words)

    @cached_property
    def is_short_reaching(self) -> bool:
        """Whether what joins values is hard or polynomial: others reach many times their widths."""
        return bool((self.words[:, 0] >> 24 & 3 <= POLYNOMIAL).all())

    @cached_property
    def spans(self) -> NDArray[np.uint32]:
        """(n, 2): of what joins two values, where the first one begins, and where the second one does.

        Zeros of leaves that join nothing, and ones in all bits of what is neither a leaf nor joins.
        """
        spans = np.zeros((len(self.words), 2), np.uint32)
        starts: list[int] = []
        entered: list[int] = []
        for i, word in enumerate(self.words[:, 0].tolist()):
            kind, joins = word >> 16 & 0xF, word >> 20 & 0xF != PUSH
            if kind == LEAF and joins:
                spans[i] = starts[-1], i
            elif kind == LEAF:
                starts.append(i)
            elif kind == COMBINE:
                second = starts.pop()
                spans[i] = starts[-1], second
            else:
                spans[i] = 0xFFFFFFFF
                if kind == ENTER:
                    entered.append(i)
                elif word & PLACED:
                    starts[-1] = entered.pop()
        return spans


def compile_shape(shape: Shape, kinds: Kinds) -> Program:
    """The program of a solid shape.

    Raises:
        ParameterError: a flat shape, or one of more than a million nodes.
    """
    return _Compiler(kinds).compile(shape)


@dataclass
class _Context:
    """What surrounds a node: its pending transform, and what its leaves inherit."""

    matrix: Floats
    factor: float = 1.0
    material: Material | None = None
    cuts: bool = False
    stretch: float = 1.0
    name: str = ""
    before: Floats | None = None  # of the name: the transform around it
    margin: float = 0.0  # of exponential unions above; −1: others than unions are
    shares: float = 0.0  # sum of the widths of the polynomial ones above
    widest: float = 0.0  # of those
    sag: float = 0.0
    order: Mapping[str, int] = field(default_factory=dict)  # of the names, the next part's number
    number: int = 0  # of the part that the name is for
    held: str = ""  # as a part's

    @property
    def is_placed(self) -> bool:
        return not np.array_equal(self.matrix, np.eye(4))


class _Compiler:
    def __init__(self, kinds: Kinds) -> None:
        self._kinds = kinds
        self._words: list[tuple[int, int]] = []
        self._rows: list[Any] = []
        self._payloads: dict[int, tuple[int, Any]] = {}
        self._names: dict[str, list[Part]] = {}
        self._named_in: dict[int, Counter[str]] = {}
        self._leaves: list[Leaf] = []
        self._materials: dict[int, tuple[int, Material]] = {}
        self._depth = self._places = self._deepest = self._most_places = 0
        self._material_rows: list[int] = []
        self._payload_rows: list[int] = []
        self._sags: list[float] = []

    def compile(self, shape: Shape) -> Program:
        if shape.dimension != 3:
            raise ParameterError(f"shape: {type(shape).__name__} is flat; extrude or revolve it")
        if shape.count > _MOST_NODES:
            raise ParameterError(f"shape: {shape.count:,} nodes; {_MOST_NODES:,} are the most")
        self._emit(shape, _Context(np.eye(4)), PUSH, HARD, 0.0)
        return Program(
            np.array(self._words, np.uint32).reshape(-1, 2),
            np.array(self._rows, np.float32).reshape(-1, 4),
            self._names,
            self._leaves,
            [material for _, material in self._materials.values()],
            self._deepest,
            self._most_places,
            shape.lipschitz,
            np.array(self._material_rows, np.intp),
            np.array(self._payload_rows, np.intp),
            max(self._sags) if min(self._sags) >= 0 else -1.0,
        )

    # A node leaves one value: pushed, or joined to the value before it where ``join`` is not PUSH.

    def _emit(self, shape: Shape, c: _Context, join: int, blend: int, k: float) -> None:
        match shape:
            case Painted():
                self._emit(shape.shape, replace(c, material=shape.surface), join, blend, k)
            case Named():
                number = c.order.get(shape.name, 0)
                c = replace(c, order={**c.order, shape.name: number + 1})
                if _is_leaf(shape.shape):
                    inside = replace(c, name=shape.name, number=number, before=c.matrix, matrix=np.eye(4))
                    self._emit(shape.shape, inside, join, blend, k)
                else:
                    self._scope(shape.shape, c, shape.name, number)
                    self._join(join, blend, k, shape.lipschitz * c.stretch)
            case Transformed():
                inside = replace(c, matrix=c.matrix @ shape.placement, factor=c.factor * shape.factor)
                self._emit(shape.shape, inside, join, blend, k)
            case Primitive():
                self._leaf(shape, c, join, blend, k)
            case Combination():
                self._combination(shape, c, join, blend, k)
            case Modifier():
                self._modifier(shape, c)
                self._join(join, blend, k, shape.lipschitz * c.stretch)
            case Repetition() if not shape.opaque:
                self._combination(Combination(shape.copies()), c, join, blend, k, copies=True)
            case Repetition():  # the values of the copies jump, only that of all together does not
                held = replace(c, held="repetition without end")
                self._scope(Combination(shape.copies()), held, opaque=True, copies=True)
                self._join(join, blend, k, shape.lipschitz * c.stretch)
            case _:
                raise ParameterError(f"shape: a {type(shape).__name__} has no program")

    def _names_in(self, shape: Shape) -> Counter[str]:
        """How many parts of each name are in it."""
        if id(shape) not in self._named_in:
            found: Counter[str] = Counter([shape.name] if isinstance(shape, Named) else [])
            for child in shape.children:
                found += self._names_in(child)
            self._named_in[id(shape)] = found
        return self._named_in[id(shape)]

    def _each(self, shapes: Sequence[Shape], c: _Context, copies: bool) -> list[tuple[Shape, _Context]]:
        """Children with their contexts: what is named in them is numbered in order; in copies alike."""
        order = dict(c.order)
        made = []
        for shape in shapes:
            names = self._names_in(shape)
            made.append((shape, replace(c, order=dict(order)) if names else c))
            for name, count in names.items() if not copies else ():
                order[name] = order.get(name, 0) + count
        return made

    def _put(self, *rows: Sequence[float]) -> int:
        at = len(self._rows)
        self._rows.extend(rows)
        return at

    def _word(
        self, kind: int, code: int = 0, join: int = PUSH, blend: int = HARD, flags: int = 0, slot: int = 0
    ) -> None:
        self._words.append((code | kind << 16 | join << 20 | blend << 24 | flags, slot))

    def _pushed(self) -> None:
        self._depth += 1
        self._deepest = max(self._deepest, self._depth)

    def _join(self, join: int, blend: int, k: float, lipschitz: float) -> None:
        """Join the last value, which was pushed, to the one before."""
        if join != PUSH:
            self._word(COMBINE, join=join, blend=blend, slot=self._put((k, lipschitz, 0, 0)))
            self._depth -= 1

    def _leaf(self, shape: Primitive, c: _Context, join: int, blend: int, k: float) -> None:
        placement, factor = c.matrix if c.before is None else c.before @ c.matrix, c.factor
        if not c.name:
            shape, placement, factor = _taken_in(shape, placement, factor)
        turned = not np.array_equal(placement[:3, :3], np.eye(3))
        flags = (TURNED if turned else 0) | (BORROWS if c.cuts and c.material is None else 0)
        numbers = [float(x) for x in shape.numbers]
        if len(numbers) > 8:
            raise ParameterError(f"{type(shape).__name__}: {len(numbers)} numbers; a primitive has at most 8")
        numbers += [0.0] * (8 - len(numbers))
        if (payload := _payload(shape)) is not None:
            numbers[0] = float(self._payload(payload))
            self._payload_rows.append(len(self._rows) + 1)
        margin = c.margin + min(c.shares, _MOST_WIDTHS * c.widest) if c.margin >= 0 else -1.0
        slot = self._put(
            (*placement[:3, 3], factor),
            numbers[:4],
            numbers[4:],
            (k, shape.lipschitz * c.stretch, float(self._material(c.material)), margin),
        )
        self._material_rows.append(slot + 3)
        self._sags.append(c.sag if c.margin >= 0 else -1.0)
        if turned or c.name:
            self._put(*np.linalg.inv(placement)[:3])
        if c.name:
            assert c.before is not None
            entry, leaf, flat = len(self._words), len(self._leaves), shape.dimension == 2
            part = Part(c.number, slot, entry, leaf, c.before, c.matrix, c.factor, c.held, flat)
            self._names.setdefault(c.name, []).append(part)
        self._leaves.append(Leaf(slot, shape, placement, c.sag))
        self._word(LEAF, self._kinds.of(shape), join, blend, flags, slot)
        if join == PUSH:
            self._pushed()

    def _material(self, material: Material | None) -> int:
        if material is None:
            return -1
        return self._materials.setdefault(id(material), (len(self._materials), material))[0]

    def _payload(self, samples: NDArray[np.float32]) -> int:
        """The first vec4f of some samples, which several leaves may share."""
        if id(samples) not in self._payloads:
            padded = np.zeros(-(-samples.size // 4) * 4, np.float32)
            padded[: samples.size] = samples.ravel()
            self._payloads[id(samples)] = self._put(*padded.reshape(-1, 4)), samples
        return self._payloads[id(samples)][0]

    def _combination(
        self, shape: Combination, c: _Context, join: int, blend: int, k: float, *, copies: bool = False
    ) -> None:
        inner = _JOINS[shape.operation]
        smooth = shape.smooth > 0
        if len(shape.shapes) > 1 and (shape.operation != "union" or (smooth and shape.blend == "root")):
            c = replace(c, margin=-1.0)
        children = self._each(shape.shapes, c, copies)
        if len(children) == 1:
            self._emit(*children[0], join, blend, k)
            return
        width, kind = shape.smooth * c.factor, _BLENDS[shape.blend] if smooth else HARD
        lipschitz = shape.lipschitz * c.stretch
        if shape.operation == "subtraction":
            self._emit(*children[0], PUSH, HARD, 0.0)
            rest = [(child, replace(inside, cuts=True, material=None)) for child, inside in children[1:]]
            if not smooth or len(rest) == 1:
                for child, inside in rest:
                    self._emit(child, inside, SUBTRACT, kind, width)
            else:
                self._pairs(rest, UNION, kind, width)
                self._join(SUBTRACT, kind, width, lipschitz)
        elif smooth:
            self._pairs(children, inner, kind, width)
        else:
            if join == inner and blend == HARD:  # a union in a union
                for child, inside in children:
                    self._emit(child, inside, join, HARD, 0.0)
                return
            children.sort(key=lambda child: not _is_deep(child[0]))  # what needs a stack comes first
            for i, (child, inside) in enumerate(children):
                self._emit(child, inside, inner if i else PUSH, HARD, 0.0)
        self._join(join, blend, k, lipschitz)

    def _pairs(
        self, children: list[tuple[Shape, _Context]], inner: int, kind: int, width: float, above: int = 0
    ) -> None:
        """Smooth joins of neighbours by pairs, as :meth:`Combination.distance` takes them; ``above``: joins of the same
        kind around them.
        """
        if len(children) == 1:
            child, c = children[0]
            self._emit(child, _below_unions(c, kind, width, above), PUSH, HARD, 0.0)
            return
        above += 1
        # Pairing from the left gives a first half of a power of two.
        half = 1 << (len(children) - 1).bit_length() - 1
        self._pairs(children[:half], inner, kind, width, above)
        if len(children) - half == 1:
            child, c = children[half]
            self._emit(child, _below_unions(c, kind, width, above), inner, kind, width)
        else:
            self._pairs(children[half:], inner, kind, width, above)
            self._join(inner, kind, width, max(child.lipschitz * c.stretch for child, c in children))

    def _scope(
        self, shape: Shape, c: _Context, name: str = "", number: int = 0, *, opaque: bool = False, copies: bool = False
    ) -> None:
        """A shape inside its pending transform as instructions of their own; a named one always has them.

        Args:
            opaque: nothing inside is pruned.
            copies: the shape's children are copies of one.
        """
        flags = PLACED | (OPAQUE if opaque else 0)
        factor = c.factor
        slot = self._put(*np.linalg.inv(c.matrix)[:3], (factor, shape.lipschitz * c.stretch, c.stretch, 0))
        entry = len(self._words)
        self._word(ENTER, AFFINE, flags=flags, slot=slot)
        self._entered()
        inside = replace(c, matrix=np.eye(4), factor=1.0, stretch=1.0, name="", before=None, margin=-1.0)
        if copies:
            assert isinstance(shape, Combination)
            self._combination(shape, inside, PUSH, HARD, 0.0, copies=True)
        else:
            self._emit(shape, inside, PUSH, HARD, 0.0)
        self._places -= 1
        if name:
            part = Part(number, slot, entry, -1, c.matrix, np.eye(4), factor, c.held, shape.dimension == 2)
            self._names.setdefault(name, []).append(part)
        self._word(LEAVE, AFFINE, flags=flags, slot=slot)

    def _entered(self) -> None:
        self._places += 1
        self._most_places = max(self._most_places, self._places)

    def _modifier(self, shape: Modifier, c: _Context) -> None:
        needs_place = shape.warps or getattr(shape, "placed", True)
        if (c.is_placed and needs_place) or c.factor != 1.0:
            self._scope(shape, c)
            return
        numbers = [float(x) for x in shape.numbers]
        if len(numbers) > 8:
            raise ParameterError(f"{type(shape).__name__}: {len(numbers)} numbers; a modifier has at most 8")
        numbers += [0.0] * (8 - len(numbers))
        code = self._kinds.of(shape)
        slot = self._put(numbers[:4], numbers[4:], (0, shape.lipschitz * c.stretch, 0, 0))
        if shape.warps:
            self._word(ENTER, code, flags=PLACED, slot=slot)
            self._entered()
        held = shape.code if isinstance(shape, Turning) else c.held
        inside = replace(c, stretch=c.stretch * shape.stretch, margin=-1.0, held=held)
        self._emit(shape.shape, inside, PUSH, HARD, 0.0)
        if shape.warps:
            self._places -= 1
        if shape.warps or shape.adjusts:
            self._word(LEAVE, code, flags=PLACED if shape.warps else 0, slot=slot)


def _below_unions(c: _Context, kind: int, width: float, count: int) -> _Context:
    """What is around a part of that many smooth unions, each in the next."""
    if c.margin < 0 or count == 0:
        return c
    if kind == EXPONENTIAL:  # is k·log₂(2) below two equal values, and nothing is left of one 24 k above the other
        return replace(c, margin=c.margin + 25.0 * count * width, sag=c.sag + count * width)
    return replace(c, shares=c.shares + count * width, widest=max(c.widest, width), sag=c.sag + 0.25 * count * width)


def _taken_in(shape: Primitive, placement: Floats, factor: float) -> tuple[Primitive, Floats, float]:
    """The leaf, where it is and its factor, once its parameters have taken in how it is turned and enlarged."""
    linear = placement[:3, :3]
    if np.array_equal(linear, np.eye(3)):
        return shape, placement, factor
    size = float(abs(np.linalg.det(linear))) ** (1 / 3)
    turn = linear / size
    if np.abs(turn @ turn.T - np.eye(3)).max() > 1e-9 or (made := shape.similar(turn, size)) is None:
        return shape, placement, factor
    moved = np.eye(4)
    moved[:3, 3] = placement[:3, 3]
    return made, moved, factor / size


def _is_leaf(shape: Shape) -> bool:
    """Whether it is a primitive, painted and placed at most."""
    while isinstance(shape, (Painted, Transformed)):
        shape = shape.shape
    return isinstance(shape, Primitive)


def _is_deep(shape: Shape) -> bool:
    """Whether it needs more than one instruction."""
    return not _is_leaf(shape.shape if isinstance(shape, Named) else shape)
