'''A user's own WGSL as a shape.

>>> from tyndall import sdf
>>> @sdf.snippet(box=lambda radius, height: ((-radius, -radius, -height), (radius, radius, height)))
... def hex_prism(radius: float = 0.5, height: float = 0.25):
...     """A hexagonal prism (Quilez), ``radius`` to the middle of a side.
...
...     fn hex_prism(place: vec3f, radius: f32, height: f32) -> f32 {
...         let k = vec3f(-0.8660254, 0.5, 0.57735);
...         var p = abs(place);
...         p -= vec3f(2.0 * min(dot(k.xy, p.xy), 0.0) * k.xy, 0.0);
...         let side = length(p.xy - vec2f(clamp(p.x, -k.z * radius, k.z * radius), radius)) * sign(p.y - radius);
...         let d = vec2f(side, p.z - height);
...         return min(max(d.x, d.y), 0.0) + length(max(d, vec2f(0.0)));
...     }
...     """
>>> part = hex_prism(0.4).at(0, 1, 0) - sdf.sphere(0.3)

The function's parameters, with a default or :func:`~tyndall.gpu.params.param`, declare at most 8 numbers; they are
numbers or tuples of 2 to 4. Its WGSL is the docstring from the first ``fn``, ``const`` or ``struct`` on, or the text
that it returns. The *last* function of that text is the shape: ``fn name(p: vec3f, …) -> f32``, with a ``f32``,
``vec2f``, ``vec3f`` or ``vec4f`` for each parameter in order, or with one ``Primitive3D``, whose ``data[0]`` to
``data[7]`` are the numbers. With ``p: vec2f`` it is a shape in the plane. What a snippet may hold, and how it is kept
from doing harm, is told in :mod:`tyndall.sdf.sandbox`.

What cannot be known of a text must be declared: how fast its value changes (``lipschitz``), where it ends (``box``),
and whether it is the distance itself (``exact``) – or, where it is a bound only, how fast it grows at least outside of
the box (``growth``). A declaration that is wrong makes holes in the picture.

A snippet's types are checked when a device is there (:func:`validate`); its grammar and names at once.
'''

from __future__ import annotations

import ast
import atexit
import inspect
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, make_dataclass
from functools import cache, cached_property
from typing import Any, ClassVar, get_args, get_origin, get_type_hints
from weakref import WeakKeyDictionary

import numpy as np

from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError, check, fields_of, param
from tyndall.sdf.sandbox import ROUNDS, Admitted, Function, Origin, SnippetError, admit
from tyndall.sdf.shape import NUMBERS, Accuracy, Box, Floats, Primitive, Vec3

EXAMPLE = "fn sdf(p: vec3f, primitive: Primitive3D) -> f32"
_INF = math.inf
_EVERYWHERE: tuple[Vec3, Vec3] = ((-_INF, -_INF, -_INF), (_INF, _INF, _INF))
_WIDTHS = {"f32": 1, "vec2f": 2, "vec3f": 3, "vec4f": 4, "vec2<f32>": 2, "vec3<f32>": 3, "vec4<f32>": 4}
_LANES = ("a.x", "a.y", "a.z", "a.w", "b.x", "b.y", "b.z", "b.w")
_STRUCT = "Primitive3D"
_CHUNK = 1 << 20  # points of a dispatch
_OWNER = "sdf"


