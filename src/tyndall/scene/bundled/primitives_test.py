"""Solids are closed and wound outwards, have the volume of their formula, and normals that agree with the winding."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from solids import face_normals, manifold, open_edges, volume

from tyndall.scene.bundled import primitives
from tyndall.scene.bundled.primitives import (
    Geometry,
    ball,
    cuboid,
    faceted,
    lathe,
    merge,
    pierced_wall,
    placements,
    plate,
    project_onto,
    refine,
    repeat,
    ribbon_solid,
    ring,
    rotation,
    rounded_box,
    scaling,
    slab_with_oculus,
    smooth_path,
    spindle,
    surface_nets,
    torus_knot,
    translation,
    tube,
)


def _polygon(sides: int) -> float:
    """Area of a regular polygon in the unit circle."""
    return sides / 2 * math.sin(2 * math.pi / sides)


def _arch() -> Geometry:
    angle = np.linspace(math.pi, 0, 25)
    lower = np.concatenate([[(-1.5, 0)], np.stack([np.cos(angle), np.sin(angle)], 1), [(1.5, 0)]])
    return ribbon_solid(np.stack([lower, np.stack([lower[:, 0], np.full(27, 2.0)], 1)], 1), 0.5)


def _sphere(p: primitives.Floats) -> primitives.Floats:
    return np.asarray(np.linalg.norm(p, axis=-1) - 0.5)


def _doughnut() -> Geometry:
    u, v = (np.arange(n) * (2 * math.pi / n) for n in (96, 48))
    distance = 1 + 0.3 * np.cos(v)
    return ring(
        np.stack([distance * np.cos(u)[:, None], distance * np.sin(u)[:, None], -0.3 * np.sin(v) + 0 * u[:, None]], -1)
    )


def _double_pyramid() -> Geometry:
    a = np.arange(5) * (2 * math.pi / 5)
    return spindle(np.stack([np.cos(a), 0 * a, -np.sin(a)], -1)[None], (0, -1, 0), (0, 2, 0))


def _trefoil_length() -> float:
    t = np.linspace(0, 2 * math.pi, 100_001)
    distance = 1 + 0.4 * np.cos(3 * t)
    curve = np.stack([distance * np.cos(2 * t), distance * np.sin(2 * t), 0.4 * np.sin(3 * t)], 1)
    return float(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum())


SOLIDS: dict[str, tuple[Callable[[], Geometry], float, float]] = {
    "cuboid": (lambda: cuboid((0, 1, 2), (1, 3, 5)), 6.0, 1e-6),
    "rounded box": (
        lambda: rounded_box((0, 0, 0), (1, 2, 3), 0.1, 8),
        # Minkowski sum of the inner box and a ball (Steiner's formula).
        0.8 * 1.8 * 2.8
        + 0.1 * 2 * (0.8 * 1.8 + 1.8 * 2.8 + 0.8 * 2.8)
        + math.pi * 0.1**2 * (0.8 + 1.8 + 2.8)
        + 4 / 3 * math.pi * 0.1**3,
        2e-3,
    ),
    "cylinder": (lambda: lathe([(0, 0), (1, 0), (1, 2), (0, 2)], 20), 2 * _polygon(20), 1e-6),
    "ball": (lambda: ball(1.0, 96, 64), 4 / 3 * math.pi, 3e-3),
    "straight tube": (lambda: tube([(0, 0, 0), (0, 1, 0), (0, 3, 0)], 0.5, 12), 3 * 0.25 * _polygon(12), 1e-5),
    "bent tube": (lambda: tube(smooth_path([(0, 0, 0), (0, 1, 0), (1, 1, 0)], 12), 0.1, 16), 0.06, 0.15),
    "ring": (
        lambda: tube([(math.cos(a), math.sin(a), 0) for a in np.arange(64) * math.pi / 32], 0.2, 24, closed=True),
        2 * math.pi**2 * 0.2**2,  # Pappus
        0.02,
    ),
    "plate": (lambda: plate(np.stack([*np.meshgrid([0.0, 1, 2], [0.0, 1]), np.zeros((2, 3))], -1), 0.1), 0.2, 1e-5),
    "arch": (_arch, 0.5 * (6 - (math.sin(math.pi / 24) * 24 / 2)), 1e-5),
    "pierced wall": (
        lambda: pierced_wall((4, 3), 0.2, [(1, 1, 2, 2), (2.5, 0, 3.5, 2)]),
        0.2 * (12 - 1 - 2),
        1e-5,
    ),
    "slab with oculus": (
        lambda: slab_with_oculus((-2, 0, -3), (2, 0.5, 3), (0.3, -0.4), 0.8, 256),
        0.5 * (24 - math.pi * 0.64),
        1e-3,
    ),
    "doughnut": (_doughnut, 2 * math.pi**2 * 0.3**2, 5e-3),
    "double pyramid": (_double_pyramid, _polygon(5), 1e-6),
    "faceted": (lambda: faceted(_double_pyramid()), _polygon(5), 1e-6),
    # Weyl 1939: a tube's volume is its section times the length of the curve through its middle.
    "trefoil": (lambda: torus_knot((2, 3), (1, 0.4, 0.2), 400, 32), math.pi * 0.2**2 * _trefoil_length(), 0.01),
    "surface nets": (lambda: surface_nets(_sphere, (-0.6,) * 3, (0.6,) * 3, 0.05), 4 / 3 * math.pi * 0.125, 0.01),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_solid_is_closed_outward_and_of_its_volume(name: str) -> None:
    build, expected, tolerance = SOLIDS[name]
    part = build()
    assert open_edges(part.positions, part.indices) == 0
    assert volume(part.positions, part.indices) == pytest.approx(expected, rel=tolerance)


@pytest.mark.parametrize("name", SOLIDS)
def test_normals_are_unit_and_on_the_side_of_the_winding(name: str) -> None:
    part = SOLIDS[name][0]()
    np.testing.assert_allclose(np.linalg.norm(part.normals, axis=1), 1, atol=1e-5)
    facing = np.einsum("tj,tcj->tc", face_normals(part.positions, part.indices), part.normals[part.indices])
    assert facing.min() > 0.3
    assert np.isfinite(part.uvs).all()


@pytest.mark.parametrize(("build", "characteristic"), [(_doughnut, 0), (_double_pyramid, 2)])
def test_seamless_solids_have_no_vertex_twice(build: Callable[[], Geometry], characteristic: int) -> None:
    part = build()
    assert len(np.unique(part.positions, axis=0)) == len(part.positions)
    assert manifold(part.positions, part.indices)
    assert len(part.positions) - part.triangle_count // 2 == characteristic  # Euler: V − E + T, with E = 3T/2


def test_facets_have_the_normals_of_their_planes() -> None:
    part = faceted(_double_pyramid())
    assert len(part.positions) == 3 * part.triangle_count
    assert manifold(part.positions, part.indices)
    plane = face_normals(part.positions, part.indices)
    np.testing.assert_allclose(part.normals[part.indices], np.repeat(plane[:, None], 3, axis=1), atol=1e-6)


def test_manifold_finds_a_doubled_and_a_missing_triangle() -> None:
    part = cuboid((0, 0, 0), (1, 1, 1))
    assert manifold(part.positions, part.indices)
    assert not manifold(part.positions, part.indices[1:])
    assert not manifold(part.positions, np.concatenate([part.indices, part.indices[:1]]))
    assert not manifold(part.positions, np.concatenate([part.indices, part.indices[:, ::-1]]))


def test_open_edges_finds_a_missing_and_a_flipped_triangle() -> None:
    part = cuboid((0, 0, 0), (1, 1, 1))
    assert open_edges(part.positions, part.indices[1:]) == 3
    flipped = part.indices.copy()
    flipped[0] = flipped[0, ::-1]
    assert open_edges(part.positions, flipped) > 0


def test_mirroring_keeps_the_winding_outward() -> None:
    part = lathe([(0, 0), (1, 0), (0.5, 2), (0, 2)], 12).placed(scaling(-1, 1, 1) @ rotation("x", 0.7))
    assert volume(part.positions, part.indices) > 0
    facing = np.einsum("tj,tcj->tc", face_normals(part.positions, part.indices), part.normals[part.indices])
    assert facing.min() > 0.3


def test_rotations_are_right_handed() -> None:
    for axis, start, end in (("x", (0, 1, 0), (0, 0, 1)), ("y", (0, 0, 1), (1, 0, 0)), ("z", (1, 0, 0), (0, 1, 0))):
        np.testing.assert_allclose(rotation(axis, math.pi / 2)[:3, :3] @ start, end, atol=1e-12)


def test_repeat_equals_merged_copies() -> None:
    rng = np.random.default_rng(1)
    matrices = placements(rng.normal(size=(5, 3)), rng.random(5) * 6, 0.5 + rng.random(5), rng.normal(size=5))
    part = ball(0.3, 8, 6)
    many, copies = repeat(part, matrices), merge(part.placed(m) for m in matrices)
    np.testing.assert_allclose(many.positions, copies.positions, atol=1e-5)
    np.testing.assert_allclose(many.normals, copies.normals, atol=1e-5)
    assert (many.indices == copies.indices).all()


def test_placements_tilt_turn_and_move() -> None:
    expected = translation(1, 2, 3) @ rotation("y", 0.4) @ rotation("x", 0.2) @ scaling(2, 2, 2)
    np.testing.assert_allclose(placements(np.array([[1, 2, 3]]), np.array([0.4]), 2.0, 0.2)[0], expected, atol=1e-12)


@pytest.mark.parametrize("extra", [0, 2, 10, 1000])
def test_refine_adds_exactly_and_stays_closed(extra: int) -> None:
    def onto(points: primitives.Floats) -> primitives.Floats:
        return project_onto(_sphere, points)

    part = ball(0.5, 12, 8)
    finer = refine(part, extra, onto)
    assert finer.triangle_count == part.triangle_count + extra
    assert open_edges(finer.positions, finer.indices) == 0
    assert volume(finer.positions, finer.indices) >= volume(part.positions, part.indices)
    np.testing.assert_allclose(np.linalg.norm(finer.positions, axis=1), 0.5, atol=1e-4)


@pytest.mark.parametrize("extra", [-2, 3])
def test_refine_refuses_what_cannot_be(extra: int) -> None:
    with pytest.raises(ValueError, match="even number"):
        refine(ball(1, 8, 4), extra)


def test_refine_refuses_a_single_triangle() -> None:
    single = primitives.flat([(0, 0, 0), (1, 0, 0), (0, 1, 0)], (0, 0, 1))
    with pytest.raises(ValueError, match="no edge"):
        refine(single, 2)


def test_surface_nets_lie_on_the_surface_as_one_sphere() -> None:
    part = surface_nets(_sphere, (-0.6,) * 3, (0.6,) * 3, 0.08)
    np.testing.assert_allclose(np.linalg.norm(part.positions, axis=1), 0.5, atol=1e-5)
    np.testing.assert_allclose(part.normals, part.positions / 0.5, atol=1e-4)
    edges = 3 * part.triangle_count // 2
    assert len(part.positions) - edges + part.triangle_count == 2  # Euler's characteristic


def test_smooth_path_passes_through_its_points() -> None:
    points = np.array([(0, 0, 0), (1, 2, 0), (3, 1, 1), (4, 0, 0)], float)
    np.testing.assert_allclose(smooth_path(points, 5)[::5], points, atol=1e-12)
