"""What a shape is: an immutable expression whose value at a point is a signed distance in metres, negative inside.

>>> from tyndall.sdf import box, cylinder, sphere, X
>>> part = sphere(1) & box(1.5) - cylinder(0.5).orient(X)
>>> part([[0, 0, 0], [2, 0, 0]])
array([0.5 , 1.25])

A shape is a tree of nodes of seven kinds, each a frozen dataclass:

- :class:`Primitive`: a leaf. A function of the place and up to 8 numbers, in WESL (``solids.wesl``, ``profiles.wesl``)
  for the device, and in numpy for :meth:`Shape.__call__`, the oracle of the tests.
- :class:`Modifier`: one child, whose place is changed before (*enter*) or whose value after (*leave*) it is asked:
  rounding, shells, extrusion, twist … ``modifiers.wesl`` has both for the device.
- :class:`Combination`: several children, by union, intersection or subtraction, hard or smooth.
- :class:`Transformed`: one child, placed by an affine transform.
- :class:`Repetition`: one child, many times.
- :class:`Painted` gives what is in it a material; :class:`Named` gives it a name by which it can be moved.

What each node says of itself it says by analysis, never by sampling:

- ``lipschitz``: a bound L of how fast the value changes, |f(p) − f(q)| ≤ L·|p − q|. A step of |f|/L along a ray meets
  no surface (Hart 1996), and what differs by more than L allows can be left out of a cell (Barbier et al. 2025).
- ``extent(level)``: lower and upper corner of all places whose value is at most ``level``, infinite where they have no
  end; ``box`` is that of what is inside. (A level above 0 is what rounding and smooth unions add to a shape.)
- ``accuracy``: "exact" is the distance itself everywhere; "outside" is exact where it is positive; "bound" only never
  says more than the distance (after division by L).

Two-dimensional shapes (:attr:`Shape.dimension` 2) lie in the plane of x and y, and become solid by
:meth:`Shape.extrude` and :meth:`Shape.revolve`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tyndall.gpu.params import ParameterError, check, fields_of, param
from tyndall.scene.model import Material, Mesh

if TYPE_CHECKING:
    from tyndall.sdf.slices import Slice

Floats = NDArray[np.float64]
Box = tuple[Floats, Floats]
Vec3 = tuple[float, float, float]
Accuracy = Literal["exact", "outside", "bound"]
Operation = Literal["union", "intersection", "subtraction"]
Blend = Literal["polynomial", "exponential", "root"]

NUMBERS = 8  # of a primitive or modifier, as S5 has it
MOST_DEEP = 240  # nodes within nodes: what walks an expression calls itself, some times a node
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


class Shape:
    """A node of an expression of signed distances; see the module.

    Attributes:
        dimension: 3, or 2 for a shape in the plane of x and y.
    """

    dimension: int = 3

    def __post_init__(self) -> None:
        check(self)

    def __call__(self, points: ArrayLike) -> Floats:
        """Signed distances at points, on the CPU, in double precision.

        Args:
            points: (N, 3) in metres; (N, 2) do for a shape in the plane.

        Returns:
            (N,) in metres, negative inside.

        Raises:
            ParameterError: another shape of array.
        """
        try:
            p = np.asarray(points, np.float64)
        except (TypeError, ValueError):
            raise ParameterError(f"points: not an array of numbers of shape (count, {self.dimension})") from None
        if p.ndim != 2 or p.shape[1] not in ((2, 3) if self.dimension == 2 else (3,)):
            raise ParameterError(f"points: shape {p.shape} is not (count, {self.dimension})")
        if p.shape[1] == 2:
            p = np.concatenate([p, np.zeros((len(p), 1))], axis=1)
        return self.distance(p)

    def distance(self, p: Floats) -> Floats:
        """As :meth:`__call__`, of (N, 3) float64."""
        raise NotImplementedError

    @property
    def children(self) -> tuple[Shape, ...]:
        """The nodes below this one."""
        return ()

    @cached_property
    def lipschitz(self) -> float:
        """L ≥ how fast the value changes with the place; see the module."""
        raise NotImplementedError

    @cached_property
    def box(self) -> Box:
        """Lower and upper corner (3,) of what is inside; ±inf where it has no end. In the plane, z is ±inf."""
        return self.extent(0.0)

    def extent(self, level: float) -> Box:
        """The same of all places where the value is at most ``level`` ≥ 0: a box that holds them, if not the least."""
        raise NotImplementedError

    @cached_property
    def accuracy(self) -> Accuracy:
        """What the value is of the distance; see the module."""
        raise NotImplementedError

    @cached_property
    def count(self) -> int:
        """Nodes of the expression, this one and all below."""
        return 1 + sum(child.count for child in self.children)

    @cached_property
    def depth(self) -> int:
        """Nodes on the longest way down."""
        return 1 + max((child.depth for child in self.children), default=0)

    # --- combining ---

    def __or__(self, other: Shape) -> Shape:
        return union(self, other)

    def __and__(self, other: Shape) -> Shape:
        return intersection(self, other)

    def __sub__(self, other: Shape) -> Shape:
        return subtraction(self, other)

    # --- placing ---

    def at(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Shape:
        """Moved by (x, y, z) metres."""
        matrix = np.eye(4)
        try:
            matrix[:3, 3] = x, y, z
        except (TypeError, ValueError):
            hint = "; a tuple is given as .at(*place)" if isinstance(x, Iterable) and not isinstance(x, str) else ""
            raise ParameterError(f"at: {(x, y, z)} are not three numbers{hint}") from None
        if not np.isfinite(matrix).all():
            raise ParameterError(f"at: {(x, y, z)} are not finite numbers")
        return self.transform(matrix)

    def rotate(self, angle: float, axis: Sequence[float] = Z) -> Shape:
        """Turned about an axis through 0 by an angle in radians, right-handed."""
        return self.transform(rotation(angle, axis))

    def orient(self, axis: Sequence[float]) -> Shape:
        """Turned so that its own +Z points along ``axis``."""
        to = unit(axis)
        turn = np.cross(Z, to)
        sine = float(np.linalg.norm(turn))
        if sine < 1e-12:
            return self if to[2] > 0 else self.rotate(math.pi, X)
        return self.rotate(math.atan2(sine, float(to[2])), tuple(turn / sine))

    def scale(self, factor: float | Sequence[float]) -> Shape:
        """Enlarged about 0 by one factor, or by one for each axis; distances stay true under one factor."""
        try:
            factors = np.broadcast_to(np.asarray(factor, np.float64), 3)
        except (TypeError, ValueError):
            raise ParameterError(f"factor: {factor!r} is not one number or three") from None
        if not (np.isfinite(factors).all() and (np.abs(factors) > 1e-12).all()):
            raise ParameterError(f"factor: {factor!r} is no finite enlargement above 0")
        return self.transform(np.diag([*factors, 1.0]))

    def transform(self, matrix: ArrayLike) -> Shape:
        """Placed by an affine transform, 4×4 row-major for column vectors. It must have an inverse."""
        m = np.asarray(matrix, np.float64)
        if m.shape != (4, 4):
            raise ParameterError(f"matrix: shape {m.shape} is not (4, 4)")
        shape: Shape = self
        if isinstance(self, Transformed):
            m, shape = m @ self.placement, self.shape
        return Transformed(shape, tuple(tuple(float(x) for x in row) for row in m))

    # --- one dimension more ---

    def extrude(self, height: float) -> Shape:
        """A flat shape made solid along Z, around its plane; see :class:`tyndall.sdf.modifiers.Extrude`."""
        return _modified("Extrude", self, height)

    def revolve(self, offset: float = 0.0) -> Shape:
        """A flat shape turned about its own Y, moved away from it by ``offset``; what has x > 0 is used; see
        :class:`tyndall.sdf.modifiers.Revolve`."""
        return _modified("Revolve", self, offset)

    # --- changing ---

    def round(self, radius: float) -> Shape:
        """The surface moved outwards, so that edges become round; see :class:`tyndall.sdf.modifiers.Round`."""
        return _modified("Round", self, radius)

    def shell(self, thickness: float) -> Shape:
        """Only a sheet along the surface, half of it to each side; see :class:`tyndall.sdf.modifiers.Shell`."""
        return _modified("Shell", self, thickness)

    def elongate(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Shape:
        """Cut at 0 and pulled apart by these lengths; see :class:`tyndall.sdf.modifiers.Elongate`."""
        return _modified("Elongate", self, (x, y, z))

    def displace(self, amplitude: float, wavelength: float) -> Shape:
        """With regular bumps; see :class:`tyndall.sdf.modifiers.Displace`."""
        return _modified("Displace", self, amplitude, wavelength)

    def noise(self, amplitude: float, step: float, seed: int = 0, octaves: int = 1) -> Shape:
        """With irregular bumps; see :class:`tyndall.sdf.modifiers.Noise`."""
        return _modified("Noise", self, amplitude, step, seed, octaves)

    def twist(self, rate: float) -> Shape:
        """Turned about Z by ``rate`` radians per metre of z; see :class:`tyndall.sdf.modifiers.Twist`."""
        return _modified("Twist", self, rate)

    def bend(self, rate: float) -> Shape:
        """Turned about Z by ``rate`` radians per metre of x; see :class:`tyndall.sdf.modifiers.Bend`."""
        return _modified("Bend", self, rate)

    def mirror(self, axes: str = "x") -> Shape:
        """What is on the positive side of the named axes, on both; see :class:`tyndall.sdf.modifiers.Mirror`."""
        return _modified("mirror", self, axes)

    # --- many times ---

    def repeat(
        self,
        spacing: float | Sequence[float],
        count: int | Sequence[int] | None = None,
        *,
        mirrored: bool = False,
    ) -> Shape:
        """Copies along X, Y and Z, around 0.

        Args:
            spacing: between copies, one or three; 0 on an axis that has none.
            count: copies on each axis, one or three; None: without end.
            mirrored: every second one is a mirror image; without end only.

        Returns:
            A :class:`tyndall.sdf.repetition.Repeated`, ``RepeatedForever`` or ``MirroredForever``.
        """
        from tyndall.sdf import repetition

        return repetition.repeat(self, spacing, count, mirrored)

    def polar(self, count: int, axis: Sequence[float] = Z) -> Shape:
        """``count`` copies turned about an axis through 0; see :class:`tyndall.sdf.repetition.Polar`."""
        from tyndall.sdf import repetition

        unit(axis)
        return repetition.Polar(self, count, (axis[0], axis[1], axis[2]))

    def moved(self, moves: Mapping[str, Iterator[Floats]]) -> Shape:
        """The same with its named parts moved from where they stand, in the space that holds them.

        Args:
            moves: by name, 4×4 transforms; each part takes the next, parts before their own parts, in order.
        """
        if not self.children:
            return self
        step = next(moves[self.name]) if isinstance(self, Named) and self.name in moves else None
        made = [child.moved(moves) for child in self.children]
        shape: Shape = self
        if any(new is not old for new, old in zip(made, self.children, strict=True)):
            shape = replace(self, **_with_children(self, made))  # type: ignore[type-var]
        return shape if step is None else shape.transform(step)

    def edited(self, name: str, changes: Mapping[str, Any]) -> Shape:
        """The same with other parameters of the primitives of a name."""
        return self._edited(name, changes, False)

    def _edited(self, name: str, changes: Mapping[str, Any], inside: bool) -> Shape:
        if not self.children:
            return replace(self, **changes) if inside else self  # type: ignore[type-var]
        within = inside or (isinstance(self, Named) and self.name == name)
        made = [child._edited(name, changes, within) for child in self.children]
        if all(new is old for new, old in zip(made, self.children, strict=True)):
            return self
        return replace(self, **_with_children(self, made))  # type: ignore[type-var]

    # --- showing ---

    def to_mesh(
        self,
        resolution: int = 64,
        *,
        bounds: tuple[Sequence[float], Sequence[float]] | None = None,
        material: Material | None = None,
    ) -> Mesh:
        """Triangles of the surface; see :func:`tyndall.sdf.meshing.to_mesh`."""
        from tyndall.sdf import meshing

        return meshing.to_mesh(self, resolution, bounds=bounds, material=material)

    def show_slice(
        self,
        *,
        x: float | None = None,
        y: float | None = None,
        z: float | None = None,
        size: float | None = None,
        pixels: int = 360,
    ) -> Slice:
        """A picture of the values in a plane; see :func:`tyndall.sdf.slices.show_slice`."""
        from tyndall.sdf import slices

        return slices.show_slice(self, x=x, y=y, z=z, size=size, pixels=pixels)

    def show_gradient(
        self,
        *,
        x: float | None = None,
        y: float | None = None,
        z: float | None = None,
        size: float | None = None,
        pixels: int = 360,
    ) -> Slice:
        """A picture of how fast the values change in a plane; see :func:`tyndall.sdf.slices.show_gradient`."""
        from tyndall.sdf import slices

        return slices.show_gradient(self, x=x, y=y, z=z, size=size, pixels=pixels)

    # --- describing ---

    def material(self, material: Material) -> Shape:
        """With this material wherever a part has none of its own."""
        return Painted(self, material)

    def named(self, name: str) -> Shape:
        """With a name, by which it can be moved once it is on the device. Several shapes may share a name."""
        return Named(self, name)


def _with_children(shape: Shape, children: Sequence[Shape]) -> dict[str, Any]:
    """What :func:`~dataclasses.replace` gives a node to have these children."""
    return {"shapes": tuple(children)} if isinstance(shape, Combination) else {"shape": children[0]}


def _modified(kind: str, *arguments: Any) -> Shape:
    """A node of a module that imports this one."""
    from tyndall.sdf import modifiers

    shape: Shape = getattr(modifiers, kind)(*arguments)
    return shape


def rotation(angle: float, axis: Sequence[float]) -> Floats:
    """4×4: a right-handed turn by ``angle`` radians about ``axis`` (Rodrigues 1840)."""
    x, y, z = unit(axis)
    if not isinstance(angle, (int, float, np.number)) or not math.isfinite(angle):
        raise ParameterError(f"angle: {angle!r} is no finite number")
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    matrix = np.eye(4)
    matrix[:3, :3] += math.sin(angle) * k + (1 - math.cos(angle)) * (k @ k)
    matrix[np.abs(matrix) < 1e-15] = 0.0  # a quarter turn of what has no end on one axis gives it none on another
    return matrix


def unit(axis: Sequence[float]) -> Floats:
    """(3,): a direction at length 1.

    Raises:
        ParameterError: not three finite numbers, or all of them 0.
    """
    try:
        to = np.asarray(axis, np.float64)
    except (TypeError, ValueError):
        to = np.zeros(0)
    length = float(np.linalg.norm(to))
    if to.shape != (3,) or not 0 < length < math.inf:
        raise ParameterError(f"axis: {axis!r} is no direction")
    return to / length


def of_shape(shape: Any) -> int:
    """The dimension of what must be a shape that a node can have below it.

    Raises:
        ParameterError: it is something else, or too deep.
    """
    if not isinstance(shape, Shape):
        raise ParameterError(f"shape: {shape!r} is no shape")
    if shape.depth >= MOST_DEEP:
        raise ParameterError(f"shape: nodes within nodes, more than {MOST_DEEP}; union(a, b, c, …) takes many at once")
    return shape.dimension


def _numbers(node: Shape) -> tuple[float, ...]:
    """The declared parameters of a node in order, tuples flat."""
    flat: list[float] = []
    for f in fields_of(type(node)):
        value = getattr(node, f.name)
        flat.extend(float(v) for v in (value if isinstance(value, tuple) else (value,)))
    return tuple(flat)


# --- kinds of nodes -----------------------------------------------------------------------------------------------


class Primitive(Shape):
    """A leaf: a function of the place and at most :data:`NUMBERS` numbers.

    A subclass is a frozen dataclass of declared parameters with :meth:`Shape.distance`, :meth:`Shape.extent` and what
    differs from "exact, L = 1". Its WESL function is ``fn CODE(p: vec3f, a: vec4f, b: vec4f) -> f32`` in
    :attr:`module`; ``a`` and ``b`` hold :attr:`numbers`.

    Attributes:
        code: the name of that function.
        module: the WESL module that it is in.
        measured: all its lengths are parameters in metres: it is enlarged by enlarging them.
        places: which of them are places, of what is round about these: it is turned by turning them; None: it is not.
    """

    code: ClassVar[str]
    module: ClassVar[str] = "package::sdf::solids"
    measured: ClassVar[bool] = False
    places: ClassVar[tuple[str, ...] | None] = None

    @property
    def payload(self) -> NDArray[np.float32] | None:
        """More numbers than 8, (N,), which the function reads from ``implicit_slots`` by fours.

        Where there are any, ``a.x`` is the index of their first slot on the device, whatever the first of
        :attr:`numbers` is. The same array of several shapes is there once.
        """
        return None

    @property
    def numbers(self) -> tuple[float, ...]:
        """What the WESL function gets, at most 8; the declared parameters in order unless told otherwise."""
        return _numbers(self)

    def similar(self, turn: Floats, size: float) -> Primitive | None:
        """Itself turned about 0 by an orthogonal 3×3 and enlarged; None where parameters cannot say that."""
        turns = bool(np.abs(turn - np.eye(3)).max() > 1e-12)
        if not self.measured or (turns and self.places is None):
            return None
        changes: dict[str, Any] = {}
        for f in fields_of(type(self)):
            if f.param.unit == "m":
                value = np.asarray(getattr(self, f.name), np.float64)
                made = size * (turn @ value if turns and f.name in (self.places or ()) else value)
                changes[f.name] = tuple(made.tolist()) if made.ndim else float(made)
        try:
            whole: Any = self
            similar: Primitive = replace(whole, **changes)
            return similar
        except ParameterError:  # smaller than it may be
            return None

    @property
    def corners(self) -> Box:
        """The least box of what is inside, where the values are distances; others override :meth:`extent`."""
        raise NotImplementedError

    def extent(self, level: float) -> Box:
        low, high = self.corners
        return low - level, high + level

    @cached_property
    def lipschitz(self) -> float:
        return 1.0

    @cached_property
    def accuracy(self) -> Accuracy:
        return "exact"


class Modifier(Shape):
    """One child whose place is changed before it is asked, or its value after.

    A subclass is a frozen dataclass whose first field is ``shape``, the child, and whose declared parameters follow.
    In WESL (``package::sdf::modifiers``) it is ``fn CODE_enter(p, a, b) -> vec3f`` where it :attr:`warps`, and
    ``fn CODE_leave(d: f32, p: vec3f, a, b) -> f32`` where it :attr:`adjusts`; p of the latter is the place before
    *enter*.

    Attributes:
        code: the name of these functions.
        module: the WESL module that they are in.
        warps, adjusts: which of them it has.
        placed: whether *leave* looks at the place.
        takes, gives: the dimension of the child that it must have, and what it makes of it; None: as the child's.
        continuous: whether nearby places enter near each other. Where they do not, the bound holds for the union that
            the node is part of (:class:`tyndall.sdf.repetition.RepeatedForever`) and for no part of it.
        stretch: how much faster places change inside than outside: a Lipschitz bound of *enter*.
    """

    code: ClassVar[str]
    module: ClassVar[str] = "package::sdf::modifiers"
    warps: ClassVar[bool] = False
    adjusts: ClassVar[bool] = False
    placed: ClassVar[bool] = True
    takes: ClassVar[int | None] = None
    gives: ClassVar[int | None] = None
    continuous: ClassVar[bool] = True
    shape: Shape

    def __post_init__(self) -> None:
        check(self)
        given = of_shape(self.shape)
        if self.takes not in (None, given):
            raise ParameterError(
                f"{self.code}: {type(self.shape).__name__} is {'solid' if given == 3 else 'flat'}; "
                f"this is for {'solid' if self.takes == 3 else 'flat'} shapes"
            )
        object.__setattr__(self, "dimension", self.gives or given)

    @property
    def children(self) -> tuple[Shape, ...]:
        return (self.shape,)

    @property
    def numbers(self) -> tuple[float, ...]:
        """What the WESL functions get, at most 8."""
        return _numbers(self)

    def enter(self, p: Floats) -> Floats:
        """(N, 3) places that the child is asked at."""
        return p

    def leave(self, d: Floats, p: Floats) -> Floats:
        """(N,) values from the child's, at the places before :meth:`enter`."""
        return d

    def distance(self, p: Floats) -> Floats:
        return self.leave(self.shape.distance(self.enter(p)), p)

    @cached_property
    def stretch(self) -> float:
        return 1.0

    @cached_property
    def lipschitz(self) -> float:
        return self.shape.lipschitz * self.stretch


