"""Shapes as triangles: marching cubes over the cells that can hold a piece of the surface.

>>> from tyndall.sdf import sphere
>>> mesh = sphere(1).to_mesh(32)
>>> mesh.positions.shape[1], mesh.triangle_count > 1000
(3, True)

**Theory.** The values are sampled on a cubic lattice and triangles put between samples of opposite sign (Lorensen and
Cline 1987, in the form without holes of Lewiner et al. 2003, from scikit-image). A block of cells whose middle has a
value above L times its half diagonal cannot be met by the surface (L the shape's Lipschitz bound), so that only blocks
near it are sampled: about 1 in 20 at a resolution of 256. The vertices then take Newton steps onto the surface itself,
p ← p − f ∇f/|∇f|², at most half a cell, and only where the value becomes less. Normals are the field's gradients.

**Practice.** The mesh is closed and wound outwards. Edges sharper than a cell are cut off by about half of one. A shape
that has no end needs ``bounds``, and is cut off flat there. The lattice is fitted to where the surface is, not to the
box of the analysis, which may be wider.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.params import ParameterError
from tyndall.scene.model import Material, Mesh, vertex_normals
from tyndall.sdf.shape import Box, Floats, Painted, Shape
from tyndall.sdf.solids import Cuboid

GET = "pip install 'tyndall[sdf]'"
_BLOCKS = (16, 4)  # cells along a block, coarse and fine
_CHUNK = 1 << 18  # places evaluated at once


def to_mesh(
    shape: Shape,
    resolution: int = 64,
    *,
    bounds: tuple[Sequence[float], Sequence[float]] | None = None,
    material: Material | None = None,
) -> Mesh:
    """Triangles of a shape's surface.

    Args:
        shape: a solid one.
        resolution: cells along the longest side of the surface's box, 4 … 512.
        bounds: lower and upper corner in metres; what is outside is cut off. None: all of the shape.
        material: of the mesh. None: the shape's own where all of it has one, else the default.

    Returns:
        A closed mesh in the shape's space, in metres, with the field's normals.

    Raises:
        ParameterError: a flat shape, one without an end and no bounds, a resolution out of range, no surface there, or
            scikit-image is missing.
    """
    if shape.dimension != 3:
        raise ParameterError("to_mesh: the shape is flat; extrude or revolve it first")
    if not 4 <= resolution <= 512:
        raise ParameterError(f"resolution: {resolution} is outside 4 … 512")
    try:
        from skimage.measure import marching_cubes
    except ImportError as error:
        raise ParameterError(f"to_mesh needs scikit-image: {GET}") from error
    solid = shape if bounds is None else _cut(shape, bounds)
    low, high = _fitted(solid, finite_box(solid))
    step = float((high - low).max()) / resolution
    cells = np.ceil((high - low) / step - 1e-9).astype(int) + 1  # half a cell or more around the box
    values, origin = _sample(solid, low, high, step, cells)
    if not (values < 0).any():
        raise ParameterError(f"resolution: no sample at {resolution} is inside the shape; it is thinner than a cell")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # scikit-image 0.26 with numpy 2.5
        vertices, triangles, _, _ = marching_cubes(values, 0.0, gradient_direction="descent")  # type: ignore[no-untyped-call]
    places = refine(solid, origin + vertices.astype(np.float64) * step, step)
    positions, indices = places.astype(np.float32), triangles.astype(np.uint32)
    normals = gradient(solid, places, 1e-3 * step)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit = np.where(length > 0.05, normals / np.maximum(length, 1e-30), vertex_normals(positions, indices))
    return Mesh(positions, indices, unit.astype(np.float32), material=material or _painted(shape))


def finite_box(shape: Shape) -> Box:
    """The shape's box.

    Raises:
        ParameterError: it has no end, or nothing in it.
    """
    low, high = shape.box
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        raise ParameterError("bounds: the shape has no end; say which part, as ((x, y, z), (x, y, z))")
    if not (low <= high).all() or not (low < high).any():
        raise ParameterError("shape: nothing is inside")
    return low, high


def gradient(shape: Shape, p: Floats, h: float) -> Floats:
    """(N, 3): how the value changes with the place, by differences over ±h metres."""
    result = np.empty((len(p), 3))
    for axis, offset in enumerate(np.eye(3) * h):
        result[:, axis] = (evaluate(shape, p + offset) - evaluate(shape, p - offset)) / (2 * h)
    return result


def evaluate(shape: Shape, p: Floats) -> Floats:
    """:meth:`Shape.distance` of any number of places, in parts that stay in the cache."""
    if len(p) <= _CHUNK:
        return shape.distance(p)
    return np.concatenate([shape.distance(p[i : i + _CHUNK]) for i in range(0, len(p), _CHUNK)])


def refine(shape: Shape, p: Floats, step: float) -> Floats:
    """(N, 3) places near the surface, moved onto it by at most half a step each time."""
    value = evaluate(shape, p)
    for _ in range(3):
        slope = gradient(shape, p, 1e-4 * step)
        move = -value[:, None] * slope / np.maximum((slope**2).sum(axis=1, keepdims=True), 1e-6)
        length = np.linalg.norm(move, axis=1, keepdims=True)
        moved = p + move * np.minimum(1, 0.5 * step / np.maximum(length, 1e-30))
        there = evaluate(shape, moved)
        better = np.abs(there) < np.abs(value)
        p, value = np.where(better[:, None], moved, p), np.where(better, there, value)
    return p


def _cut(shape: Shape, bounds: tuple[Sequence[float], Sequence[float]]) -> Shape:
    low, high = (np.asarray(corner, np.float64) for corner in bounds)
    if low.shape != (3,) or high.shape != (3,) or not (np.isfinite(low) & np.isfinite(high) & (low < high)).all():
        raise ParameterError(f"bounds: {bounds} is no lower and upper corner in metres")
    size, middle = high - low, (low + high) / 2
    whole = Cuboid((float(size[0]), float(size[1]), float(size[2])))
    return shape & whole.at(*(float(x) for x in middle))


def _fitted(shape: Shape, box: Box) -> Box:
    """The part of a box that a surface of the shape may be in: of 24 parts along the longest side, those that may."""
    low, high = box
    step = float((high - low).max()) / 24
    counts = np.maximum(1, np.ceil((high - low) / step - 1e-9).astype(int))
    size = np.maximum((high - low) / counts, 1e-9 * step)
    corners = low + np.argwhere(np.ones(counts, bool)) * size
    value = evaluate(shape, corners + size / 2)
    near = corners[np.abs(value) <= shape.lipschitz * float(np.linalg.norm(size)) / 2]
    if not len(near):
        raise ParameterError("shape: it has no surface in its box")
    return near.min(axis=0), near.max(axis=0) + size


def _sample(shape: Shape, low: Floats, high: Floats, step: float, cells: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Values at the corners of the cells, float64, and where the first one is.

    True values are at the corners of every cell that the surface may be in; elsewhere only the sign is true.
    """
    coarse, fine = _BLOCKS
    blocks = -(-cells // coarse)
    origin = (low + high) / 2 - cells * step / 2
    reach = shape.lipschitz * step * np.sqrt(3) / 2

    def middle_of(first: NDArray[np.int64], width: int) -> Floats:
        return evaluate(shape, origin + (first + width / 2) * step)

    first = np.argwhere(np.ones(blocks, bool)) * coarse
    value = middle_of(first, coarse)
    filled = np.where(value < 0, -1.0, 1.0).reshape(blocks)
    for axis in range(3):
        filled = filled.repeat(coarse, axis=axis)
    filled = np.pad(filled, [(0, 1)] * 3, constant_values=1.0)  # the last layer is outside
    first = first[np.abs(value) <= reach * coarse]
    parts = np.argwhere(np.ones([coarse // fine] * 3, bool)) * fine
    first = (first[:, None] + parts).reshape(-1, 3)
    value = middle_of(first, fine)
    near = np.abs(value) <= reach * fine
    away = (first[~near][:, None] + np.argwhere(np.ones([fine] * 3, bool))).reshape(-1, 3)
    filled[tuple(away.T)] = np.where(value[~near] < 0, -1.0, 1.0).repeat(fine**3)
    inner = np.argwhere(np.ones([fine + 1] * 3, bool))
    for some in np.array_split(first[near], 1 + near.sum() * len(inner) // _CHUNK):
        at = (some[:, None] + inner).reshape(-1, 3)
        values = shape.distance(origin + at * step)
        values[np.abs(values) < 1e-9 * step] = 1e-9 * step  # a surface through samples has no sides
        filled[tuple(at.T)] = values
    return filled, origin


def _painted(shape: Shape) -> Material:
    """The material that all of a shape has, or the default."""
    while not isinstance(shape, Painted):
        if len(shape.children) != 1:
            return Material()
        shape = shape.children[0]
    return shape.surface
