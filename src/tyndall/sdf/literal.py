"""Implicit surfaces as literal code: one function with every number in it, as people write them by hand.

>>> from tyndall.scene.model import Implicit
>>> from tyndall.sdf import sphere
>>> text = literal([Implicit(sphere(0.5).at(1, 0, 0))]).text
>>> print(text[text.index("fn scene_distance") : text.index("fn scene_material")])
fn scene_distance(p: vec3f) -> f32 {
    let p0 = p - vec3f(1.0, 0.0, 0.0);
    let d1 = solids_sphere(p0, vec4f(0.5, 0.0, 0.0, 0.0), vec4f(0.0));
    return d1;
}
<BLANKLINE>

It is what a compiler can make the most of, and what the interpreter of ``field.py`` is measured against
(``tyndall bench sdf``). Its weakness is that it must be compiled anew for every edit, which takes seconds from some
hundred nodes on, and that it has no way around a node that is far away.

What is written is what a careful person writes:

- transforms are folded into constants: one that follows another costs nothing, one that only moves is a subtraction,
  one that turns by right angles a swizzle, one that turns about an axis four products; a turn that several leaves
  share is done once, and so is a place that several ask at;
- values are scaled where a transform scales, and only there;
- a shape that is repeated is written once, at the place in its own cell, and once more for the neighbour towards the
  place on each axis, unless it is its own mirror image there and no larger than its cell;
- smooth unions of the polynomial kind are written as ``min(a, b) − max(k − |a − b|, 0)² / 4k``, which is the same as
  S5's form, by pairs in the same order as in :class:`~tyndall.sdf.shape.Combination`.

Objects that are unions of very many leaves can be looped over instead (:mod:`tyndall.sdf.listed`): their rows are then
in a buffer ``scene_rows: array<vec4f>``, which must be bound, and may change without new code.

The text declares, and a shader that has it among its bindings may import:

- ``scene_distance(p: vec3f) -> f32``, in the world;
- ``scene_material(p: vec3f) -> u32``, the number of the material of what is nearest;
- ``scene_surface(index: u32) -> SceneSurface``, that material.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tyndall.gpu.params import ParameterError
from tyndall.scene.model import Implicit, Material, box_corners
from tyndall.sdf.listed import List
from tyndall.sdf.repetition import Polar, Repeated
from tyndall.sdf.shape import Combination, Floats, Modifier, Named, Painted, Primitive, Shape, Transformed

_STRUCT = """struct SceneSurface {
    base_color: vec3f,
    metallic: f32,
    emissive: vec3f,
    roughness: f32,
}"""

# The lesser of two values where surfaces become one; the greater is −least(−a, −b).
_BLENDS = {
    "polynomial": """fn scene_polynomial(a: f32, b: f32, k: f32, share: f32) -> f32 {
    let h = max(k - abs(a - b), 0.0);
    return min(a, b) - h * h * share;
}""",
    "exponential": """fn scene_exponential(a: f32, b: f32, k: f32, share: f32) -> f32 {
    return min(a, b) - k * log2(1.0 + exp2(-abs(a - b) * share));
}""",
    "root": """fn scene_root(a: f32, b: f32, k: f32, share: f32) -> f32 {
    return 0.5 * (a + b - sqrt((a - b) * (a - b) + share));
}""",
}
_SHARES = {"polynomial": lambda k: 0.25 / k, "exponential": lambda k: 1 / k, "root": lambda k: k * k}


@dataclass(frozen=True)
class Literal:
    """Code of some objects.

    Attributes:
        text: WESL; see the module.
        materials: by their numbers.
        lists: what is looped over, in the order of its rows in ``scene_rows``.
    """

    text: str
    materials: tuple[Material, ...]
    lists: tuple[List, ...] = ()

    def rows(self, moves: Mapping[str, ArrayLike] | None = None) -> NDArray[np.float32]:
        """What ``scene_rows`` holds, (N, 4) float32, with named leaves moved; see :meth:`List.rows`."""
        empty = np.zeros((1, 4), np.float32)
        return np.concatenate([each.rows(moves) for each in self.lists]) if self.lists else empty


def literal(implicits: Sequence[Implicit], *, loops: Collection[int] = ()) -> Literal:
    """Write the code of objects that are joined by a hard union.

    Args:
        loops: numbers of the objects that are looped over.

    Raises:
        ParameterError: no object, a node that has no code, or an object that is no list.
    """
    if not implicits:
        raise ParameterError("implicits: none are given")
    materials: dict[Material, int] = {}
    imports: dict[str, None] = {}
    blends: set[str] = set()
    lists: dict[int, List] = {}
    for i in sorted(loops):
        found = List.of(_shape(implicits[i]), implicits[i].material)
        if found is None:
            raise ParameterError(f"implicits[{i}]: it is no union of leaves alone")
        lists[i] = found
    listed, first = [], 0
    for i, each in lists.items():
        numbers = [materials.setdefault(m, len(materials)) for m in each.materials]
        listed += _loops(each, i, first, numbers, imports)
        blends |= {each.blend} if each.smooth else set()
        first += len(each.leaves) * each.stride
    bodies = []
    for with_material in (False, True):
        writer = _Writer(materials, imports, blends, with_material)
        values = [
            writer.listed(i, lists[i]) if i in lists else writer.object(implicit)
            for i, implicit in enumerate(implicits)
        ]
        bodies.append((writer, writer.pairs(values, "union", 0.0, "polynomial")))
    (plain, distance), (tracked, nearest) = bodies
    parts = [
        *sorted(imports, key=lambda line: not line.startswith("import")),
        _STRUCT,
        *(_BLENDS[blend] for blend in sorted(blends)),
        *listed,
        _function("scene_distance", "f32", [*plain.lines, f"return {plain.text(distance)};"]),
        _function("scene_material", "u32", _needed([*tracked.lines, f"return {nearest.material};"])),
        _surfaces(tuple(materials)),
    ]
    return Literal("\n".join(parts) + "\n", tuple(materials), tuple(lists.values()))


def _shape(implicit: Implicit) -> Shape:
    shape: Any = implicit.shape
    placed: Shape = shape.transform(implicit.transform)
    return placed


def _function(name: str, result: str, lines: Sequence[str]) -> str:
    return _indented(f"fn {name}(p: vec3f) -> {result}", lines)


def _needed(lines: Sequence[str]) -> list[str]:
    """Without what the last line does not need: the distances of what has a material of one kind only."""
    kept: list[str] = []
    wanted: set[str] = set()
    for line in reversed(lines):
        name = line.split(" ")[1] if line.startswith("let ") else ""
        if not name or name in wanted:
            kept.append(line)
            wanted.update(_words(line))
    return kept[::-1]


def _words(line: str) -> set[str]:
    return set("".join(c if c.isalnum() or c == "_" else " " for c in line).split())


def _surfaces(materials: Sequence[Material]) -> str:
    def surface(m: Material) -> str:
        color, shine = vector(m.base_color[:3]), vector(m.emissive)
        return f"return SceneSurface({color}, {number(m.metallic)}, {shine}, {number(m.roughness)});"

    cases = [
        f"{f'case {i}u' if i < len(materials) - 1 else 'default'}: {{ {surface(m)} }}" for i, m in enumerate(materials)
    ]
    lines = ["switch index {", *(f"    {case}" for case in cases), "}"]
    return "\n".join(["fn scene_surface(index: u32) -> SceneSurface {", *(f"    {line}" for line in lines), "}"])


# --- text ---------------------------------------------------------------------------------------------------------


def number(x: float) -> str:
    """A float32 in WGSL, by the fewest digits that give it back.

    Raises:
        ParameterError: it is infinite or none.
    """
    if not math.isfinite(x):
        raise ParameterError(f"{x} cannot be written as literal code")
    return str(np.float32(x) + np.float32(0))  # −0 is 0


def vector(values: Sequence[float] | Floats) -> str:
    """Two to four numbers."""
    texts = [number(float(v)) for v in values]
    kind = f"vec{len(texts)}f"
    return f"{kind}({texts[0]})" if len(set(texts)) == 1 else f"{kind}({', '.join(texts)})"


def fours(numbers: Sequence[float]) -> str:
    """The two arguments of a node's function."""
    filled = [*numbers, *([0.0] * (8 - len(numbers)))]
    return f"{vector(filled[:4])}, {vector(filled[4:])}"


