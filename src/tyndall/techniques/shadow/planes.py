"""Flat receivers: the largest planes of a scene, for techniques that draw shadows on planes.

Triangles that lie in one plane belong together, whatever mesh or instance they are of: a floor of boards is one
receiver, and so is each side of a box. Only what a light can shine on counts: a triangle of a one-sided material must
face a light. Planes that the scene's camera sees from their front come first, so that the outsides of a room do not
push out its inside. Planes have no front here; for each light their normal is turned to its side, as the other side is
dark anyway.

They are found on the processor, once a scene: triangles are sorted into coarse bins of normal and offset; the largest
triangle of the bin with most area spans a plane, which takes all triangles whose corners lie in it; and so on.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tyndall.scene.model import DirectionalLight, Light, Scene
from tyndall.techniques.contract import Unsupported

if TYPE_CHECKING:
    from tyndall.gpu.resources import Bound
    from tyndall.techniques.contract import View

MODULE = "package::techniques::shadow::planes"
MOST = 16  # planes that a shader may hold

_FLAT = 1e-5  # how far a corner may be from its plane, of the scene's diagonal …
_ROUNDING = 1e-6  # … and of the largest coordinate
_BINS = (32, 512)  # of a normal's component and of the offset
_LEAST = 0.002  # share of the area that a bin must have to be looked into
_TRIES = 64

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Plane:
    """Points p with ``normal · p + offset = 0``.

    Attributes:
        share: how much of the area that lights can shine on lies in it.
        seen: the same of what faces the scene's camera besides.
    """

    normal: Floats
    offset: float
    share: float
    seen: float

    @property
    def row(self) -> Floats:
        """(4,) so that its product with a homogeneous point is the height over the plane."""
        return np.array([*self.normal, self.offset])

    def towards(self, light: Light, least: float) -> Floats | None:
        """The row, turned to the light's side; None where the light is nearer than ``least``, or in it."""
        row = self.row
        height = float(row @ source_of(light))
        if abs(height) <= (1e-6 if isinstance(light, DirectionalLight) else least):
            return None
        return row if height > 0 else -row


def source_of(light: Light) -> Floats:
    """(4,) a light as a homogeneous point: its position, or the unit direction towards it."""
    if isinstance(light, DirectionalLight):
        towards = -np.asarray(light.direction, np.float64)
        return np.array([*(towards / np.linalg.norm(towards)), 0.0])
    return np.array([*light.position, 1.0])


def flatness(scene: Scene) -> float:
    """How far from a plane something may be and still lie in it, m."""
    low, high = scene.bounds
    return float(_FLAT * np.linalg.norm(high - low) + _ROUNDING * max(np.abs(low).max(), np.abs(high).max()))


_known: weakref.WeakKeyDictionary[Scene, tuple[Plane, ...]] = weakref.WeakKeyDictionary()
_lit: weakref.WeakKeyDictionary[Scene, dict[tuple[Plane, ...], tuple[Lit, ...]]] = weakref.WeakKeyDictionary()


def planes_of(scene: Scene, most: int, share: float) -> tuple[Plane, ...]:
    """At most ``most`` planes of which each has ``share`` of the scene's area; what the camera sees most of first."""
    found = _known.get(scene)
    if found is None:
        found = _known[scene] = _find(scene)
    return tuple(plane for plane in found if plane.share >= share)[:most]


@dataclass(frozen=True, eq=False)
class Lit:
    """A light and a plane that it shines on, by their numbers, and the plane's row, turned to the light's side."""

    light: int
    plane: int
    row: Floats


def lit_by(scene: Scene, planes: tuple[Plane, ...]) -> tuple[Lit, ...]:
    """Each light with each plane that it is not in; found once for the same planes."""
    known = _lit.setdefault(scene, {})
    if planes not in known:
        near = flatness(scene)
        known[planes] = tuple(
            Lit(i, k, row)
            for i, light in enumerate(scene.lights)
            for k, plane in enumerate(planes)
            if (row := plane.towards(light, near)) is not None
        )
    return known[planes]


def check_planes(name: str, scene: Scene, share: float) -> None:
    """Raise :class:`Unsupported` where a scene with lights has no plane to serve that its camera faces."""
    if scene.lights and not any(plane.seen > 0 for plane in planes_of(scene, 1, share)):
        raise Unsupported(
            f"{name}: shadows fall on planes only, and no plane that the scene's camera faces has {100 * share:.3g} % "
            "of the area that its lights can shine on; use shadow_map, or lower share"
        )


def bind_planes(view: View, planes: Sequence[Plane]) -> dict[str, Bound]:
    """``receivers`` for ``planes.wesl``."""

    def rows() -> NDArray[Any]:
        made = np.zeros(max(1, len(planes)), view.gpu.dtype(f"{MODULE}::Receiver"))
        made["flatness"] = -1.0  # without lights there may be none
        for row, plane in zip(made, planes, strict=False):
            row["plane"], row["flatness"] = plane.row, flatness(view.scene)
        return made

    return {"receivers": view.buffer("receivers", rows, element=f"{MODULE}::Receiver").read()}


