"""A mesh as a shape: its signed distances on a lattice, trilinear in between.

>>> from tyndall.sdf import box, from_mesh
>>> again = from_mesh(box(1).to_mesh(16), 24)
>>> again([[0, 0, 0], [0.55, 0, 0]]).round(2)
array([-0.5 ,  0.05])

**Theory.** A sample is the distance to the nearest triangle: the true one within a cell of the surface, and beyond
that the distance to the nearest triangle that its neighbours know of (Danielsson 1980), which is seldom more than a
tenth of a cell too much. It is negative where the winding number of the surface is not 0: counted, along every row of
samples, from the triangles that the row passes through. That is well defined for any closed surface, also of several
bodies that overlap or lie in one another. In between samples, values are trilinear, and the surface is what the samples
can tell: edges are rounded off over about a cell, and walls thinner than a cell may have holes.

The square of a trilinear function's gradient is convex along each axis of its cell, so that it is greatest in one of
the cell's corners, where the gradient's parts are the differences of neighbouring samples: the greatest of all is the
Lipschitz bound, from the samples themselves. That of distances is at most √3, found where three sides are equally far;
1.55 is usual.

Outside the lattice the value is √(e² + f²), with e the distance to its box and f the value at the box's nearest point:
the surface is at least f/L from there and lies on the other side of a right or obtuse angle, so that √(e² + f²)/L is
never more than the distance. It is L-Lipschitz as well.

**Practice.** 64 cells along the longest side of a cube are 1 MB, 128 are 8 MB. A mesh of 100,000 triangles takes some
4 seconds at 64. A mesh with an edge that belongs to one triangle only, or to two that do not agree on which side is
out, has no inside and is refused.
"""

from __future__ import annotations

import base64
import math
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.params import ParameterError, param
from tyndall.scene.model import Mesh
from tyndall.sdf.shape import Accuracy, Box, Floats, Primitive, Vec3

Ints = NDArray[np.int64]
_LARGEST = 1 << 25  # samples
_CHUNK = 1 << 16  # pairs of a place and a triangle at once


