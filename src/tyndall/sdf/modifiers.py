"""What is done to one shape: to the places that it is asked at, or to its value; ``modifiers.wesl`` has each for the
device.

Every bound holds everywhere, also far from the shape. Twisting and bending turn places the faster the farther they are
from the axis, so these do it within the cylinder around the child and bring places outside of it to its wall first.
There the value is at least the distance from the cylinder, which keeps steps long.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.params import ParameterError, param
from tyndall.sdf.shape import Accuracy, Box, Floats, Modifier, Shape, Vec3

SMALLEST = 1e-6  # of a length that is not 0, in metres


def weakest(accuracy: Accuracy, *, outside: bool = True) -> Accuracy:
    """What is left of an accuracy: "outside" at best, or "bound"."""
    return "outside" if outside and accuracy != "bound" else "bound"


def at_a_wall(accuracy: Accuracy, room: float) -> Accuracy:
    """What is left of it by a mirror, or the axis of a turn, that is ``room`` away from the shape: where they touch,
    what was a surface is none any more, and where they cross, what is left of it may be farther away."""
    return accuracy if room > 0 else weakest(accuracy, outside=room == 0)


# --- from flat to solid ---


@dataclass(frozen=True)
class Extrude(Modifier):
    """A flat shape made solid along Z, half of the height to each side of its plane."""

    code: ClassVar[str] = "extrude"
    adjusts: ClassVar[bool] = True
    takes: ClassVar[int | None] = 2
    gives: ClassVar[int | None] = 3
    shape: Shape
    height: float = param(1.0, SMALLEST, None, "along Z", unit="m")

    def leave(self, d: Floats, p: Floats) -> Floats:
        beyond = np.abs(p[:, 2]) - 0.5 * self.height
        return np.minimum(np.maximum(d, beyond), 0) + np.hypot(np.maximum(d, 0), np.maximum(beyond, 0))

    @cached_property
    def lipschitz(self) -> float:
        return max(1.0, self.shape.lipschitz)  # the two parts change in directions across each other

    def extent(self, level: float) -> Box:
        low, high = self.shape.extent(level)
        half = 0.5 * self.height + level
        return np.array([*low[:2], -half]), np.array([*high[:2], half])

    @cached_property
    def accuracy(self) -> Accuracy:
        return self.shape.accuracy


@dataclass(frozen=True)
class Revolve(Modifier):
    """A flat shape turned about its own Y. What of it has x > −offset is seen; what crosses the axis is cut there."""

    code: ClassVar[str] = "revolve"
    warps: ClassVar[bool] = True
    takes: ClassVar[int | None] = 2
    gives: ClassVar[int | None] = 3
    shape: Shape
    offset: float = param(0.0, doc="by which the shape is moved away from the axis first", unit="m")

    def enter(self, p: Floats) -> Floats:
        return np.stack([np.hypot(p[:, 0], p[:, 2]) - self.offset, p[:, 1], np.zeros(len(p))], axis=1)

    def extent(self, level: float) -> Box:
        low, high = self.shape.extent(level)
        wide = max(0.0, float(high[0]) + self.offset)
        return np.array([-wide, low[1], -wide]), np.array([wide, high[1], wide])

    @cached_property
    def accuracy(self) -> Accuracy:
        return at_a_wall(self.shape.accuracy, float(self.shape.box[0][0]) + self.offset)


# --- the value ---


@dataclass(frozen=True)
class Round(Modifier):
    """The surface moved outwards: d − r."""

    code: ClassVar[str] = "round"
    adjusts: ClassVar[bool] = True
    placed: ClassVar[bool] = False
    shape: Shape
    radius: float = param(0.1, 0, None, "by how much", unit="m")

    def leave(self, d: Floats, p: Floats) -> Floats:
        return d - self.radius

    def extent(self, level: float) -> Box:
        return self.shape.extent(level + self.radius)

    @cached_property
    def accuracy(self) -> Accuracy:
        return weakest(self.shape.accuracy)  # inside, a hollow that has filled up is not the nearest surface


@dataclass(frozen=True)
class Shell(Modifier):
    """A sheet along the surface, half of it to each side: |d| − t/2."""

    code: ClassVar[str] = "shell"
    adjusts: ClassVar[bool] = True
    placed: ClassVar[bool] = False
    shape: Shape
    thickness: float = param(0.1, SMALLEST, None, "of the sheet", unit="m")

    def leave(self, d: Floats, p: Floats) -> Floats:
        return np.abs(d) - 0.5 * self.thickness

    def extent(self, level: float) -> Box:
        return self.shape.extent(level + 0.5 * self.thickness)

    @cached_property
    def accuracy(self) -> Accuracy:
        return weakest(self.shape.accuracy, outside=self.shape.accuracy == "exact")


@dataclass(frozen=True)
class Displace(Modifier):
    """d + amplitude · sin x sin y sin z of places × 2π/wavelength. The product's gradient is 1 at most: with squares
    of sines u, v, w it is uv + vw + wu − 3uvw, which is greatest where two of them are 1 and one is 0."""

    code: ClassVar[str] = "displace"
    adjusts: ClassVar[bool] = True
    takes: ClassVar[int | None] = 3
    shape: Shape
    amplitude: float = param(0.05, 0, None, "height of a bump", unit="m")
    wavelength: float = param(0.5, SMALLEST, None, "from bump to bump", unit="m")

    def leave(self, d: Floats, p: Floats) -> Floats:
        return d + self.amplitude * np.sin(2 * math.pi / self.wavelength * p).prod(axis=1)

    @cached_property
    def lipschitz(self) -> float:
        return self.shape.lipschitz + self.amplitude * 2 * math.pi / self.wavelength

    def extent(self, level: float) -> Box:
        return self.shape.extent(level + self.amplitude)

    @cached_property
    def accuracy(self) -> Accuracy:
        return self.shape.accuracy if self.amplitude == 0 else "bound"


NOISE_SLOPE = math.sqrt(12)


@dataclass(frozen=True)
class Noise(Modifier):
    """d + amplitude · n, n in −1 … 1: values at the corners of a lattice, drawn by a hash, between them s(t) = t² (3 −
    2t) on each axis. Each octave has twice the frequency and half the amplitude of the one before.

    Its slope is at most √12 per lattice step: the value is the mean over corners that are drawn with the chances s and
    1 − s on each axis, so by Parseval Σ s (1 − s) Δ² ≤ 1 for the mean differences Δ along the axes, and
    s'² / (s (1 − s)) = 36 / ((3 − 2t)(1 + 2t)) ≤ 12.
    """

    code: ClassVar[str] = "noise"
    adjusts: ClassVar[bool] = True
    takes: ClassVar[int | None] = 3
    shape: Shape
    amplitude: float = param(0.05, 0, None, "greatest change of the first octave", unit="m")
    step: float = param(0.5, SMALLEST, None, "of the first octave's lattice", unit="m")
    seed: int = param(0, 0, 65535, "which noise")
    octaves: int = param(1, 1, 8, "layers, each finer than the one before")

    def leave(self, d: Floats, p: Floats) -> Floats:
        for octave in range(self.octaves):
            d = d + self.amplitude * 0.5**octave * value_noise(p * 2.0**octave / self.step, self.seed + octave)
        return d

    @property
    def reach(self) -> float:
        """The greatest change of all octaves."""
        return self.amplitude * (2 - 0.5 ** (self.octaves - 1))

    @cached_property
    def lipschitz(self) -> float:
        return self.shape.lipschitz + self.octaves * self.amplitude * NOISE_SLOPE / self.step

    def extent(self, level: float) -> Box:
        return self.shape.extent(level + self.reach)

    @cached_property
    def accuracy(self) -> Accuracy:
        return self.shape.accuracy if self.amplitude == 0 else "bound"


def value_noise(p: Floats, seed: int) -> Floats:
    """(N,) values in −1 … 1 at places (N, 3) in lattice steps, the same as the device's."""
    cell = np.floor(p)
    t = p - cell
    s = t * t * (3 - 2 * t)
    x, y, z = (cell[:, axis].astype(np.int64).astype(np.uint32) for axis in range(3))
    one, first = np.uint32(1), pcg(np.array([seed], np.uint32))
    result = np.zeros(len(p))
    for dz in (0, 1):
        deep = pcg((z + one * np.uint32(dz)) ^ first)
        for dy in (0, 1):
            row = pcg((y + one * np.uint32(dy)) ^ deep)
            for dx in (0, 1):
                drawn = (pcg((x + one * np.uint32(dx)) ^ row) >> np.uint32(8)).astype(np.float64) / 8388608.0 - 1
                wx, wy, wz = (s[:, axis] if far else 1 - s[:, axis] for axis, far in enumerate((dx, dy, dz)))
                result += wx * wy * wz * drawn
    return result