def moved(base: str, matrix: Floats) -> str:
    """A place after an affine map, 4×4."""
    linear, offset = matrix[:3, :3], matrix[:3, 3]
    kept = ", ".join(_row(base, row) for row in linear)
    zeros = int((linear == 0).sum())
    diagonal = linear.diagonal()
    if np.array_equal(linear, np.eye(3)):
        turned = base
    elif zeros == 6 and np.array_equal(linear, np.diag(diagonal)):
        turned = f"{number(diagonal[0])} * {base}" if len(set(diagonal)) == 1 else f"{vector(diagonal)} * {base}"
    elif zeros >= 4:
        turned = f"vec3f({kept})"
    else:
        columns = ", ".join(number(float(x)) for x in linear.T.ravel())
        turned = f"mat3x3f({columns}) * {base}"
    if not offset.any():
        return turned
    if turned == base:  # so that the number is the place, as people write it
        return f"{base} - {vector(-offset)}"
    return f"{turned} + {vector(offset)}"


def _row(base: str, row: Floats) -> str:
    terms = []
    for x, axis in zip(row, "xyz", strict=True):
        if x == 1:
            terms.append(f"{base}.{axis}")
        elif x == -1:
            terms.append(f"-{base}.{axis}")
        elif x != 0:
            terms.append(f"{number(float(x))} * {base}.{axis}")
    return " + ".join(terms).replace("+ -", "- ")