@dataclass(frozen=True)
class SnippetSource:
    """A text that has been admitted, under a name.

    Attributes:
        name: of the primitive, in JSON and in messages.
        text: WGSL.
        id: S5's number of the primitive, 32 or more; None until a file needs one.
        origin: where the text stands, for messages.
        oracle: the same function for numpy, ``oracle(points (N, 3), *numbers) -> (N,)``.

    Raises:
        SnippetError: the text is refused; see :mod:`tyndall.sdf.sandbox`.
    """

    name: str
    text: str
    id: int | None = field(default=None, compare=False, repr=False)
    origin: Origin = field(default=Origin("<snippet>"), compare=False, repr=False)
    oracle: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        self.admitted  # noqa: B018 - a refusal is told here, not when it is drawn

    @cached_property
    def admitted(self) -> Admitted:
        """The text after the sandbox."""
        admitted = admit(self.text, self.origin, given={_STRUCT: "the host's struct"}, example=EXAMPLE)
        main = admitted.functions[-1]
        place = main.parameters[0][1] if main.parameters else ""
        if main.result != "f32" or _WIDTHS.get(place) not in (2, 3):
            raise admitted.error(main.at, f"'{main.name}' is the shape, and that is {EXAMPLE}")
        types = [tp for _, tp in main.parameters[1:]]
        if types == [_STRUCT]:
            return admitted
        for name, tp in main.parameters[1:]:
            if tp not in _WIDTHS:
                raise admitted.error(main.at, f"'{name}' is {tp}; a number of a shape is f32, vec2f, vec3f or vec4f")
        if sum(_WIDTHS[tp] for tp in types) > NUMBERS:
            raise admitted.error(main.at, f"'{main.name}' has more than {NUMBERS} numbers")
        return admitted

    @property
    def main(self) -> Function:
        """The function that is the shape."""
        return self.admitted.functions[-1]

    @cached_property
    def dimension(self) -> int:
        """2 where its first parameter is a vec2f, else 3."""
        return _WIDTHS[self.main.parameters[0][1]]

    @cached_property
    def count(self) -> int:
        """How many numbers it takes."""
        types = [tp for _, tp in self.main.parameters[1:]]
        return NUMBERS if types == [_STRUCT] else sum(_WIDTHS[tp] for tp in types)

    @property
    def function(self) -> str:
        """The name of ``fn (p: vec3f, a: vec4f, b: vec4f) -> f32`` in :attr:`wesl`."""
        return self.admitted.entry

    @cached_property
    def wesl(self) -> str:
        """Its functions, without imports; two snippets' names never meet. The text's own lines come first."""
        a = self.admitted
        if self.count == NUMBERS and self.main.parameters[1:2] and self.main.parameters[1][1] == _STRUCT:
            numbers = [f"{a.prefix}{_STRUCT}(0, array<f32, 8>({', '.join(_LANES)}))"]
        else:
            numbers, at = [], 0
            for _, tp in self.main.parameters[1:]:
                lanes = _LANES[at : at + _WIDTHS[tp]]
                at += _WIDTHS[tp]
                numbers.append(lanes[0] if len(lanes) == 1 else f"{tp}({', '.join(lanes)})")
        place = "p" if self.dimension == 3 else "p.xy"
        call = f"{a.prefix}{self.main.name}({', '.join([place, *numbers])})"
        lines = [
            a.wesl.rstrip("\n"),
            f"struct {a.prefix}{_STRUCT} {{ id: i32, data: array<f32, 8> }}",
            f"var<private> {a.rounds}: u32 = {ROUNDS}u;",
            f"fn {a.entry}(p: vec3f, a: vec4f, b: vec4f) -> f32 {{",
            f"    {a.rounds} = select(0u, {ROUNDS}u, {a.rounds} > 0u);",  # who has turned so often turns no more
            f"    return clamp({call}, -1e30, 1e30);",
            "}",
        ]
        return "\n".join([*lines, ""])


@dataclass(frozen=True)
class Snippet(Primitive):
    """A leaf whose value is a user's WGSL function; made by :func:`snippet` or from JSON.

    Attributes:
        source: the text.
        values: its numbers, as many as its function takes.
        slope: the declared Lipschitz bound.
        low, high: corners of what is inside; ±inf where it has no end.
        growth: how fast the value grows at least outside of the box.
        exact: the value is the distance.
    """

    code: ClassVar[str] = ""
    untrusted: ClassVar[bool] = True
    source: SnippetSource
    values: tuple[float, ...] = ()
    slope: float = param(1.0, 1e-6, None, "Lipschitz bound")
    low: Vec3 = _EVERYWHERE[0]
    high: Vec3 = _EVERYWHERE[1]
    growth: float = param(1.0, 1e-6, 1e6, "least growth of the value outside of the box, per metre")
    exact: bool = param(False, doc="the value is the distance")

    def __post_init__(self) -> None:
        check(self)
        name = self.source.name
        values = tuple(float(v) for v in self.values)
        if self.source.main.parameters[1:2] and self.source.main.parameters[1][1] == _STRUCT:
            values += (0.0,) * (NUMBERS - len(values))
        if len(values) != self.source.count:
            raise ParameterError(f"{name}: {len(values)} numbers are given, and it takes {self.source.count}")
        if not all(abs(v) <= 1e30 for v in values):
            raise ParameterError(f"{name}: {values} are not finite numbers")
        low, high = (_corner(name, side, sign) for side, sign in ((self.low, -_INF), (self.high, _INF)))
        if self.source.dimension == 2:
            low, high = (*low[:2], -_INF), (*high[:2], _INF)
        if not all(a <= b for a, b in zip(low, high, strict=True)):
            raise ParameterError(f"{name}: the box's upper corner {high} is not above the lower {low}")
        for key, value in (("values", values), ("low", low), ("high", high), ("dimension", self.source.dimension)):
            object.__setattr__(self, key, value)

    @property
    def numbers(self) -> tuple[float, ...]:
        return self.values

    @property
    def wesl(self) -> str:
        """See :attr:`SnippetSource.wesl`."""
        return self.source.wesl

    @property
    def function(self) -> str:
        """See :attr:`SnippetSource.function`."""
        return self.source.function

    def distance(self, p: Floats) -> Floats:
        """By its oracle in float64, or else on a device in float32."""
        if self.source.oracle is not None:
            return np.asarray(self.source.oracle(p, *self.values), np.float64).reshape(len(p))
        return evaluate(_device(), self, p)

    @cached_property
    def lipschitz(self) -> float:
        return self.slope

    def extent(self, level: float) -> Box:
        return np.array(self.low) - level / self.growth, np.array(self.high) + level / self.growth

    @cached_property
    def accuracy(self) -> Accuracy:
        return "exact" if self.exact else "bound"