def pcg(value: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """PCG hash (Jarzynski and Olano 2020), as ``package::wesl::noise::pcg``."""
    state = value * np.uint32(747796405) + np.uint32(2891336453)
    word = ((state >> ((state >> np.uint32(28)) + np.uint32(4))) ^ state) * np.uint32(277803737)
    result: NDArray[np.uint32] = (word >> np.uint32(22)) ^ word
    return result


# --- the place ---


@dataclass(frozen=True)
class Elongate(Modifier):
    """Cut by the planes through 0 and pulled apart, by whole lengths."""

    code: ClassVar[str] = "elongate"
    warps: ClassVar[bool] = True
    shape: Shape
    by: Vec3 = param((0.0, 0.0, 0.0), 0, None, "along X, Y and Z", unit="m")

    def enter(self, p: Floats) -> Floats:
        half = 0.5 * np.array(self.by)
        return p - np.clip(p, -half, half)

    def extent(self, level: float) -> Box:
        low, high = self.shape.extent(level)
        half = 0.5 * np.array(self.by)
        return np.where(low > 0, low + half, low - half), np.where(high < 0, high - half, high + half)

    @cached_property
    def accuracy(self) -> Accuracy:
        return "bound" if any(self.by) else self.shape.accuracy


@dataclass(frozen=True)
class Mirror(Modifier):
    """What is on the positive side of some axes, on both sides: the place's component taken as positive."""

    code: ClassVar[str] = "mirror"
    warps: ClassVar[bool] = True
    shape: Shape
    axes: tuple[bool, bool, bool] = param((True, False, False), doc="which of X, Y and Z")

    def enter(self, p: Floats) -> Floats:
        return np.where(np.array(self.axes), np.abs(p), p)

    def extent(self, level: float) -> Box:
        low, high = self.shape.extent(level)
        both = np.maximum(high, 0)
        return np.where(self.axes, -both, low), np.where(self.axes, both, high)

    @cached_property
    def accuracy(self) -> Accuracy:
        return at_a_wall(self.shape.accuracy, float(self.shape.box[0][list(self.axes)].min()))


def mirror(shape: Shape, axes: str) -> Mirror:
    """By the names of axes, as "x" or "xz"."""
    if not axes or set(axes) - set("xyz"):
        raise ParameterError(f"axes: {axes!r} is not some of x, y and z")
    return Mirror(shape, ("x" in axes, "y" in axes, "z" in axes))


@dataclass(frozen=True)
class Turning(Modifier):
    """What :class:`Twist` and :class:`Bend` have in common: places turned about Z within a cylinder around it."""

    warps: ClassVar[bool] = True
    adjusts: ClassVar[bool] = True
    takes: ClassVar[int | None] = 3
    along: ClassVar[int]  # the axis along which the angle grows
    shape: Shape
    rate: float = param(1.0, -1000, 1000, "by which angle", unit="rad/m")

    def __post_init__(self) -> None:
        Modifier.__post_init__(self)
        if not math.isfinite(self.radius):
            raise ParameterError(f"{self.code}: {type(self.shape).__name__} has no end across Z; cut it first")

    @cached_property
    def radius(self) -> float:
        """Of the child about Z."""
        low, high = self.shape.box
        return math.hypot(*np.maximum(np.abs(low[:2]), np.abs(high[:2])))

    @property
    def numbers(self) -> tuple[float, ...]:
        return self.rate, self.radius

    def enter(self, p: Floats) -> Floats:
        away = np.hypot(p[:, 0], p[:, 1])
        x, y = (p[:, :2] * np.minimum(1, self.radius / np.maximum(away, 1e-20))[:, None]).T
        angle = self.rate * (x if self.along == 0 else p[:, 2])
        s, c = np.sin(angle), np.cos(angle)
        return np.stack([c * x + s * y, c * y - s * x, p[:, 2]], axis=1)

    def leave(self, d: Floats, p: Floats) -> Floats:
        beyond = np.hypot(p[:, 0], p[:, 1]) - self.radius
        return np.where(beyond > 0, np.maximum(d, beyond), d)

    @cached_property
    def lipschitz(self) -> float:
        return max(1.0, self.shape.lipschitz * self.stretch)

    def extent(self, level: float) -> Box:
        low, high = self.shape.extent(level)
        wide = self.radius + level
        return np.array([-wide, -wide, low[2]]), np.array([wide, wide, high[2]])

    @cached_property
    def accuracy(self) -> Accuracy:
        return "bound"  # also unturned: beyond the cylinder the value is less than the distance


@dataclass(frozen=True)
class Twist(Turning):
    """Turned about Z by an angle that grows with z, right-handed. A place at radius r moves by k r across for each step
    along, a shear, whose greatest stretch is (k r + √(k² r² + 4)) / 2."""

    code: ClassVar[str] = "twist"
    along: ClassVar[int] = 2

    @cached_property
    def stretch(self) -> float:
        kr = abs(self.rate) * self.radius
        return 0.5 * (kr + math.sqrt(kr * kr + 4))


@dataclass(frozen=True)
class Bend(Turning):
    """Turned about Z by an angle that grows with x, right-handed: a bar along X curves towards +Y on the right and
    on the left. (Not an arc, which would not hold everywhere; the cheap bend of Quilez.) Its stretch is 1 + k r at
    most."""

    code: ClassVar[str] = "bend"
    along: ClassVar[int] = 0

    @cached_property
    def stretch(self) -> float:
        return 1 + abs(self.rate) * self.radius