# --- nodes --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Place:
    """Where a node is asked: an affine map of a variable."""

    base: str
    matrix: Floats


@dataclass(frozen=True)
class _Value:
    """What a node gives: a variable times a factor, and the number of its material or a variable that holds it."""

    name: str
    factor: float = 1.0
    material: str = "0u"


_BORROWED = "4294967295u"  # of what cuts, and has no material of its own: that of what it cuts


class _Writer:
    """The body of one function."""

    def __init__(
        self, materials: dict[Material, int], imports: dict[str, None], blends: set[str], tracked: bool
    ) -> None:
        self.lines: list[str] = []
        self._materials, self._imports, self._blends, self._tracked = materials, imports, blends, tracked
        self._places: dict[tuple[str, bytes], str] = {}
        self._count = 0

    def object(self, implicit: Implicit) -> _Value:
        """A whole object."""
        return self._node(_shape(implicit), _Place("p", np.eye(4)), implicit.material)

    def listed(self, index: int, each: List) -> _Value:
        """An object that is looped over."""
        if self._tracked and len(each.materials) > 1:
            pair = self._let("v", f"scene_nearest_{index}(p)")
            return _Value(f"{pair}.x", 1.0, f"u32({pair}.y)")
        return _Value(self._let("d", f"scene_list_{index}(p)"), 1.0, self._number_of(each.materials[0]))

    def _number_of(self, material: Material | None) -> str:
        if material is None:
            return _BORROWED
        return f"{self._materials.setdefault(material, len(self._materials))}u"

    def _let(self, letter: str, expression: str) -> str:
        name = f"{letter}{self._count}"
        self._count += 1
        self.lines.append(f"let {name} = {expression};")
        return name

    def _at(self, place: _Place) -> str:
        """The variable that holds a place."""
        matrix = place.matrix
        if np.array_equal(matrix, np.eye(4)):
            return place.base
        key = (place.base, (np.round(matrix, 12) + 0.0).tobytes())
        if key not in self._places:
            self._places[key] = self._let("p", moved(place.base, matrix))
        return self._places[key]

    def text(self, value: _Value) -> str:
        """A value as an operand."""
        if abs(value.factor) == 1:
            return value.name if value.factor == 1 else f"-{value.name}"
        return f"{number(value.factor)} * {value.name}"

    def _held(self, value: _Value) -> _Value:
        """The same without a factor."""
        return value if value.factor == 1 else _Value(self._let("d", self.text(value)), 1.0, value.material)

    def _function(self, node: Primitive | Modifier, name: str) -> str:
        return _imported(node, name, self._imports)

    def _node(self, node: Shape, place: _Place, material: Material | None) -> _Value:
        match node:
            case Primitive():
                call = f"{self._function(node, node.code)}({self._at(place)}, {fours(node.numbers)})"
                return _Value(self._let("d", call), 1.0, self._number_of(material))
            case Modifier():
                return self._modifier(node, place, material)
            case Combination():
                return self._combination(node, place, material)
            case Transformed():
                return self._transformed(node, place, material)
            case Painted():
                return self._node(node.shape, place, node.surface)
            case Named():
                return self._node(node.shape, place, material)
            case Repeated() if _is_within(node.shape, node.spacing, node.counts):
                return self._repeated(node, place, material)
            case Polar() if (middle := _sector(node)) is not None:
                return self._polar(node, *middle, place, material)
        copies = getattr(node, "copies", None)
        if copies is not None:
            return self.pairs([self._node(copy, place, material) for copy in copies()], "union", 0.0, "polynomial")
        raise ParameterError(f"{type(node).__name__} has no literal code")

    def _modifier(self, node: Modifier, place: _Place, material: Material | None) -> _Value:
        numbers = fours(node.numbers)
        if node.warps:
            inside = self._let("p", f"{self._function(node, f'{node.code}_enter')}({self._at(place)}, {numbers})")
            child = self._node(node.shape, _Place(inside, np.eye(4)), material)
        else:
            child = self._node(node.shape, place, material)
        if not node.adjusts:
            return child
        leave = self._function(node, f"{node.code}_leave")
        name = self._let("d", f"{leave}({self.text(child)}, {self._at(place)}, {numbers})")
        return _Value(name, 1.0, child.material)

    def _transformed(self, node: Transformed, place: _Place, material: Material | None) -> _Value:
        inverse = np.linalg.inv(node.placement)
        linear = inverse[:3, :3]
        linear[np.abs(linear) < 1e-14 * np.abs(linear).max()] = 0
        linear[np.abs(linear - 1) < 1e-14] = 1
        linear[np.abs(linear + 1) < 1e-14] = -1
        inner = _Place(place.base, inverse @ place.matrix)
        turns = np.count_nonzero(inner.matrix[:3, :3]) > 3
        if turns and _leaves(node.shape) > 1:
            inner = _Place(self._at(inner), np.eye(4))
        child = self._node(node.shape, inner, material)
        factor = child.factor * node.factor
        return _Value(child.name, 1.0 if abs(factor - 1) < 1e-9 else factor, child.material)

    def _combination(self, node: Combination, place: _Place, material: Material | None) -> _Value:
        cuts = node.operation == "subtraction"
        values = [self._node(shape, place, None if cuts and i > 0 else material) for i, shape in enumerate(node.shapes)]
        how = node.smooth, node.blend
        if node.operation != "subtraction" or len(values) == 1:
            return self.pairs(values, node.operation, *how)
        first, *rest = values
        taken = self.pairs(rest, "union", *how)  # max over −d is −(min over d), smooth ones too
        return self._pair(first, taken, "subtraction", *how)

    def _repeated(self, node: Repeated, place: _Place, material: Material | None) -> _Value:
        """The copy in the place's own cell, and its neighbours' towards the place."""
        several = np.array(node.counts) > 1
        spacing, half = np.where(several, node.spacing, 0.0), np.where(several, node.half, 0.0)
        p = self._at(place)
        last = vector([n - 1 for n in node.counts])
        parts = [vector(v) for v in (half, np.where(several, 1 / np.array(node.spacing), 0.0), spacing, half)]
        cell = self._let("c", f"clamp(round(({p} + {parts[0]}) * {parts[1]}), vec3f(0.0), {last})")
        own = self._let("p", f"{p} - ({cell} * {parts[2]} - {parts[3]})")
        narrow = [s == 0 or _is_mirror(node.shape, axis, s) for axis, s in enumerate(spacing)]
        if all(narrow):
            return self._node(node.shape, _Place(own, np.eye(4)), material)
        beside = self._let("c", f"clamp({cell} + sign({own}), vec3f(0.0), {last})")
        values = []
        for choice in itertools.product(*[(cell,) if one else (cell, beside) for one in narrow]):
            at = f"vec3f({', '.join(f'{name}.{axis}' for name, axis in zip(choice, 'xyz', strict=True))})"
            inside = own if set(choice) == {cell} else self._let("p", f"{p} - ({at} * {parts[2]} - {parts[3]})")
            values.append(self._node(node.shape, _Place(inside, np.eye(4)), material))
        return self.pairs(values, "union", 0.0, "polynomial")

    def _polar(
        self, node: Polar, frame: Floats, middle: float, mirrored: bool, place: _Place, material: Material | None
    ) -> _Value:
        """The copy in the place's own sector, and the next one towards the place."""
        step = 2 * math.pi / node.number
        about = _Place(place.base, np.linalg.inv(frame) @ place.matrix)
        p = self._at(about)
        turn = self._let("a", f"(atan2({p}.y, {p}.x) - {number(middle)}) * {number(1 / step)}")
        own = self._let("a", f"round({turn})")
        values = []
        for i in range(1 if mirrored else 2):
            sector = own if i == 0 else f"({own} + sign({turn} - {own}))"
            angle = self._let("a", f"{number(step)} * {sector}")
            pair = self._let("a", f"vec2f(cos({angle}), sin({angle}))")
            turned = f"vec3f(dot({pair}, {p}.xy), {pair}.x * {p}.y - {pair}.y * {p}.x, {p}.z)"
            values.append(self._node(node.shape, _Place(self._let("p", turned), frame), material))
        return self.pairs(values, "union", 0.0, "polynomial")

    def pairs(self, values: Sequence[_Value], operation: str, smooth: float, blend: str) -> _Value:
        """Neighbours by pairs until one is left, as :class:`Combination` has it."""
        values = list(values)
        while len(values) > 1:
            done = [self._pair(a, b, operation, smooth, blend) for a, b in zip(values[::2], values[1::2], strict=False)]
            values = done + ([values[-1]] if len(values) % 2 else [])
        return values[0]

    def _pair(self, a: _Value, b: _Value, operation: str, smooth: float, blend: str) -> _Value:
        least, cut = operation == "union", -1 if operation == "subtraction" else 1
        if self._tracked and a.material != b.material:
            a, b = self._held(a), self._held(b)
        if smooth == 0:
            result = f"{'min' if least else 'max'}({self.text(a)}, {self.text(_Value(b.name, cut * b.factor))})"
        else:
            self._blends.add(blend)
            signs = (1, 1) if least else (-1, -cut)
            signed = [self.text(_Value(v.name, sign * v.factor)) for v, sign in zip((a, b), signs, strict=True)]
            given = f"{number(smooth)}, {number(_SHARES[blend](smooth))}"
            result = f"{'' if least else '-'}scene_{blend}({', '.join(signed)}, {given})"
        material, other = a.material, b.material
        if operation == "subtraction" and other == _BORROWED:
            other = material
        elif self._tracked and operation == "subtraction" and other.startswith("m"):
            other = self._let("m", f"select({other}, {material}, {other} == {_BORROWED})")
        if self._tracked and material != other:
            first = f"-{b.name}" if operation == "subtraction" else b.name
            nearer = f"{first} {'<' if least else '>'} {a.name}"
            material = self._let("m", f"select({material}, {other}, {nearer})")
        return _Value(self._let("d", result), 1.0, material)