def _corner(name: str, corner: Sequence[float], missing: float) -> Vec3:
    try:
        found = tuple(missing if x is None else float(x) for x in corner)
    except (TypeError, ValueError):
        raise ParameterError(f"{name}: {corner} is no corner of a box") from None
    if len(found) == 2:
        found = (*found, missing)
    if len(found) != 3 or any(math.isnan(x) for x in found):
        raise ParameterError(f"{name}: {corner} is no corner of a box")
    return found[0], found[1], found[2]


# --- the decorator ------------------------------------------------------------------------------------------------

Bounded = tuple[Sequence[float], Sequence[float]]


class SnippetKind:
    """What :func:`snippet` makes of a function: a constructor of shapes with declared parameters."""

    def __init__(
        self,
        source: SnippetSource,
        parameters: type,
        box: Bounded | Callable[..., Bounded] | None,
        lipschitz: float | Callable[..., float],
        growth: float,
        exact: bool,
        doc: str,
    ) -> None:
        self.source, self.parameters = source, parameters
        self._box, self._lipschitz, self._growth, self._exact = box, lipschitz, growth, exact
        self.__name__, self.__doc__ = source.name, doc
        self.__signature__ = inspect.signature(parameters)

    def __call__(self, *args: Any, **kwargs: Any) -> Snippet:
        """The shape of these numbers.

        Raises:
            ParameterError: outside what is declared.
        """
        try:
            given = self.parameters(*args, **kwargs)
        except TypeError as error:
            message = re.sub(r"^.*?__init__\(\)", self.__name__, str(error))
            raise ParameterError(message) from None
        named = {f.name: getattr(given, f.name) for f in fields_of(self.parameters)}
        values = [x for value in named.values() for x in (value if isinstance(value, tuple) else (value,))]
        box, slope = self._told("box", self._box, named), self._told("lipschitz", self._lipschitz, named)
        try:
            low, high = _EVERYWHERE if box is None else (tuple(corner) for corner in box)
        except (TypeError, ValueError):
            raise ParameterError(f"{self.__name__}: box: {box!r} is not two corners") from None
        try:
            return Snippet(self.source, tuple(values), slope, low, high, self._growth, self._exact)
        except ParameterError as error:
            raise ParameterError(re.sub("^slope:", f"{self.__name__}: lipschitz:", str(error))) from None

    def _told(self, what: str, told: Any, named: Mapping[str, Any]) -> Any:
        """What is declared for these numbers."""
        if not callable(told):
            return told
        try:
            return told(**named)
        except TypeError as error:
            taken = ", ".join(named) or "nothing"
            raise ParameterError(f"{self.__name__}: {what}: not a function of {taken}: {error}") from None

    @property
    def bounds(self) -> dict[str, Any]:
        """What is declared of all its shapes: ``lipschitz``, ``box``, ``growth`` and ``exact``."""
        return {"lipschitz": self._lipschitz, "box": self._box, "growth": self._growth, "exact": self._exact}

    def __repr__(self) -> str:
        return f"<snippet {self.__name__}{self.__signature__}>"


