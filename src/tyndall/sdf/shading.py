"""Fragment shaders as S5 has them: a user's function gives a surface its colour, a material gives the function numbers.

>>> from tyndall import sdf
>>> blend = FragmentShader(
...     "Blend Shader",
...     "fn shade(properties: FragmentProperties) -> vec3f { return mix(_Color1, _Color2, _Blend); }",
...     ("[float3] _Color1", "[float3] _Color2", "[float] [Range(0, 1)] _Blend"),
... )
>>> material = blend.material(_Color1=(0.5, 0.1, 0.5), _Color2=(0.2, 0.7, 0.6), _Blend=0.618)
>>> ball = sdf.sphere(0.5).material(material)

A shader is WGSL with a function ``shade``; its properties are in scope by their names. What it is told of the place is
in ``FragmentProperties``: ``world_position``, ``object_position`` (in the object's own space), ``world_normal``,
``ray_direction`` and ``ray_distance`` (in metres). Its colour is the surface's base colour, lit like any other; a
material that is not ``lit`` shows it as it is, as S5 does. Texts are admitted by :mod:`tyndall.sdf.sandbox`.

On the device a shader is a case of ``implicit_shade``, whose text :class:`Shadings` writes, and a material's numbers
stand in an array; a change of numbers compiles nothing.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError, nearest, param
from tyndall.scene.model import Material
from tyndall.sdf.sandbox import ROUNDS, Admitted, Origin, admit, is_free
from tyndall.sdf.snippets import check_text, known_to

EXAMPLE = "fn shade(properties: FragmentProperties) -> vec3f"
MOST_PROPERTIES = 64
_STRUCT = "FragmentProperties"
_MEMBERS = ("world_position", "object_position", "world_normal", "ray_direction")
_TYPE = re.compile(r"(float|int)([2-4]?)")
_ANNOTATED = re.compile(
    r"\s*\[\s*(?P<type>\w+)\s*\]\s*(?:\[\s*Range\s*\(\s*(?P<low>[^,()]+),(?P<high>[^,()]+)\)\s*\]\s*)?(?P<name>\w+)\s*"
)
_MOST_WHOLE = 1 << 24  # of a number that a float32 holds exactly

Value = float | tuple[float, ...]


@dataclass(frozen=True)
class Property:
    """A number or vector of a shader that a material chooses: S5's ``[float] [Range(0, 1)] _Blend``.

    Attributes:
        type: "float", "int", or one of these with 2, 3 or 4 after it.
        low, high: inclusive range of each component; None where there is none.
    """

    name: str
    type: str = "float"
    low: float | None = None
    high: float | None = None

    def __post_init__(self) -> None:
        if not _TYPE.fullmatch(self.type):
            raise ParameterError(f"{self.name}: '{self.type}' is not float or int, or one of them with 2, 3 or 4")
        if not is_free(self.name):
            raise ParameterError(f"'{self.name}' cannot be the name of a property")
        if self.low is not None and self.high is not None and not self.low <= self.high:
            raise ParameterError(f"{self.name}: the range {self.low:g} … {self.high:g} is empty")

    @classmethod
    def parse(cls, text: str) -> Property:
        """Of S5's annotation.

        Raises:
            ParameterError: another form.
        """
        match = _ANNOTATED.fullmatch(text)
        if match is None:
            raise ParameterError(f"{text!r} is not like '[float] [Range(0, 1)] _Name'")
        try:
            low, high = (None if match[side] is None else float(match[side]) for side in ("low", "high"))
        except ValueError:
            raise ParameterError(f"{text!r}: the range is not two numbers") from None
        return cls(match["name"], match["type"], low, high)

    @property
    def text(self) -> str:
        """S5's annotation."""
        limits = "" if self.low is None or self.high is None else f" [Range({self.low!r}, {self.high!r})]"
        return f"[{self.type}]{limits} {self.name}"

    @property
    def width(self) -> int:
        """Components."""
        return int(self.type[-1]) if self.type[-1].isdigit() else 1

    @property
    def is_whole(self) -> bool:
        return self.type.startswith("int")

    @property
    def wgsl(self) -> str:
        """Its type in WGSL."""
        scalar = "i32" if self.is_whole else "f32"
        return scalar if self.width == 1 else f"vec{self.width}<{scalar}>"

    def check(self, value: Any) -> tuple[float, ...]:
        """The components of a value.

        Raises:
            ParameterError: of another type or outside the range.
        """
        items = list(value) if isinstance(value, (tuple, list, np.ndarray)) else [value]
        numbers = all(isinstance(x, (int, float, np.number)) and not isinstance(x, bool) for x in items)
        if not numbers or len(items) != self.width:
            raise ParameterError(f"{self.name}: {value!r} is not {self.type}")
        for x in items:
            if not abs(x) <= 1e30 or (self.is_whole and (x != int(x) or abs(x) > _MOST_WHOLE)):
                raise ParameterError(f"{self.name}: {x!r} is not {'whole' if self.is_whole else 'finite'}")
            if (self.low is not None and x < self.low) or (self.high is not None and x > self.high):
                raise ParameterError(f"{self.name}: {x:g} is outside {self.low:g} … {self.high:g}")
        return tuple(float(x) for x in items)


