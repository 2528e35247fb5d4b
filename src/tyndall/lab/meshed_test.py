"""A scene of triangles for one of implicit surfaces: where the surface is, of what, and facing which way."""

from __future__ import annotations

import numpy as np
import pytest

from tyndall.gpu.params import ParameterError
from tyndall.lab.meshed import meshed
from tyndall.scene.model import Camera, Implicit, Instance, Material, PointLight, Scene
from tyndall.sdf import box, plane, sphere
from tyndall.sdf.shading import FragmentShader

RED, BLUE, GREY = (Material(base_color=(*c, 1)) for c in ((0.8, 0, 0), (0, 0, 0.8), (0.5, 0.5, 0.5)))
MOVED = ((0.0, 0.0, 2.0, 1.0), (0.0, 2.0, 0.0, 2.0), (-2.0, 0.0, 0.0, 3.0), (0.0, 0.0, 0.0, 1.0))


def test_a_scene_without_implicit_surfaces_is_itself() -> None:
    scene = Scene()
    assert meshed(scene) is scene


def test_each_material_is_a_mesh_on_its_part_of_the_surface() -> None:
    shape = sphere(0.5).material(RED) | box(0.6).at(1) | sphere(0.4).at(-1).material(BLUE)
    found = meshed(Scene(implicits=[Implicit(shape, MOVED, GREY)]), 48)
    assert not found.implicits
    assert {instance.mesh.material for instance in found.instances} == {RED, BLUE, GREY}
    middles = {RED: (0, 0, 0), BLUE: (-1, 0, 0), GREY: (1, 0, 0)}
    for instance in found.instances:
        assert instance.transform == MOVED
        corners = instance.mesh.positions[instance.mesh.indices].astype(float)
        off = shape(corners.reshape(-1, 3))
        assert np.abs(off).max() < 1e-3
        away = corners.mean(axis=1) - middles[instance.mesh.material]
        assert np.abs(away).max() < 0.55
        face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert ((face * away).sum(1) > 0).all(), "wound outwards"
        normals = np.asarray(instance.mesh.normals)[instance.mesh.indices].mean(axis=1)
        assert ((face * normals).sum(1) > 0).all()


def test_what_has_no_end_is_cut_off_beyond_all_that_is_seen() -> None:
    scene = Scene(
        [Instance(meshed(Scene(implicits=[Implicit(sphere(1))]), 16).instances[0].mesh)],
        [PointLight((0, 4, 0))],
        Camera((0, 2, 6), (0, 0, 0)),
        implicits=[Implicit(plane())],
    )
    ground = meshed(scene, 16).instances[-1].mesh
    top = ground.positions[np.asarray(ground.normals)[:, 1] > 0.9]
    np.testing.assert_allclose(top[:, 1], 0, atol=1e-5)
    assert (top[:, [0, 2]].min(axis=0) < -20).all()
    assert (top[:, [0, 2]].max(axis=0) > 20).all()


def test_what_triangles_cannot_have_is_refused() -> None:
    ink = FragmentShader("ink", "fn shade(properties: FragmentProperties) -> vec3f { return vec3f(1.0); }", ())
    for material in (ink.material(), Material("glass", transmission=0.9)):
        with pytest.raises(ParameterError, match="what triangles cannot have"):
            meshed(Scene(implicits=[Implicit(sphere(1), material=material)]), 16)