@dataclass(frozen=True, eq=False)
class Grid(Primitive):
    """Values on a cubic lattice, trilinear in between; see the module.

    Attributes:
        samples: (z, y, x) float32 in metres, at least 2 along each axis; positive on all six outer faces.
    """

    code: ClassVar[str] = "grid"
    module: ClassVar[str] = "package::sdf::grid"
    samples: NDArray[np.float32]
    low: Vec3 = param(..., doc="where the first sample is", unit="m")
    step: float = param(..., 1e-9, None, "between neighbouring samples", unit="m")

    def __post_init__(self) -> None:
        super().__post_init__()
        samples = np.array(self.samples, np.float32)
        if samples.ndim != 3 or min(samples.shape) < 2 or samples.size > _LARGEST:
            raise ParameterError(f"samples: shape {samples.shape} is not (z, y, x), each ≥ 2, {_LARGEST:,} in all")
        if not np.isfinite(samples).all():
            raise ParameterError("samples: a sample is not finite")
        if not all((side > 0).all() for axis in range(3) for side in (samples.take(0, axis), samples.take(-1, axis))):
            raise ParameterError("samples: the surface reaches the edge of the lattice")
        if not (samples < 0).any():
            raise ParameterError("samples: nothing is inside; a thin body needs a higher resolution")
        samples.setflags(write=False)
        object.__setattr__(self, "samples", samples)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Grid) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    @cached_property
    def _key(self) -> tuple[Any, ...]:
        return self.low, self.step, self.samples.shape, self.samples.tobytes()

    @property
    def numbers(self) -> tuple[float, ...]:
        """The first is where the samples are on the device."""
        z, y, x = self.samples.shape
        return (0.0, *self.low, self.step, float(x), float(y), float(z))

    @property
    def payload(self) -> NDArray[np.float32]:
        """All samples, x fastest."""
        return self._flat

    @cached_property
    def _flat(self) -> NDArray[np.float32]:
        return self.samples.reshape(-1)

    def distance(self, p: Floats) -> Floats:
        counts = np.array(self.samples.shape[::-1])
        q = np.clip((p - self.low) / self.step, 0, counts - 1)
        away = p - (np.array(self.low) + q * self.step)
        cell = np.minimum(q.astype(np.int64), counts - 2)
        f = q - cell
        first = cell @ (1, counts[0], counts[0] * counts[1])
        value = np.zeros(len(p))
        for corner in range(8):
            bits = np.array([corner & 1, corner >> 1 & 1, corner >> 2])
            weight = np.where(bits, f, 1 - f).prod(axis=1)
            value += weight * self._flat[first + int(bits @ (1, counts[0], counts[0] * counts[1]))]
        square = (away**2).sum(axis=1)
        outside = ((p < self.low) | (p > np.array(self.low) + (counts - 1) * self.step)).any(axis=1)
        return np.where(outside, np.sqrt(square + value**2), value)

    @cached_property
    def lipschitz(self) -> float:
        square = np.zeros(self.samples.shape)
        for axis in range(3):
            slope = np.square(np.diff(self.samples.astype(np.float64), axis=axis) / self.step)
            pad = [(1, 1) if other == axis else (0, 0) for other in range(3)]
            slope = np.pad(slope, pad)
            size = slope.shape[axis]
            square += np.maximum(slope.take(range(size - 1), axis), slope.take(range(1, size), axis))
        return max(1.0, float(np.sqrt(square.max())))

    @cached_property
    def accuracy(self) -> Accuracy:
        return "bound"

    @cached_property
    def _least(self) -> tuple[NDArray[np.float32], ...]:
        """Along x, y and z: the least sample of each layer."""
        return tuple(self.samples.min(axis=axes) for axes in ((0, 1), (0, 2), (1, 2)))

    def extent(self, level: float) -> Box:
        """Of the cells with a sample at or below the level, and as far beyond the lattice as √(e² + f²) allows."""
        low, high = np.empty(3), np.empty(3)
        for axis, least in enumerate(self._least):
            (at,) = np.nonzero(least <= level)
            end = len(least) - 1
            ends = []
            for cell, face in ((at[0] - 1, 0), (at[-1] + 1, end)):
                beyond = math.sqrt(max(0.0, level**2 - float(least[face]) ** 2)) if not 0 <= cell <= end else 0.0
                ends.append((min(max(cell, 0), end) * self.step, beyond))
            low[axis], high[axis] = self.low[axis] + ends[0][0] - ends[0][1], self.low[axis] + ends[1][0] + ends[1][1]
        return low, high

    def to_data(self) -> dict[str, Any]:
        """Plain values that JSON can hold; :meth:`from_data` makes an equal grid of them."""
        packed = base64.b85encode(zlib.compress(self.samples.astype("<f4").tobytes(), 6)).decode()
        return {"low": list(self.low), "step": self.step, "counts": list(self.samples.shape[::-1]), "samples": packed}

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> Grid:
        """What :meth:`to_data` wrote.

        Raises:
            ParameterError: something else.
        """
        try:
            x, y, z = (int(count) for count in data["counts"])
            if min(x, y, z) < 2 or x * y * z > _LARGEST:
                raise ParameterError(f"counts: {[x, y, z]} is not three numbers ≥ 2, {_LARGEST:,} in all")
            unpack = zlib.decompressobj()
            raw = unpack.decompress(base64.b85decode(data["samples"]), 4 * x * y * z + 1)
            samples = np.frombuffer(raw, "<f4").reshape(z, y, x)
            return cls(samples, data["low"], data["step"])
        except (KeyError, TypeError, zlib.error, ValueError) as error:
            if isinstance(error, ParameterError):
                raise
            raise ParameterError(f"grid: not what a grid was saved as ({error})") from error


def from_mesh(mesh: Mesh, resolution: int = 64, *, margin: int = 2) -> Grid:
    """A closed mesh as a shape; see the module.

    Args:
        mesh: closed; wound outwards or inwards, of one or several bodies.
        resolution: cells along the longest side of the mesh's box, 4 … 256.
        margin: cells around that box, 1 … 64. Values beyond them are exact to less; see the module.

    Raises:
        ParameterError: a mesh that is not closed or encloses nothing, or a number out of range.
    """
    if not isinstance(mesh, Mesh):
        raise ParameterError(f"mesh: {mesh!r} is no Mesh; tyndall.load(file).instances have some")
    for name, value, least, most in (("resolution", resolution, 4, 256), ("margin", margin, 1, 64)):
        if not least <= value <= most:
            raise ParameterError(f"{name}: {value} is outside {least} … {most}")
    corners = _closed(mesh)
    flat = corners.reshape(-1, 3)
    low, high = flat.min(axis=0), flat.max(axis=0)
    step = float((high - low).max()) / resolution
    counts = np.ceil((high - low) / step - 1e-9).astype(np.int64) + 1 + 2 * margin
    first = (low + high) / 2 - (counts - 1) * step / 2
    distance = _on_lattice(Triangles(corners), first, step, counts)
    samples = np.where(_inside(corners, first, step, counts), -distance, distance)
    return Grid(samples.astype(np.float32), (float(first[0]), float(first[1]), float(first[2])), step)