def _imported(node: Primitive | Modifier, name: str, imports: dict[str, None]) -> str:
    """The name of a node's function, and among ``imports`` the line that brings it: an import, or a user's text.

    Raises:
        ParameterError: it reads samples.
    """
    if getattr(node, "payload", None) is not None:
        raise ParameterError(f"{type(node).__name__} has samples, and they are no literal code")
    if hasattr(node, "wesl"):  # a user's, which is text of its own
        imports[str(node.wesl)] = None
        return name.replace(node.code, str(node.function), 1)  # type: ignore[union-attr]
    default = "modifiers" if isinstance(node, Modifier) else "solids" if node.dimension == 3 else "profiles"
    path = getattr(node, "module", None) or f"package::sdf::{default}"
    alias = f"{path.rpartition('::')[2]}_{name}"
    imports[f"import {path}::{{{name} as {alias}}};"] = None
    return alias


def _loops(each: List, index: int, first: int, materials: Sequence[int], imports: dict[str, None]) -> list[str]:
    """The functions of a list: a leaf's value, the whole one's, and the nearest leaf's with its material."""
    layout, stride, kinds = each.layout, each.stride, each.kinds
    end = first + stride * len(each.leaves)
    calls = [_imported(kind, kind.code, imports) for kind in kinds]
    a = {"bare": "vec4f(head.w, 0.0, 0.0, 0.0)", "placed": "scene_rows[i + 1u]", "turned": "scene_rows[i + 4u]"}[layout]
    b = {"bare": "vec4f(0.0)", "placed": "scene_rows[i + 2u]" if each.is_long else "vec4f(0.0)"}.get(
        layout, "scene_rows[i + 5u]"
    )
    if layout == "turned":
        place = "vec4f(p, 1.0) * mat3x4f(scene_rows[i], scene_rows[i + 1u], scene_rows[i + 2u])"
        lines = [f"let q = {place};", "let head = scene_rows[i + 3u];"]
        tag, factor = "bitcast<u32>(head.x)", "head.y * "
    else:
        lines = ["let head = scene_rows[i];", "let q = p - head.xyz;"]
        tag, factor = "bitcast<u32>(head.w)", ""
    values = [f"return {factor}{call}(q, {a}, {b});" for call in calls]
    if len(calls) == 1:
        lines += values
    else:
        cases = [f"{f'case {i}u' if i < len(values) - 1 else 'default'}: {{ {v} }}" for i, v in enumerate(values)]
        lines += [f"switch {tag} & 255u {{", *(f"    {case}" for case in cases), "}"]
    leaf = _indented(f"fn scene_leaf_{index}(p: vec3f, i: u32) -> f32", lines)
    loop = f"for (var i = {first + stride}u; i < {end}u; i += {stride}u)"
    value = f"scene_leaf_{index}(p, i)"
    joined = f"min(d, {value})"
    if each.smooth:
        given = f"{number(each.smooth)}, {number(_SHARES[each.blend](each.smooth))}"
        joined = f"scene_{each.blend}(d, {value}, {given})"
    whole = _indented(
        f"fn scene_list_{index}(p: vec3f) -> f32",
        [f"var d = scene_leaf_{index}(p, {first}u);", f"{loop} {{", f"    d = {joined};", "}", "return d;"],
    )
    if len(materials) == 1:
        return [leaf, whole]
    where = "i + 3u].x" if layout == "turned" else "i].w"
    cases = [
        f"{f'case {i}u' if i < len(materials) - 1 else 'default'}: {{ m = {m}u; }}" for i, m in enumerate(materials)
    ]
    nearest = _indented(
        f"fn scene_nearest_{index}(p: vec3f) -> vec2f",
        [
            f"var d = scene_leaf_{index}(p, {first}u);",
            "var least = d;",
            f"var at = {first}u;",
            f"{loop} {{",
            f"    let value = {value};",
            f"    d = {joined.replace(value, 'value')};",
            "    if value < least {",
            "        least = value;",
            "        at = i;",
            "    }",
            "}",
            "var m = 0u;",
            f"switch bitcast<u32>(scene_rows[{where.replace('i', 'at', 1)}) >> 8u {{",
            *(f"    {case}" for case in cases),
            "}",
            "return vec2f(d, f32(m));",
        ],
    )
    return [leaf, whole, nearest]