@dataclass(frozen=True, eq=False)
class _Triangles:
    """Corners (T, 3, 3) about the scene's middle, unit normals (T, 3), areas (T,), and whether they face the camera."""

    corners: NDArray[np.float32]
    normals: NDArray[np.float32]
    areas: Floats
    facing: NDArray[np.bool_]

    def only(self, chosen: NDArray[Any]) -> _Triangles:
        return _Triangles(self.corners[chosen], self.normals[chosen], self.areas[chosen], self.facing[chosen])


def _find(scene: Scene) -> tuple[Plane, ...]:
    low, high = scene.bounds
    centre, size = 0.5 * (low + high), float(np.linalg.norm(high - low))
    near = flatness(scene)
    parts = list(_lit_triangles(scene, centre))
    if not sum(len(part.areas) for part in parts):
        return ()
    columns = ([getattr(part, name) for part in parts] for name in ("corners", "normals", "areas", "facing"))
    all_of_them = _Triangles(*(np.concatenate(column) for column in columns))
    total = all_of_them.areas.sum()
    bins = _bins(all_of_them, size)
    # What is left out of a plane that lies in several bins is not missed.
    kept = np.bincount(bins, all_of_them.areas)[bins] > _LEAST / 100 * total
    triangles, bins = all_of_them.only(kept), bins[kept]
    middles = triangles.corners.mean(axis=1)
    left = triangles.areas.copy()
    in_bins = np.bincount(bins, left)
    found: list[Plane] = []
    for _ in range(_TRIES):
        fullest = int(in_bins.argmax())
        if in_bins[fullest] < _LEAST * total:
            break
        inside = np.flatnonzero(bins == fullest)
        seed = inside[left[inside].argmax()]
        normal, middle = triangles.normals[seed].astype(np.float64), middles[seed].astype(np.float64)
        for _ in range(2):  # the second time, the plane is the mean of all, not the seed's
            heights = middles @ normal.astype(np.float32) - np.float32(middle @ normal)
            close = np.flatnonzero((np.abs(heights) <= near) & (left > 0))
            close = close[(np.abs((triangles.corners[close] - middle) @ normal) <= near).all(axis=1)]
            if not len(close):
                break
            weights = left[close, None]
            sides = np.sign(triangles.normals[close] @ normal)[:, None]
            mean = (triangles.normals[close] * sides * weights).sum(axis=0)
            normal = mean / np.linalg.norm(mean)
            middle = (middles[close] * weights).sum(axis=0) / weights.sum()
        if not len(close):
            in_bins[fullest] = 0  # triangles that lie in no plane that they span
            continue
        share, seen = left[close].sum() / total, (left * triangles.facing)[close].sum() / total
        found.append(Plane(normal, float(-normal @ (middle + centre)), float(share), float(seen)))
        in_bins -= np.bincount(bins[close], left[close], minlength=len(in_bins))
        left[close] = 0
    return tuple(sorted(found, key=lambda plane: (-plane.seen, -plane.share)))


def _bins(triangles: _Triangles, size: float) -> NDArray[np.int64]:
    """(T,) a number from 0 for each triangle: those of about the same normal and offset have the same."""
    across, along = _BINS
    unsigned = _unsigned(triangles.normals)
    offsets = np.einsum("ij,ij->i", unsigned, triangles.corners[:, 0]) / size
    keys = np.rint(offsets * along).astype(np.int64) + along
    for axis in range(3):
        keys = keys * 4 * across + np.rint(unsigned[:, axis] * across).astype(np.int64) + across
    _, bins = np.unique(keys, return_inverse=True)
    return bins.astype(np.int64)


def _lit_triangles(scene: Scene, centre: Floats) -> Iterator[_Triangles]:
    """What a light can shine on, instance by instance."""
    onto = np.eye(4)
    onto[:3, 3] = -centre
    reach = 0.5 * float(np.linalg.norm(np.subtract(*scene.bounds)))
    points = [onto @ source for source in (np.array([*scene.camera.position, 1.0]), *map(source_of, scene.lights))]

    def grazing(point: Floats) -> np.float32:
        """What rounding may give where a triangle is seen edge on."""
        return np.float32(1e-5 * (np.linalg.norm(point[:3]) + point[3] * reach))

    for instance in scene.instances:
        matrix = onto @ np.asarray(instance.transform)
        positions = (instance.mesh.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32)
        corners = positions[instance.mesh.indices]
        doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        if np.linalg.det(matrix[:3, :3]) < 0:
            doubled = -doubled
        length = np.linalg.norm(doubled, axis=1)
        shone = length > 0
        if instance.mesh.material.double_sided:
            faces = [shone] * len(points)
        else:
            at = np.einsum("ij,ij->i", corners[:, 0], doubled)
            faces = [doubled @ p[:3].astype(np.float32) - np.float32(p[3]) * at > grazing(p) * length for p in points]
        if scene.lights:
            shone = shone & np.any(faces[1:], axis=0)
        normals = (doubled[shone] / length[shone, None]).astype(np.float32)
        yield _Triangles(corners[shone], normals, 0.5 * length[shone].astype(np.float64), faces[0][shone])


def _unsigned(normals: NDArray[np.float32]) -> NDArray[np.float32]:
    """Of the two normals of a plane, the one whose largest component is positive."""
    largest = np.take_along_axis(normals, np.abs(normals).argmax(axis=1)[:, None], axis=1)
    return normals * np.where(largest < 0, np.float32(-1), np.float32(1))