@dataclass(frozen=True)
class Combination(Shape):
    """Several shapes as one.

    Hard ones are the least or greatest value (n-ary). Smooth ones are taken by pairs, in a balanced tree in the given
    order; ``smooth`` is the width k in metres over which two surfaces become one:

    - "polynomial": S5's ``h = clamp(0.5 + 0.5 (d2 − d1)/k, 0, 1)``, ``mix(d2, d1, h) − k h (1 − h)``. Nothing changes
      where the values differ by more than k.
    - "exponential": ``−k log2(2^(−d1/k) + 2^(−d2/k))``.
    - "root": ``(d1 + d2 − sqrt((d1 − d2)² + k²)) / 2``.

    All three are 1-Lipschitz for children that are. Subtraction takes all others away from the first.
    """

    shapes: tuple[Shape, ...]
    operation: Operation = "union"
    smooth: float = param(0.0, 0, None, "width over which two surfaces become one; 0: a sharp edge", unit="m")
    blend: Blend = param("polynomial", doc="how surfaces become one")

    def __post_init__(self) -> None:
        check(self)
        if self.operation not in (known := get_args(Operation)):
            raise ParameterError(f"operation: {self.operation!r} is not one of {', '.join(map(repr, known))}")
        object.__setattr__(self, "shapes", tuple(self.shapes))
        if not self.shapes:
            raise ParameterError("shapes: none are given")
        for i, shape in enumerate(self.shapes):
            if isinstance(shape, (list, tuple)):
                raise ParameterError(f"shapes[{i}]: a {type(shape).__name__}; its shapes are given as union(*shapes)")
            if not isinstance(shape, Shape):
                raise ParameterError(f"shapes[{i}]: {shape!r} is no shape")
            of_shape(shape)
        if len({shape.dimension for shape in self.shapes}) > 1:
            raise ParameterError("shapes: some are flat and some solid; extrude or revolve the flat ones first")
        object.__setattr__(self, "dimension", self.shapes[0].dimension)

    @property
    def children(self) -> tuple[Shape, ...]:
        return self.shapes

    def distance(self, p: Floats) -> Floats:
        values = [shape.distance(p) for shape in self.shapes]
        if self.operation == "subtraction":
            rest = _balanced([-v for v in values[1:]], self._greater) if len(values) > 1 else None
            return values[0] if rest is None else self._greater(values[0], rest)
        return _balanced(values, self._least if self.operation == "union" else self._greater)

    def _least(self, a: Floats, b: Floats) -> Floats:
        k = self.smooth
        if k == 0:
            return np.minimum(a, b)
        if self.blend == "polynomial":
            h = np.clip(0.5 + 0.5 * (b - a) / k, 0, 1)
            return b + (a - b) * h - k * h * (1 - h)
        if self.blend == "exponential":
            low, apart = np.minimum(a, b), np.abs(a - b)
            return low - k * np.log2(1 + np.exp2(-apart / k))
        return 0.5 * (a + b - np.sqrt((a - b) ** 2 + k * k))

    def _greater(self, a: Floats, b: Floats) -> Floats:
        return -self._least(-a, -b)

    @cached_property
    def lipschitz(self) -> float:
        return max(shape.lipschitz for shape in self.shapes)

    def extent(self, level: float) -> Box:
        pairings = math.ceil(math.log2(len(self.shapes)))
        if self.operation == "subtraction":
            return self.shapes[0].extent(level)
        boxes = [shape.extent(level + self.swell * pairings) for shape in self.shapes]
        lows, highs = np.array([low for low, _ in boxes]), np.array([high for _, high in boxes])
        if self.operation == "union":
            return lows.min(axis=0), highs.max(axis=0)
        return lows.max(axis=0), np.maximum(highs.min(axis=0), lows.max(axis=0))

    @property
    def swell(self) -> float:
        """How much a pairing can take from the lesser of two values."""
        if self.operation != "union":
            return 0.0
        return self.smooth * {"polynomial": 0.25, "exponential": 1.0, "root": 0.5}[self.blend]

    @cached_property
    def accuracy(self) -> Accuracy:
        if len(self.shapes) == 1:
            return self.shapes[0].accuracy
        outside = self.operation == "union" and self.smooth == 0
        return "outside" if outside and all(shape.accuracy != "bound" for shape in self.shapes) else "bound"


