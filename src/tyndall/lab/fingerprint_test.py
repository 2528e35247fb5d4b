"""The hash follows the content, and only the content."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tyndall.lab.fingerprint import scene_hash, versions
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    HenyeyGreenstein,
    Image,
    Implicit,
    Instance,
    Isotropic,
    Material,
    Medium,
    Mesh,
    RectLight,
    Scene,
    Texture,
)
from tyndall.sdf import box, sphere, subtraction, union
from tyndall.sdf.shading import FragmentShader
from tyndall.sdf.shape import MOST_DEEP, Shape


def triangle(height: float = 1.0, material: Material | None = None) -> Mesh:
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, height, 0]], np.float32)
    return Mesh(positions, np.array([[0, 1, 2]], np.uint32), material=material or Material(), name="triangle")


def make(**changes: object) -> Scene:
    base: dict[str, object] = {
        "instances": (Instance(triangle()),),
        "lights": (DirectionalLight(intensity=3.0),),
        "medium": Medium(scattering=(0.1, 0.1, 0.1)),
    }
    return Scene(**{**base, **changes})  # type: ignore[arg-type]


def test_equal_content_has_one_hash() -> None:
    assert scene_hash(make()) == scene_hash(make())
    assert len(scene_hash(make())) == 64


def test_names_and_looks_do_not_count() -> None:
    assert scene_hash(make(name="other", looks={"froxel": {"z_limit": 3.0}})) == scene_hash(make())


texels = np.zeros((2, 2, 4), np.uint8)
textured = Material(base_color_texture=Texture(Image(texels)))
repainted = Material(base_color_texture=Texture(Image(texels + np.uint8(1))))
turned = ((0, 0, 1, 0), (0, 1, 0, 0), (-1, 0, 0, 0), (0, 0, 0, 1))


@pytest.mark.parametrize(
    "change",
    [
        {"instances": ()},
        {"instances": (Instance(triangle(np.nextafter(np.float32(1), np.float32(2)))),)},
        {"instances": (Instance(triangle(), turned),)},
        {"instances": (Instance(triangle()), Instance(triangle()))},
        {"instances": (Instance(triangle(material=textured)),)},
        {"lights": (DirectionalLight(intensity=3.0000001),)},
        {"lights": (RectLight(intensity=3.0),)},
        {"camera": Camera(exposure=1.0)},
        {"medium": Medium(scattering=(0.1, 0.1, 0.1), phase=HenyeyGreenstein(0.2))},
        {"medium": Medium(absorption=(0.1, 0.1, 0.1))},
        {"background": (0.0, 0.0, 0.1)},
        {"ambient": (0.0, 0.0, 0.1)},
        {"implicits": (Implicit(sphere()),)},
    ],
)
def test_each_part_of_the_content_counts(change: dict[str, object]) -> None:
    assert scene_hash(make(**change)) != scene_hash(make())


def test_texels_count() -> None:
    first, second = (make(instances=(Instance(triangle(material=m)),)) for m in (textured, repainted))
    assert scene_hash(first) != scene_hash(second)


def test_a_shared_mesh_hashes_like_its_copies() -> None:
    mesh = triangle()
    shared = make(instances=(Instance(mesh), Instance(mesh)))
    copies = make(instances=(Instance(triangle()), Instance(triangle())))
    assert scene_hash(shared) == scene_hash(copies)


def test_a_type_counts_even_where_its_fields_are_equal() -> None:
    rayleigh = dataclasses.replace(make(), medium=Medium(scattering=(0.1, 0.1, 0.1), phase=HenyeyGreenstein(0.0)))
    isotropic = dataclasses.replace(make(), medium=Medium(scattering=(0.1, 0.1, 0.1), phase=Isotropic()))
    assert scene_hash(rayleigh) != scene_hash(isotropic)


def test_versions_name_what_is_installed() -> None:
    found = versions(("numpy", "no-such-package"))
    assert found["numpy"] == np.__version__
    assert "no-such-package" not in found


RED = Material(base_color=(1, 0, 0, 1))
PARTS = [sphere(0.5), box(1.0), sphere(1.0).at(0.1)]


@pytest.mark.parametrize(
    "other",
    [
        union(*PARTS[::-1]),
        union(*PARTS[:2]),
        union(*PARTS, smooth=0.1),
        union(*PARTS, blend="root"),
        subtraction(*PARTS),
        union(sphere(0.5), box(1.0), sphere(1.0).at(float(np.nextafter(0.1, 1)))),
        union(sphere(0.5), box(1.0), sphere(1.0).at(0.1).material(RED)),
        union(union(*PARTS[:2]).at(1e-3), PARTS[2]),
    ],
)
def test_each_part_of_a_shape_counts(other: Shape) -> None:
    """Which node, how they are joined, in which order, where, and of what."""
    one, two = (make(implicits=(Implicit(shape),)) for shape in (union(*PARTS), other))
    assert scene_hash(one) != scene_hash(two)


def test_an_implicit_surfaces_place_and_material_count_and_its_names_do_not() -> None:
    base = scene_hash(make(implicits=(Implicit(union(*PARTS)),)))
    assert scene_hash(make(implicits=(Implicit(union(*PARTS), turned),))) != base
    assert scene_hash(make(implicits=(Implicit(union(*PARTS), material=RED),))) != base
    named = union(PARTS[0].named("a"), *PARTS[1:])
    assert scene_hash(make(implicits=(Implicit(union(*PARTS), name="vase"),))) == base
    assert scene_hash(make(implicits=(Implicit(named),))) == scene_hash(
        make(implicits=(Implicit(union(PARTS[0].named("b"), *PARTS[1:])),))
    )


def test_a_deep_shape_has_a_hash() -> None:
    """As a loop of smooth unions makes it; what is deepest counts."""

    def chain(radius: float) -> Scene:
        shape: Shape = sphere(radius)
        for i in range(MOST_DEEP - 2):
            shape = union(shape, sphere().at(i), smooth=0.1)
        return make(implicits=(Implicit(shape),))

    assert scene_hash(chain(1.0)) == scene_hash(chain(1.0)) != scene_hash(chain(2.0))


def test_what_names_mean_something_in_counts() -> None:
    """As a fragment shader's properties do: their order is that of a material's numbers."""
    text = "fn shade(properties: FragmentProperties) -> vec3f { return vec3f(_A, _B, 0.0); }"
    one, two = (
        FragmentShader("ink", text, (f"[float] {first}", f"[float] {second}")).material(_A=a, _B=b)
        for first, second, a, b in (("_A", "_B", 0.25, 0.75), ("_B", "_A", 0.75, 0.25))
    )
    assert one.values == two.values
    assert len({scene_hash(make(implicits=(Implicit(sphere().material(m)),))) for m in (one, two)}) == 2