def _indented(head: str, lines: Sequence[str]) -> str:
    return "\n".join([f"{head} {{", *(f"    {line}" for line in lines), "}"])


def _is_within(shape: Shape, spacing: Sequence[float], counts: Sequence[int]) -> bool:
    """Whether no copy reaches through its neighbours' cells, so that two on each axis are enough."""
    low, high = shape.box
    reach, several = np.maximum(-low, high), np.array(counts) > 1
    return bool((reach <= np.array(spacing))[several].all())


def _is_mirror(shape: Shape, axis: int, spacing: float) -> bool:
    """Whether a shape fits its cell, and is its own mirror image; by trial."""
    low, high = shape.box
    if max(-low[axis], high[axis]) > 0.5 * spacing * (1 + 1e-9):
        return False
    points = _trial(shape)
    mirrored = points.copy()
    mirrored[:, axis] *= -1
    return bool(np.allclose(shape(points), shape(mirrored), rtol=0, atol=1e-9))


def _trial(shape: Shape) -> Floats:
    low, high = (np.clip(np.nan_to_num(corner), -1e3, 1e3) for corner in shape.box)
    margin = 0.2 * (high - low) + 1e-3
    points: Floats = np.random.default_rng(0).uniform(low - margin, high + margin, (200, 3))
    return points


