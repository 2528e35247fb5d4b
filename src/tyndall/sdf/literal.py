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
- smooth unions of the polynomial kind are written as ``min(a, b) − max(k − |a − b|, 0)² / 4k``, which is the same as
  S5's form, by pairs in the same order as in :class:`~tyndall.sdf.shape.Combination`.

The text declares, and a shader that has it among its bindings may import:

- ``scene_distance(p: vec3f) -> f32``, in the world;
- ``scene_material(p: vec3f) -> u32``, the number of the material of what is nearest;
- ``scene_surface(index: u32) -> SceneSurface``, that material.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tyndall.gpu.params import ParameterError
from tyndall.scene.model import Implicit, Material
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
    """

    text: str
    materials: tuple[Material, ...]


def literal(implicits: Sequence[Implicit]) -> Literal:
    """Write the code of objects that are joined by a hard union.

    Raises:
        ParameterError: no object, or a node that has no code.
    """
    if not implicits:
        raise ParameterError("implicits: none are given")
    materials: dict[Material, int] = {}
    imports: set[tuple[str, str]] = set()
    blends: set[str] = set()
    bodies = []
    for tracked in (False, True):
        writer = _Writer(materials, imports, blends, tracked)
        values = [writer.object(implicit) for implicit in implicits]
        bodies.append((writer, writer.pairs(values, "union", 0.0, "polynomial")))
    (plain, distance), (tracked_writer, found) = bodies
    parts = [
        *(f"import package::sdf::{module}::{{{name}}};" for module, name in sorted(imports)),
        _STRUCT,
        *(_BLENDS[blend] for blend in sorted(blends)),
        _function("scene_distance", "f32", [*plain.lines, f"return {plain.text(distance)};"]),
        _function("scene_material", "u32", _needed([*tracked_writer.lines, f"return {found.material};"])),
        _surfaces(tuple(materials)),
    ]
    return Literal("\n".join(parts) + "\n", tuple(materials))


def _function(name: str, result: str, lines: Sequence[str]) -> str:
    return "\n".join([f"fn {name}(p: vec3f) -> {result} {{", *(f"    {line}" for line in lines), "}"])


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


class _Writer:
    """The body of one function."""

    def __init__(
        self, materials: dict[Material, int], imports: set[tuple[str, str]], blends: set[str], tracked: bool
    ) -> None:
        self.lines: list[str] = []
        self._materials, self._imports, self._blends, self._tracked = materials, imports, blends, tracked
        self._places: dict[tuple[str, bytes], str] = {}
        self._count = 0

    def object(self, implicit: Implicit) -> _Value:
        shape: Any = implicit.shape
        placed = shape.transform(implicit.transform)
        return self._node(placed, _Place("p", np.eye(4)), implicit.material)

    def _number_of(self, material: Material) -> str:
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
        module = getattr(node, "module", None)
        if module is None:
            module = "modifiers" if isinstance(node, Modifier) else "solids" if node.dimension == 3 else "profiles"
        alias = f"{module}_{name}"
        self._imports.add((module, f"{name} as {alias}"))
        return alias

    def _node(self, node: Shape, place: _Place, material: Material) -> _Value:
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
        copies = getattr(node, "copies", None)
        if copies is not None:
            return self.pairs([self._node(copy, place, material) for copy in copies()], "union", 0.0, "polynomial")
        raise ParameterError(f"{type(node).__name__} has no literal code")

    def _modifier(self, node: Modifier, place: _Place, material: Material) -> _Value:
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

    def _transformed(self, node: Transformed, place: _Place, material: Material) -> _Value:
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

    def _combination(self, node: Combination, place: _Place, material: Material) -> _Value:
        values = [self._node(shape, place, material) for shape in node.shapes]
        how = node.smooth, node.blend
        if node.operation != "subtraction" or len(values) == 1:
            return self.pairs(values, node.operation, *how)
        first, *rest = values
        taken = self.pairs(rest, "union", *how)  # max over −d is −(min over d), smooth ones too
        return self._pair(first, _Value(taken.name, -taken.factor, taken.material), "subtraction", *how)

    def pairs(self, values: Sequence[_Value], operation: str, smooth: float, blend: str) -> _Value:
        """Neighbours by pairs until one is left, as :class:`Combination` has it."""
        values = list(values)
        while len(values) > 1:
            done = [self._pair(a, b, operation, smooth, blend) for a, b in zip(values[::2], values[1::2], strict=False)]
            values = done + ([values[-1]] if len(values) % 2 else [])
        return values[0]

    def _pair(self, a: _Value, b: _Value, operation: str, smooth: float, blend: str) -> _Value:
        least = operation == "union"
        if self._tracked and a.material != b.material:
            a, b = self._held(a), self._held(b)
        if smooth == 0:
            result = f"{'min' if least else 'max'}({self.text(a)}, {self.text(b)})"
        else:
            self._blends.add(blend)
            signed = [self.text(v if least else _Value(v.name, -v.factor)) for v in (a, b)]
            given = f"{number(smooth)}, {number(_SHARES[blend](smooth))}"
            result = f"{'' if least else '-'}scene_{blend}({', '.join(signed)}, {given})"
        material = a.material
        if self._tracked and a.material != b.material and operation != "subtraction":
            nearer = f"{b.name} {'<' if least else '>'} {a.name}"
            material = self._let("m", f"select({a.material}, {b.material}, {nearer})")
        return _Value(self._let("d", result), 1.0, material)


def _leaves(shape: Shape) -> int:
    return sum(_leaves(child) for child in shape.children) if shape.children else 1