def _balanced(values: list[Floats], pair: Any) -> Floats:
    """Neighbours by pairs, then the results by pairs, until one is left; an odd last one waits."""
    while len(values) > 1:
        paired = [pair(a, b) for a, b in zip(values[::2], values[1::2], strict=False)]
        values = paired + ([values[-1]] if len(values) % 2 else [])
    return values[0]


def union(*shapes: Shape, smooth: float = 0.0, blend: Blend = "polynomial") -> Shape:
    """All of them; see :class:`Combination`."""
    return Combination(_flat(shapes, "union", smooth), "union", smooth, blend)


def intersection(*shapes: Shape, smooth: float = 0.0, blend: Blend = "polynomial") -> Shape:
    """What is in all of them; see :class:`Combination`."""
    return Combination(_flat(shapes, "intersection", smooth), "intersection", smooth, blend)


def subtraction(shape: Shape, *others: Shape, smooth: float = 0.0, blend: Blend = "polynomial") -> Shape:
    """The first without the others; see :class:`Combination`."""
    if smooth == 0 and isinstance(shape, Combination) and shape.operation == "subtraction" and shape.smooth == 0:
        return Combination((*shape.shapes, *others), "subtraction", smooth, blend)
    return Combination((shape, *others), "subtraction", smooth, blend)