def _sector(node: Polar) -> tuple[Floats, float, bool] | None:
    """The axis' frame as a 4×4 matrix whose Z it is, the direction of the shape about it, and whether it fits a sector
    and is its own mirror image there; None where it reaches through its neighbours' sectors.
    """
    z = np.array(node.axis) / np.linalg.norm(node.axis)
    x = np.cross((0.0, 1.0, 0.0) if abs(z[1]) < 0.9 else (1.0, 0.0, 0.0), z)
    x /= np.linalg.norm(x)
    if abs(z[2]) == 1:
        x = np.array([1.0, 0.0, 0.0])
    frame = np.eye(4)
    frame[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    low, high = node.shape.box
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        return None
    corners = box_corners(low, high) @ frame[:3, :3]
    centre = corners.mean(axis=0)
    middle = math.atan2(centre[1], centre[0])
    turned = np.array([[math.cos(middle), math.sin(middle)], [-math.sin(middle), math.cos(middle)]]) @ corners[:, :2].T
    half = math.pi / node.number
    reach = np.abs(np.arctan2(turned[1], turned[0])).max()
    if turned[0].min() <= 0 or reach > 2 * half:
        return None
    points = _trial(node.shape)
    normal = frame[:3, :3] @ np.array([-math.sin(middle), math.cos(middle), 0.0])
    mirrored = points - 2 * np.outer(points @ normal, normal)
    fits = np.abs(turned[1]).max() <= math.hypot(*centre[:2]) * math.tan(half) * 1.02
    same = np.allclose(node.shape(points), node.shape(mirrored), rtol=0, atol=1e-9)
    return frame, middle, bool(fits and same)


def _leaves(shape: Shape) -> int:
    return sum(_leaves(child) for child in shape.children) if shape.children else 1