@dataclass(frozen=True)
class FragmentShader:
    """A function that gives surfaces their colour; see the module.

    Attributes:
        name: by which materials refer to it.
        text: WGSL with ``fn shade(properties: FragmentProperties) -> vec3f``.
        properties: what a material chooses, as :class:`Property` or in S5's notation.
        origin: where the text stands, for messages.

    Raises:
        ParameterError: properties that are wrong.
        SnippetError: the text is refused.
    """

    name: str
    text: str
    properties: tuple[Property, ...] = ()
    origin: Origin = field(default=Origin("<shader>"), compare=False, repr=False)

    def __post_init__(self) -> None:
        told: Sequence[Any] = self.properties
        properties = tuple(Property.parse(p) if isinstance(p, str) else p for p in told)
        object.__setattr__(self, "properties", properties)
        names = [p.name for p in properties]
        if len(names) > MOST_PROPERTIES:
            raise ParameterError(f"properties: {len(names)}; a shader has at most {MOST_PROPERTIES}")
        for i, name in enumerate(names):
            if name in names[:i] or name in (_STRUCT, "shade"):
                raise ParameterError(f"properties[{i}]: '{name}' is taken")
        self.admitted  # noqa: B018 - a refusal is told here, not when it is drawn

    @cached_property
    def admitted(self) -> Admitted:
        """The text after the sandbox."""
        given = {_STRUCT: "the host's struct", **{p.name: f"a property of type {p.type}" for p in self.properties}}
        admitted = admit(self.text, self.origin, given=given, example=EXAMPLE)
        shade = next((f for f in admitted.functions if f.name == "shade"), None)
        if shade is None:
            raise admitted.error(0, f"there is no function '{EXAMPLE}'")
        if [tp for _, tp in shade.parameters] != [_STRUCT] or shade.result not in ("vec3f", "vec3<f32>"):
            raise admitted.error(shade.at, f"'shade' is {EXAMPLE}")
        return admitted

    @property
    def function(self) -> str:
        """The name of ``fn (at: u32, …the five of FragmentProperties) -> vec3f`` in :attr:`wesl`."""
        return self.admitted.entry

    @property
    def width(self) -> int:
        """How many numbers a material has for it."""
        return sum(p.width for p in self.properties)

    @cached_property
    def wesl(self) -> str:
        """Its functions, without imports, which read numbers by ``implicit_number(index: u32) -> f32``."""
        a, lines, at = self.admitted, [], 0
        for p in self.properties:
            lanes = [f"implicit_number(at + {at + i}u)" for i in range(p.width)]
            at += p.width
            scalar = [f"i32({lane})" if p.is_whole else lane for lane in lanes]
            lines.append(f"    {a.prefix}{p.name} = {p.wgsl}({', '.join(scalar)});")
        told = ", ".join(f"{name}: vec3f" for name in _MEMBERS)
        names = ", ".join((*_MEMBERS, "ray_distance"))
        return "\n".join(
            [
                a.wesl.rstrip("\n"),
                f"struct {a.prefix}{_STRUCT} {{ {told}, ray_distance: f32 }}",
                *(f"var<private> {a.prefix}{p.name}: {p.wgsl};" for p in self.properties),
                f"var<private> {a.rounds}: u32 = {ROUNDS}u;",
                f"fn {a.entry}(at: u32, {told}, ray_distance: f32) -> vec3f {{",
                *lines,
                f"    {a.rounds} = select(0u, {ROUNDS}u, {a.rounds} > 0u);",
                f"    let color = {a.prefix}shade({a.prefix}{_STRUCT}({names}));",
                "    return clamp(color, vec3f(0.0), vec3f(1e6));",
                "}",
                "",
            ]
        )

    def material(self, *, lit: bool = True, material: Material | None = None, **properties: Value) -> ShadedMaterial:
        """A material with this shader.

        Args:
            lit: the colour is lit as a base colour; else it is shown as it is.
            material: metalness, roughness and the rest; its base colour is for those who cannot run the shader.
            properties: a value for each property.

        Raises:
            ParameterError: a property that is missing, unknown or outside its range.
        """
        known = {p.name: p for p in self.properties}
        for name in properties:
            if name not in known:
                raise ParameterError(f"{name}: no such property of '{self.name}'{nearest(name, known)}")
        missing = [name for name in known if name not in properties]
        if missing:
            raise ParameterError(f"{missing[0]}: '{self.name}' needs it")
        values = tuple(x for p in self.properties for x in p.check(properties[p.name]))
        base = {} if material is None else {name: getattr(material, name) for name in material.__dataclass_fields__}
        return ShadedMaterial(**base, shader=self, values=values, lit=lit)