def snippet(
    *,
    lipschitz: float | Callable[..., float] = 1.0,
    box: Bounded | Callable[..., Bounded] | None = None,
    growth: float = 1.0,
    exact: bool = False,
    distance: Callable[..., Any] | None = None,
    id: int | None = None,
) -> Callable[[Callable[..., Any]], SnippetKind]:
    """Make a function that holds WGSL a constructor of shapes; see the module.

    Args:
        lipschitz: bound of how fast the value changes, or a function of the parameters.
        box: lower and upper corner of what is inside, or a function of the parameters; none: it has no end.
        growth: how fast the value grows at least outside of the box, 1 where it is the distance.
        exact: the value is the distance.
        distance: the same for numpy, ``distance(points (N, 3), *numbers) -> (N,)``.
        id: its number in S5's JSON, 32 or more.

    Raises:
        SnippetError: the text is refused.
        ParameterError: the parameters are not what the text takes.
    """
    if id is not None and id < 32:
        raise ParameterError(f"id: {id} is below 32, and those are the built-in primitives'")

    def declare(function: Callable[..., Any]) -> SnippetKind:
        name = function.__name__
        parameters = _parameters(function)
        text, doc, literal = _text(function, parameters)
        source = SnippetSource(name, text, id, _origin(function, text, literal), distance)
        widths = [len(get_args(f.type)) if get_origin(f.type) is tuple else 1 for f in fields_of(parameters)]
        struct = [tp for _, tp in source.main.parameters[1:]] == [_STRUCT]
        taken = [_WIDTHS.get(tp, 0) for _, tp in source.main.parameters[1:]]
        if (sum(widths) > NUMBERS) if struct else (widths != taken):
            at = source.main.at
            told = ", ".join(f.name for f in fields_of(parameters)) or "nothing"
            raise source.admitted.error(at, f"'{source.main.name}' does not take what Python declares ({told})")
        return SnippetKind(source, parameters, box, lipschitz, growth, exact, doc)

    return declare


def kind_of(source: SnippetSource, *, lipschitz: float, box: Bounded | None, growth: float, exact: bool) -> SnippetKind:
    """The constructor of a snippet's shapes whose parameters are those of the text, as a file has it."""
    told = source.main.parameters[1:]
    if [tp for _, tp in told] == [_STRUCT]:
        fields: list[tuple[str, Any, Any]] = [(f"data{i}", float, param(0.0)) for i in range(NUMBERS)]
    else:
        types = [float if _WIDTHS[tp] == 1 else tuple[(float,) * _WIDTHS[tp]] for _, tp in told]  # type: ignore[misc]
        fields = [(name, tp, param(...)) for (name, _), tp in zip(told, types, strict=True)]
    name = re.sub(r"\W", "_", f"_{source.name}" if not source.name[:1].isalpha() else source.name)
    parameters = make_dataclass(name, fields, frozen=True, namespace={"__post_init__": check})
    return SnippetKind(source, parameters, box, lipschitz, growth, exact, source.name)


def _parameters(function: Callable[..., Any]) -> type:
    """A checked dataclass of a function's parameters."""
    hints = get_type_hints(function)
    fields: list[tuple[str, Any, Any]] = []
    for name, parameter in inspect.signature(function).parameters.items():
        default: Any = parameter.default
        tp = hints.get(name, float)
        if not isinstance(default, Field):
            default = param(... if default is inspect.Parameter.empty else default)
        if tp is not float and not (get_origin(tp) is tuple and get_args(tp) in [(float,) * n for n in (2, 3, 4)]):
            raise ParameterError(f"{function.__name__}: {name} is not a float or a tuple of 2 to 4")
        fields.append((name, tp, default))
    return make_dataclass(function.__name__, fields, frozen=True, namespace={"__post_init__": check})


_BEGIN = re.compile(r"^[ \t]*(?=(?:fn|const|struct)\b)", re.MULTILINE)


def _text(function: Callable[..., Any], parameters: type) -> tuple[str, str, str]:
    """The WGSL of a function, its documentation, and the Python text that the former is the end of."""
    ones = {f.name: 1.0 if f.type is float else (1.0,) * len(get_args(f.type)) for f in fields_of(parameters)}
    defaults = {f.name: f.default for f in fields_of(parameters) if f.default is not MISSING}
    returned = function(**{**ones, **defaults})
    doc = function.__doc__ or ""
    if isinstance(returned, str):
        return returned, inspect.cleandoc(doc), returned
    begin = _BEGIN.search(doc)
    if returned is not None or begin is None:
        raise ParameterError(f"{function.__name__}: neither its docstring nor what it returns is WGSL")
    return doc[begin.end() :], inspect.cleandoc(doc[: begin.start()]), doc


