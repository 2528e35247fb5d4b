"""Meshes of shapes: volumes and areas of closed forms, closed, and wound outwards."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest
import solids
from numpy.typing import NDArray

from tyndall.gpu.params import ParameterError
from tyndall.scene.model import Material, Mesh
from tyndall.sdf import Shape, X, box, meshing, sphere, union
from tyndall.sdf.shape import Box, Floats, Primitive


class Ring(Primitive):
    """A torus of radii 1 and 0.3 about Z."""

    def distance(self, p: Floats) -> Floats:
        return np.hypot(np.hypot(p[:, 0], p[:, 1]) - 1, p[:, 2]) - 0.3

    def extent(self, level: float) -> Box:
        half = np.array([1.3, 1.3, 0.3]) + level
        return -half, half


class Below(Primitive):
    """Everything below y = 0.25."""

    def distance(self, p: Floats) -> Floats:
        return p[:, 1] - 0.25

    def extent(self, level: float) -> Box:
        return np.full(3, -np.inf), np.array([np.inf, 0.25 + level, np.inf])


def area(mesh: Mesh) -> float:
    a, b, c = (mesh.positions[mesh.indices[:, k]].astype(float) for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize(
    ("shape", "volume", "surface", "tolerance"),
    [
        (sphere(1.2), 4 / 3 * math.pi * 1.2**3, 4 * math.pi * 1.2**2, 2e-3),
        (Ring(), 2 * math.pi**2 * 0.3**2, 4 * math.pi**2 * 0.3, 5e-3),
        (box((1, 2, 0.5)), 1.0, 7.0, 2e-2),  # its edges are cut off
        (box((1, 2, 0.5)).rotate(0.7, (1, 2, 3)).at(3, -4, 5), 1.0, 7.0, 2e-2),
        (sphere(1).scale((1, 2, 0.5)).at(1), 4 / 3 * math.pi, None, 3e-3),
        (sphere(0.5) | sphere(0.5).at(4), 2 * 4 / 3 * math.pi * 0.5**3, 2 * math.pi, 2e-2),
    ],
    ids=["sphere", "torus", "box", "turned box", "ellipsoid", "two"],
)
def test_volume_and_area(shape: Shape, volume: float, surface: float | None, tolerance: float) -> None:
    mesh = shape.to_mesh(64)
    assert solids.open_edges(mesh.positions, mesh.indices) == 0
    assert solids.volume(mesh.positions, mesh.indices) == pytest.approx(volume, rel=tolerance)
    if surface is not None:
        assert area(mesh) == pytest.approx(surface, rel=tolerance)


def test_the_error_falls_with_the_square_of_the_cells() -> None:
    error = []
    for resolution in (16, 32, 64):
        mesh = sphere(1).to_mesh(resolution)
        error.append(4 / 3 * math.pi - solids.volume(mesh.positions, mesh.indices))
    assert np.all(np.array(error) > 0)
    assert error[0] / error[1] == pytest.approx(4, rel=0.15)
    assert error[1] / error[2] == pytest.approx(4, rel=0.15)


def test_vertices_are_on_the_surface_and_normals_point_out() -> None:
    shape = sphere(1) - sphere(0.8).at(0.9)
    mesh = shape.to_mesh(48)
    assert solids.manifold(mesh.positions, mesh.indices)
    assert np.abs(shape(mesh.positions)).max() < 1e-4
    normals = np.asarray(mesh.normals, np.float64)
    assert (shape(mesh.positions + 0.01 * normals) > 0).mean() > 0.999
    faces = solids.face_normals(mesh.positions, mesh.indices)
    assert (np.einsum("ij,ij->i", faces, normals[mesh.indices[:, 0]]) > 0).mean() > 0.99


@pytest.mark.parametrize("resolution", [30, 33, 64])
def test_skipping_blocks_changes_nothing(resolution: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks are left out by L alone: with a bound so great that none is, the mesh is the same."""
    shape = union(sphere(0.6), box((0.5, 1.6, 0.4)).rotate(0.3, X).at(0.5), smooth=0.2)

    def sampled() -> NDArray[np.float64]:
        low, high = shape.box
        step = float((high - low).max()) / resolution
        cells = np.ceil((high - low) / step).astype(int) + 1
        return meshing._sample(shape, low, high, step, cells)[0]

    some = sampled()
    monkeypatch.setitem(shape.__dict__, "lipschitz", 1e9)
    every = sampled()
    assert ((some < 0) == (every < 0)).all()
    # Of all edges whose ends differ in sign, both ends have the same values.
    for axis in range(3):
        crossed = np.diff((every < 0).astype(int), axis=axis) != 0
        for end in (slice(None, -1), slice(1, None)):
            at = tuple(end if other == axis else slice(None) for other in range(3))
            np.testing.assert_array_equal(some[at][crossed], every[at][crossed])


def test_bounds_cut_off_what_has_no_end() -> None:
    with pytest.raises(ParameterError, match="bounds: the shape has no end"):
        Below().to_mesh()
    mesh = Below().to_mesh(40, bounds=((-1, -1, -1), (1, 1, 1)))
    assert solids.open_edges(mesh.positions, mesh.indices) == 0
    assert solids.volume(mesh.positions, mesh.indices) == pytest.approx(2 * 2 * 1.25, rel=1e-2)
    half = sphere(1).to_mesh(40, bounds=((-2, 0, -2), (2, 2, 2)))
    assert solids.volume(half.positions, half.indices) == pytest.approx(2 / 3 * math.pi, rel=1e-2)


def test_the_material_is_that_of_all_of_it() -> None:
    red = Material(base_color=(1, 0, 0, 1))
    assert sphere(1).material(red).at(1).to_mesh(8).material == red
    assert (sphere(1).material(red) | sphere(2)).to_mesh(8).material == Material()
    assert sphere(1).to_mesh(8, material=red).material == red


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sphere(1).to_mesh(2), "resolution: 2 is outside 4 … 512"),
        (lambda: (sphere(1) & sphere(1).at(5)).to_mesh(8), "shape: "),
        (lambda: (box(1) - box(2)).to_mesh(8), "resolution: no sample|shape: it has no surface"),
        (lambda: sphere(1).to_mesh(8, bounds=((0, 0, 0), (1, 0, 1))), "bounds: .* is no lower and upper corner"),
    ],
)
def test_one_line_says_what_is_wrong(make, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ParameterError, match=message) as error:
        make()
    assert "\n" not in str(error.value)


def test_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "skimage.measure", None)
    with pytest.raises(ParameterError, match=r"to_mesh needs scikit-image: pip install 'tyndall\[sdf\]'"):
        sphere(1).to_mesh(8)