def _flat(shapes: Iterable[Shape], operation: Operation, smooth: float) -> tuple[Shape, ...]:
    """Hard unions of unions, and intersections of intersections, as one."""
    result: list[Shape] = []
    for shape in shapes:
        same = isinstance(shape, Combination) and shape.operation == operation and shape.smooth == smooth == 0
        result.extend(shape.children if same else [shape])
    return tuple(result)


@dataclass(frozen=True)
class Transformed(Shape):
    """One child, placed by an affine transform (4×4 rows). Values are multiplied by the transform's least stretch."""

    shape: Shape
    matrix: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        m = self.placement
        if m.shape != (4, 4) or not np.isfinite(m).all() or np.linalg.svd(m[:3, :3], compute_uv=False)[-1] <= 1e-12:
            raise ParameterError("matrix: not finite numbers that have an inverse")
        if not np.array_equal(m[3], (0, 0, 0, 1)):
            raise ParameterError(f"matrix: its last row is {tuple(m[3].tolist())}, and an affine one's is 0, 0, 0, 1")
        object.__setattr__(self, "dimension", of_shape(self.shape))
        if self.dimension == 2 and (m[2, :2].any() or m[:2, 2].any()):
            raise ParameterError("matrix: it turns a flat shape out of its plane; extrude or revolve it first")

    @property
    def placement(self) -> Floats:
        """4×4, from the child's space to the parent's."""
        return np.array(self.matrix)

    @cached_property
    def factor(self) -> float:
        """What the child's values are multiplied by: the least singular value of the placement."""
        linear = self.placement[:3, :3]
        if self.dimension == 2:
            linear = linear[:2, :2]
        return float(np.linalg.svd(linear, compute_uv=False)[-1])

    @property
    def children(self) -> tuple[Shape, ...]:
        return (self.shape,)

    def distance(self, p: Floats) -> Floats:
        inverse = np.linalg.inv(self.placement)
        return self.factor * self.shape.distance(p @ inverse[:3, :3].T + inverse[:3, 3])

    @cached_property
    def lipschitz(self) -> float:
        return self.shape.lipschitz

    def extent(self, level: float) -> Box:
        return transformed_box(self.shape.extent(level / self.factor), self.placement)

    @cached_property
    def accuracy(self) -> Accuracy:
        size = self.dimension
        singular = np.linalg.svd(self.placement[:size, :size], compute_uv=False)
        return self.shape.accuracy if singular[0] <= singular[-1] * (1 + 1e-9) else "bound"