def _origin(function: Callable[..., Any], text: str, literal: str) -> Origin:
    """Where a text stands in the Python file; as a text of its own where that cannot be found."""
    code = function.__code__
    alone = Origin(f"<{function.__name__}>")
    try:
        lines, first = inspect.getsourcelines(function)
        file = "".join(inspect.findsource(function)[0])
        tree = ast.parse(file)
    except (OSError, TypeError, SyntaxError, IndexError):
        return alone
    starts = [0]
    for line in file.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    for node in ast.walk(tree):
        if not (isinstance(node, ast.Constant) and node.value == literal and first <= node.lineno < first + len(lines)):
            continue
        row = file[starts[node.lineno - 1] :]
        begin = starts[node.lineno - 1] + len(row.encode()[: node.col_offset].decode())
        quote = re.compile(r"[rRuU]?(\"\"\"|'''|\"|')").match(file, begin)
        if quote and file.startswith(literal, quote.end()):
            return Origin(code.co_filename, file, quote.end() + len(literal) - len(text))
    return alone


# --- on a device --------------------------------------------------------------------------------------------------


_VALIDATED: WeakKeyDictionary[Gpu, set[str]] = WeakKeyDictionary()


def known_to(gpu: Gpu) -> set[str]:
    """The functions whose types a device's driver has checked."""
    return _VALIDATED.setdefault(gpu, set())


def validate(gpu: Gpu, source: SnippetSource) -> None:
    """Let the driver check a snippet's types, alone; each text once for each device.

    Raises:
        SnippetError: with the place in the user's file.
    """
    known = known_to(gpu)
    if source.function in known:
        return
    check_text(gpu, source.admitted, source.wesl)
    known.add(source.function)


def check_text(gpu: Gpu, admitted: Admitted, wesl: str) -> None:
    """The same of a text that begins with the lines of an admitted snippet.

    Raises:
        SnippetError: with the place in the user's file.
    """
    if (found := gpu.check_wgsl(wesl)) is not None:
        line, column, message = found
        own = admitted.wesl.count("\n")
        at = admitted.source(line, column) if line <= own else admitted.functions[-1].at
        raise admitted.error(at, admitted.clean(message))


def evaluate(gpu: Gpu, shape: Snippet, p: Floats) -> Floats:
    """Values (N,) of a snippet at (N, 3) points, in float32 on a device.

    Raises:
        SnippetError: it does not compile.
    """
    validate(gpu, shape.source)
    text = f"{shape.wesl}fn ask_snippet(p: vec3f, a: vec4f, b: vec4f) -> f32 {{ return {shape.function}(p, a, b); }}\n"
    numbers = np.zeros(NUMBERS, np.float32)
    numbers[: len(shape.values)] = shape.values
    values = np.empty(len(p))
    for start in range(0, len(p), _CHUNK):
        points = np.zeros((len(p[start : start + _CHUNK]), 4), np.float32)
        points[:, :3] = p[start : start + _CHUNK]
        with (
            gpu.buffer("sdf.ask.points", points, owner=_OWNER, element="vec4f") as asked,
            gpu.buffer("sdf.ask.numbers", numbers, owner=_OWNER, element="vec4f") as given,
            gpu.buffer("sdf.ask.values", 4 * len(points), owner=_OWNER, element="f32") as answers,
        ):
            gpu.compute("sdf.ask", "package::sdf::ask", "ask").bind(
                ask_points=asked.read().telling(text, untrusted=True),
                ask_numbers=given,
                ask_values=answers.read_write(),
            ).dispatch(len(points))
            gpu.submit()
            values[start : start + _CHUNK] = gpu.read_buffer(answers).view(np.float32)[: len(points)]
            gpu.forget_groups()
    return values


@cache
def _device() -> Gpu:
    """A device for who asks a snippet in Python, opened once."""
    gpu = Gpu()
    atexit.register(gpu.close)
    return gpu


__all__ = [
    "EXAMPLE",
    "Snippet",
    "SnippetError",
    "SnippetKind",
    "SnippetSource",
    "evaluate",
    "snippet",
    "validate",
]