def _closed(mesh: Mesh) -> Floats:
    """(T, 3, 3) corners of the triangles that have an area, float64.

    Raises:
        ParameterError: the mesh is not closed.
    """
    places, number = np.unique(mesh.positions + np.float32(0), axis=0, return_inverse=True)
    corners = number.reshape(-1)[mesh.indices.astype(np.int64)]
    corners = corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    edge = np.minimum(start, end) * len(places) + np.maximum(start, end)
    _, edge = np.unique(edge, return_inverse=True)
    balance = np.bincount(edge, np.where(start < end, 1.0, -1.0))
    if len(corners) == 0 or (balance != 0).any():
        count = int((balance != 0).sum())
        raise ParameterError(f"mesh: it is not closed ({count:,} edges have no partner), so that it has no inside")
    return np.asarray(places[corners], np.float64)


# --- distance ------------------------------------------------------------------------------------------------------


class Triangles:
    """Triangles in frames of their own: the first corner at 0, the longest side along u, the third corner at v ≥ 0.

    Attributes:
        corners: (T, 3, 3), the longest side first.
        frames: (T, 3, 3) the unit axes u, v and n, as rows.
        ends: (T, 3) u of the second corner, u and v of the third.
    """

    def __init__(self, corners: Floats) -> None:
        """Of (T, 3, 3) corners, of which no two are one."""
        longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).argmax(axis=1)
        turned = (longest[:, None] + np.arange(3)) % 3
        self.corners = np.take_along_axis(corners, turned[..., None], axis=1)
        side, other = self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0]
        length = np.linalg.norm(side, axis=1, keepdims=True)
        u = side / length
        along = (u * other).sum(axis=1, keepdims=True)
        # Where a triangle is a line, any direction across does.
        across = other - along * u
        high = np.linalg.norm(across, axis=1, keepdims=True)
        any_across = np.cross(u, np.eye(3)[np.abs(u).argmin(axis=1)])
        across = np.where(high > 1e-9 * length, across, any_across)
        v = across / np.linalg.norm(across, axis=1, keepdims=True)
        self.frames = np.stack([u, v, np.cross(u, v)], axis=1)
        self.ends = np.concatenate([length, along, np.where(high > 1e-9 * length, high, 0.0)], axis=1)

    def height(self, triangle: Ints, p: Floats) -> Floats:
        """(N,) signed distances of (N, 3) places to the planes of one triangle each."""
        return np.asarray(((p - self.corners[triangle, 0]) * self.frames[triangle, 2]).sum(axis=1))

    def square(self, triangle: Ints, p: Floats) -> Floats:
        """(N,) squared distances of (N, 3) places to one triangle each."""
        u, v, n = np.einsum("ikj,ij->ki", self.frames[triangle], p - self.corners[triangle, 0])
        length, x, y = self.ends[triangle].T
        back = x - length
        first = np.square(u - np.clip(u, 0, length)) + v * v
        w = u - length
        t = np.clip((w * back + v * y) / (back * back + y * y), 0, 1)
        second = np.square(w - t * back) + np.square(v - t * y)
        t = np.clip((u * x + v * y) / (x * x + y * y), 0, 1)
        third = np.square(u - t * x) + np.square(v - t * y)
        within = (y > 0) & (v >= 0) & (back * v >= y * w) & (y * u >= x * v)
        return np.asarray(np.where(within, 0, np.minimum(first, np.minimum(second, third))) + n * n)


