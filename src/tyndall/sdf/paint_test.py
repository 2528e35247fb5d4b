"""A place of a surface has the material of the part that it belongs to, by the rules of shapes."""

from __future__ import annotations

import numpy as np

from tyndall.scene.model import Material
from tyndall.sdf import box, intersection, sphere, subtraction, union
from tyndall.sdf.modifiers import Round
from tyndall.sdf.paint import materials_of, painted
from tyndall.sdf.shape import Named, Shape

RED, BLUE, GREY = (Material(base_color=(*c, 1)) for c in ((0.8, 0, 0), (0, 0, 0.8), (0.5, 0.5, 0.5)))


def colours(shape: Shape, *points: tuple[float, float, float]) -> list[Material]:
    materials, which = painted(shape, points, GREY)
    return [materials[i] for i in which]


def test_parts_of_a_union_keep_their_materials() -> None:
    shape = union(sphere(1).material(RED), box(1.0).material(BLUE).at(2), sphere(0.5).at(-3))
    assert colours(shape, (0, 1, 0), (2.5, 0, 0), (-3.5, 0, 0)) == [RED, BLUE, GREY]
    assert materials_of(shape) == [RED, BLUE]


def test_the_innermost_material_counts_and_the_outermost_is_inherited() -> None:
    shape = union(sphere(1).material(RED), sphere(1).at(3)).material(BLUE)
    assert colours(shape, (0, 1, 0), (3, 1, 0)) == [RED, BLUE]


def test_a_cut_shows_the_material_of_what_is_cut_unless_the_knife_has_one() -> None:
    plain = subtraction(sphere(1).material(RED), box(1.0).at(1))
    dyed = subtraction(sphere(1).material(RED), union(box(1.0).at(1), box(1.0).at(0, 1).material(BLUE)))
    assert colours(plain, (0.5, 0, 0), (-1, 0, 0)) == [RED, RED]
    assert colours(dyed, (0.5, 0, 0), (0, 0.5, 0), (-1, 0, 0)) == [RED, BLUE, RED]
    assert colours(plain.material(BLUE), (0.5, 0, 0)) == [RED]


def test_an_intersection_shows_whose_face_it_is() -> None:
    shape = intersection(sphere(1).material(RED), box(1.5).material(BLUE))
    assert colours(shape, (0.75, 0, 0), (0.7, 0.7, 0.1)) == [BLUE, RED]


def test_places_are_those_in_moved_and_changed_parts() -> None:
    pair = union(sphere(1).material(RED), sphere(1).at(3).material(BLUE))
    shape = Named(Round(pair.rotate(np.pi / 2).scale(2).at(0, 0, 1), 0.25), "pair")
    assert colours(shape, (0, 2.25, 1), (0, 8.2, 1)) == [RED, BLUE]


def test_copies_have_their_materials() -> None:
    pair = union(sphere(0.3).material(RED), sphere(0.3).at(0, 1).material(BLUE))
    assert colours(pair.repeat((2, 4, 4), (3, 1, 1)), (2.3, 0, 0), (-2, 1.3, 0), (0.3, 1, 0)) == [RED, BLUE, BLUE]
    assert colours(pair.repeat((2, 4, 4)), (20.3, 0, 8), (-14, 1.3, 0)) == [RED, BLUE]
    twisted = pair.twist(0.5)
    assert colours(twisted, (0, 0, 0.3), (0, 0.7, 0)) == [RED, BLUE]