def transformed_box(box: Box, matrix: Floats) -> Box:
    """The box of a box under an affine transform; infinite sides stay infinite (Arvo 1990).

    (N, 4, 4) transforms of boxes with (N, 1, 3) corners are N boxes.
    """
    linear = matrix[..., :3, :3]
    with np.errstate(invalid="ignore"):
        a, b = linear * box[0], linear * box[1]
    a, b = (np.where(linear == 0, 0.0, side) for side in (a, b))  # 0·inf is 0 here
    low, high = np.minimum(a, b).sum(axis=-1), np.maximum(a, b).sum(axis=-1)
    return low + matrix[..., :3, 3], high + matrix[..., :3, 3]


class Marked(Shape):
    """One child that something more is known of; its values are the child's own."""

    shape: Shape

    @property
    def children(self) -> tuple[Shape, ...]:
        return (self.shape,)

    def distance(self, p: Floats) -> Floats:
        return self.shape.distance(p)

    @cached_property
    def lipschitz(self) -> float:
        return self.shape.lipschitz

    def extent(self, level: float) -> Box:
        return self.shape.extent(level)

    @cached_property
    def accuracy(self) -> Accuracy:
        return self.shape.accuracy


@dataclass(frozen=True)
class Painted(Marked):
    """One child with a material wherever a part has none of its own."""

    shape: Shape
    surface: Material

    def __post_init__(self) -> None:
        if not isinstance(self.surface, Material):
            raise ParameterError(f"material: {self.surface!r} is no Material")
        object.__setattr__(self, "dimension", of_shape(self.shape))


@dataclass(frozen=True)
class Named(Marked):
    """One child that can be moved by its name."""

    shape: Shape
    name: str

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ParameterError(f"name: {self.name!r} is no name")
        object.__setattr__(self, "dimension", of_shape(self.shape))