@dataclass(frozen=True, kw_only=True)
class ShadedMaterial(Material):
    """A material whose colour a fragment shader gives; see :meth:`FragmentShader.material`.

    Attributes:
        shader: the function.
        values: its numbers, the components of its properties in order.
        lit: the colour is lit as a base colour, or else shown as it is.
    """

    shader: FragmentShader
    values: tuple[float, ...] = ()
    lit: bool = param(True, doc="the colour is lit; else it is shown as it is")

    def __post_init__(self) -> None:
        super().__post_init__()
        values = tuple(float(v) for v in self.values)
        object.__setattr__(self, "values", values)
        if len(values) != self.shader.width:
            raise ParameterError(f"values: {len(values)}; '{self.shader.name}' takes {self.shader.width}")
        for p, value in zip(self.shader.properties, self.grouped, strict=True):
            p.check(value)

    @property
    def grouped(self) -> list[tuple[float, ...]]:
        """Its numbers by property."""
        found, at = [], 0
        for p in self.shader.properties:
            found.append(self.values[at : at + p.width])
            at += p.width
        return found


def shines(material: Material) -> bool:
    """Whether a surface of it emits light."""
    return any(material.emissive) or not getattr(material, "lit", True)


class Shadings:
    """The shaders of some materials, numbered as they come, with their numbers in one array.

    Args:
        like: others, whose shaders' numbers it begins with.

    Attributes:
        version: grows with every new shader: programs that know fewer must be made anew.
    """

    def __init__(self, like: Shadings | None = None) -> None:
        self._shaders: dict[FragmentShader, int] = dict(like._shaders) if like else {}
        self._places: dict[tuple[float, ...], int] = {}
        self._numbers: list[float] = []
        self.version: int = like.version if like else 0

    def of(self, material: Material) -> tuple[int, int]:
        """(number of its shader or −1, where its numbers begin in :attr:`numbers`)."""
        if not isinstance(material, ShadedMaterial):
            return -1, 0
        if material.shader not in self._shaders:
            self._shaders[material.shader] = len(self._shaders)
            self.version += 1
        if material.values not in self._places:
            self._places[material.values] = len(self._numbers)
            self._numbers += material.values
        return self._shaders[material.shader], self._places[material.values]

    @property
    def shaders(self) -> tuple[FragmentShader, ...]:
        return tuple(self._shaders)

    @property
    def is_trusted(self) -> bool:
        """Whether there are none: each is a user's code."""
        return not self._shaders

    @property
    def numbers(self) -> NDArray[np.float32]:
        """(n,) float32, n ≥ 1."""
        return np.array(self._numbers or [0.0], np.float32)

    def wesl(self) -> str:
        """Text for the bindings module: ``implicit_shade``, which needs ``implicit_number(index: u32) -> f32``.

        ``fn implicit_shade(shader: u32, numbers_at: u32, world_position: vec3f, object_position: vec3f, world_normal:
        vec3f, ray_direction: vec3f, ray_distance: f32) -> vec3f`` gives the colour; black for a shader that is none.
        """
        told = ", ".join(f"{name}: vec3f" for name in _MEMBERS)
        names = ", ".join((*_MEMBERS, "ray_distance"))
        cases = [f"case {i}u: {{ return {s.function}(numbers_at, {names}); }}" for s, i in self._shaders.items()]
        body = f"switch shader {{ {' '.join(cases)} default: {{ return vec3f(0.0); }} }}" if cases else _BLACK
        head = f"fn implicit_shade(shader: u32, numbers_at: u32, {told}, ray_distance: f32) -> vec3f"
        return "\n".join([*dict.fromkeys(s.wesl for s in self._shaders), f"{head} {{ {body} }}"])

    def validate(self, gpu: Gpu) -> None:
        """Let the driver check each shader alone.

        Raises:
            SnippetError: with the place in the user's file.
        """
        for shader in self._shaders:
            validate(gpu, shader)


_BLACK = "return vec3f(0.0);"
_NUMBERS = "fn implicit_number(i: u32) -> f32 { return f32(i); }\n"


def validate(gpu: Gpu, shader: FragmentShader) -> None:
    """Let the driver check a shader's types, alone; each text once for each device.

    Raises:
        SnippetError: with the place in the user's file.
    """
    known = known_to(gpu)
    if shader.function not in known:
        check_text(gpu, shader.admitted, shader.wesl + _NUMBERS)
        known.add(shader.function)


def described(material: ShadedMaterial) -> Mapping[str, tuple[float, ...]]:
    """A material's numbers by the names of its shader's properties."""
    return dict(zip((p.name for p in material.shader.properties), material.grouped, strict=True))


__all__ = ["EXAMPLE", "FragmentShader", "Property", "ShadedMaterial", "Shadings", "described", "shines", "validate"]