def _on_lattice(triangles: Triangles, first: Floats, step: float, counts: Ints) -> Floats:
    """(z, y, x) distances: exact within a cell of the surface; beyond, to the nearest that the neighbours know of.

    From the samples around the surface, each tells its six neighbours of its triangle, and who is nearer to that than
    to its own takes it and tells on, until nobody gains a thousandth of a cell.
    """
    strides = np.array([1, counts[0], counts[0] * counts[1]])
    nearest = np.full(int(counts.prod()), np.inf)
    owner = np.zeros(len(nearest), np.int64)

    def offer(place: Ints, cell: Ints, triangle: Ints, least: float) -> Ints:
        """Those of the places, by index and (N, 3) cell, to which the triangle is nearer than theirs by ``least``."""
        square = triangles.square(triangle, first + cell * step)
        gain = np.sqrt(square) < np.sqrt(nearest[place]) - least
        place, triangle, square = place[gain], triangle[gain], square[gain]
        np.minimum.at(nearest, place, square)
        best = square == nearest[place]
        owner[place[best]] = triangle[best]
        return place

    low = np.maximum(0, np.ceil((triangles.corners.min(axis=1) - first) / step - 1)).astype(np.int64)
    high = np.minimum(counts - 1, np.floor((triangles.corners.max(axis=1) - first) / step + 1)).astype(np.int64)
    for triangle, cell in _boxes(low, high):
        near = np.abs(triangles.height(triangle, first + cell * step)) <= step
        offer(cell[near] @ strides, cell[near], triangle[near], 0.0)
    told = np.flatnonzero(np.isfinite(nearest))
    while len(told):
        gained = []
        for part in np.array_split(told, 1 + len(told) // _CHUNK):
            cell = part[:, None] // strides % counts
            for axis in range(3):
                for way in (-1, 1):
                    beside = cell[:, axis] + way
                    valid = (beside >= 0) & (beside < counts[axis])
                    to = cell[valid]
                    to[:, axis] += way
                    gained.append(offer(part[valid] + way * strides[axis], to, owner[part[valid]], 1e-3 * step))
        told = np.unique(np.concatenate(gained))
    return np.sqrt(nearest).reshape(counts[::-1])


def _boxes(low: Ints, high: Ints) -> Iterator[tuple[Ints, Ints]]:
    """All cells of boxes from low to high (T, D), both inclusive: (N,) which box and (N, D) the cell, in parts."""
    spans = np.maximum(0, high - low + 1)
    ends = spans.prod(axis=1).cumsum()
    for start in range(0, int(ends[-1]), _CHUNK):
        job = np.arange(start, min(start + _CHUNK, int(ends[-1])))
        box = np.searchsorted(ends, job, side="right")
        rest, cell = job - np.where(box > 0, ends[box - 1], 0), low[box]
        for axis in range(low.shape[1]):
            cell[:, axis] += rest % spans[box, axis]
            rest //= spans[box, axis]
        yield box, cell


def _inside(corners: Floats, first: Floats, step: float, counts: Ints) -> NDArray[np.bool_]:
    """(z, y, x): where the winding number is not 0.

    Rows of samples along x are shifted by a millionth of a cell, so that they meet no vertex. On which side of an edge
    a row passes is computed from the edge's ends in the same order for both of its triangles, so that they agree.
    """
    crossings = np.zeros((counts[2], counts[1], counts[0] + 1), np.int32)
    row = first[1:] + np.array([1.3e-6, 0.7e-6]) * step
    flat = corners[..., 1:]
    low = np.maximum(0, np.ceil((flat.min(axis=1) - row) / step)).astype(np.int64)
    high = np.minimum(counts[1:] - 1, np.floor((flat.max(axis=1) - row) / step)).astype(np.int64)
    for triangle, cell in _boxes(low, high):
        at = row + cell * step
        sides = np.stack([_side(flat[triangle, i], flat[triangle, (i + 1) % 3], at) for i in range(3)])
        hit = (sides == sides[0]).all(axis=0)
        triangle, cell, at, sign = triangle[hit], cell[hit], at[hit], sides[0, hit]
        a, b, c = corners[triangle].transpose(1, 0, 2)
        normal = np.cross(b - a, c - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            x = a[:, 0] - ((at - a[:, 1:]) * normal[:, 1:]).sum(axis=1) / normal[:, 0]
        x = np.clip(np.nan_to_num(x), corners[triangle, :, 0].min(axis=1), corners[triangle, :, 0].max(axis=1))
        before = np.clip(np.ceil((x - first[0]) / step), 0, counts[0]).astype(np.int64)
        np.add.at(crossings, (cell[:, 1], cell[:, 0], before), sign)
    # A sample's winding number is the sum over the triangles beyond it.
    beyond = crossings[..., ::-1].cumsum(axis=2)[..., ::-1]
    return np.asarray(beyond[..., 1:] != 0)


def _side(start: Floats, end: Floats, at: Floats) -> NDArray[np.int32]:
    """±1: on which side of the line from start to end a place is; the opposite, always, of that from end to start."""
    swapped = (start[:, 0] > end[:, 0]) | ((start[:, 0] == end[:, 0]) & (start[:, 1] > end[:, 1]))
    a, b = np.where(swapped[:, None], end, start), np.where(swapped[:, None], start, end)
    cross = (b[:, 0] - a[:, 0]) * (at[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (at[:, 0] - a[:, 0])
    return np.where((cross >= 0) != swapped, 1, -1).astype(np.int32)
