"""`box`: a fox of clay in a plaster room; the sun falls through a round opening in the ceiling and slits in a wall.

The shaft from the ceiling meets the figure, whose shadow is then seen in the air as well as on the floor. Ceiling,
walls and floor are closed slabs 0.3 m thick, so that no light leaks in at the edges whichever faces a shadow map draws.
Interior: 6 m wide (x), 4.2 m high, 7 m deep (z), the figure on the z axis. 4,968 triangles.
"""

from __future__ import annotations

import math
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.scene.bundled import textures
from tyndall.scene.bundled.primitives import (
    Floats,
    Geometry,
    cuboid,
    ellipsoid,
    lathe,
    limb,
    merge,
    pierced_wall,
    project_onto,
    refine,
    rotation,
    rounded_box,
    scaling,
    slab_with_oculus,
    smooth_union,
    surface_nets,
    translation,
)
from tyndall.scene.bundled.sunlight import Options, suns
from tyndall.scene.model import Camera, HenyeyGreenstein, Instance, Material, Medium, Scene

TRIANGLES = 4968

WIDTH, HEIGHT, DEPTH, WALL = 6.0, 4.2, 7.0, 0.3
FRONT, BACK = 3.7, -3.3  # z of the inner faces
PLINTH = 0.62
OCULUS, OCULUS_RADIUS = (-1.65, -0.95), 0.72
SUN = (0.47, -0.83, 0.25)


def fox(p: NDArray[np.floating[Any]]) -> Floats:
    """Signed value of a sitting fox, 1.2 units tall, that looks along +Z; an approximate distance."""
    x = np.abs(p[..., 0])
    mirrored = np.stack([x, p[..., 1], p[..., 2]], -1)
    body = limb(p, (0, 0.27, -0.17), (0, 0.64, 0.04), 0.225, 0.165)
    body = smooth_union(body, ellipsoid(p, (0, 0.52, 0.1), (0.155, 0.22, 0.13)), 0.08)
    body = smooth_union(body, limb(p, (0, 0.66, 0.05), (0, 0.88, 0.1), 0.14, 0.1), 0.08)
    body = smooth_union(body, ellipsoid(mirrored, (0.165, 0.2, -0.04), (0.115, 0.19, 0.2)), 0.05)
    body = smooth_union(body, limb(mirrored, (0.2, 0.05, 0.0), (0.2, 0.05, 0.19), 0.062, 0.058), 0.05)
    body = smooth_union(body, limb(mirrored, (0.09, 0.5, 0.12), (0.085, 0.07, 0.2), 0.075, 0.054), 0.06)
    body = smooth_union(body, ellipsoid(mirrored, (0.085, 0.045, 0.24), (0.062, 0.055, 0.08)), 0.04)
    body = smooth_union(body, ellipsoid(p, (0.05, 0.03, 0), (0.38, 0.05, 0.4)), 0.04)
    head = ellipsoid(p, (0, 0.945, 0.12), (0.15, 0.128, 0.145))
    head = smooth_union(head, ellipsoid(mirrored, (0.1, 0.9, 0.13), (0.088, 0.07, 0.095)), 0.06)
    head = smooth_union(head, limb(p, (0, 0.905, 0.2), (0, 0.877, 0.385), 0.084, 0.042), 0.05)
    head = smooth_union(head, ellipsoid(p, (0, 0.897, 0.408), (0.038, 0.032, 0.034)), 0.02)
    flattened = mirrored * (1, 1, 1.5)
    ear = limb(flattened, (0.1, 1.02, 0.08 * 1.5), (0.145, 1.2, 0.06 * 1.5), 0.08, 0.03)
    hollow = limb(mirrored, (0.105, 1.04, 0.175), (0.14, 1.17, 0.135), 0.05, 0.02)
    ear = -smooth_union(-ear, hollow, 0.03)
    head = smooth_union(head, ear, 0.03)
    body = smooth_union(body, head, 0.05)
    joints = [
        (0, 0.12, -0.34),
        (0.25, 0.1, -0.42),
        (0.42, 0.1, -0.24),
        (0.43, 0.1, 0.04),
        (0.33, 0.095, 0.26),
        (0.2, 0.07, 0.37),
    ]
    radii = (0.08, 0.095, 0.11, 0.12, 0.09, 0.045)
    bones = zip(joints[:-1], joints[1:], radii[:-1], radii[1:], strict=True)
    tail = reduce(lambda a, b: smooth_union(a, b, 0.05), (limb(p, a, b, ra, rb) for a, b, ra, rb in bones))
    body = smooth_union(body, tail, 0.06)
    return np.asarray(body)


def _room() -> tuple[Geometry, Geometry]:
    """Floor; and walls with ceiling.

    Each wall has two leaves. A shadow map of back faces then holds the back of the outer leaf, half a wall in front of
    the inner surface, and the corners of the room need no bias to be dark. Openings of the outer leaf are wider.
    """
    x0, x1, half = -WIDTH / 2, WIDTH / 2, WALL / 2
    low, high = -half, HEIGHT + half
    floor = cuboid((x0 - WALL, -WALL, BACK - WALL), (x1 + WALL, 0, FRONT + WALL))
    length = FRONT - BACK + 2 * WALL
    slits = [(z, 1.35 - low, z + 0.3, 3.45 - low) for z in (2.35, 3.2, 4.05)]
    recess = [(2.25, 1.25 - low, 4.45, 3.55 - low)]
    # A pierced wall is made in XY with its length along X; a quarter turn about Y puts its length along -Z.
    upright = translation(x0 - WALL, low, FRONT + WALL) @ rotation("y", math.pi / 2)
    left = [
        pierced_wall((length, high - low), half, holes).placed(upright @ translation(0, 0, offset))
        for holes, offset in ((recess, 0.0), (slits, half))
    ]
    ceiling = slab_with_oculus(
        (x0 - WALL, HEIGHT, BACK - WALL), (x1 + WALL, HEIGHT + half, FRONT + WALL), OCULUS, OCULUS_RADIUS, 32
    )
    reach = OCULUS_RADIUS + 0.2
    across, along = OCULUS[0] - x0 + WALL, FRONT + WALL - OCULUS[1]
    roof = pierced_wall(
        (WIDTH + 2 * WALL, length), half, [(across - reach, along - reach, across + reach, along + reach)]
    ).placed(translation(x0 - WALL, HEIGHT + half, FRONT + WALL) @ rotation("x", -math.pi / 2))
    plain = []
    for near, far in ((0.0, half), (half, WALL)):
        plain += [
            cuboid((x1 + near, low, BACK - WALL), (x1 + far, high, FRONT + WALL)),
            cuboid((x0 - WALL, low, BACK - far), (x1 + WALL, high, BACK - near)),
            cuboid((x0 - WALL, low, FRONT + near), (x1 + WALL, high, FRONT + far)),
        ]
    return floor, merge([*left, *plain, ceiling, roof])


def _skirting() -> Geometry:
    x0, x1, h, d = -WIDTH / 2, WIDTH / 2, 0.14, 0.03
    return merge(
        [
            cuboid((x0, 0, BACK), (x0 + d, h, FRONT)),
            cuboid((x1 - d, 0, BACK), (x1, h, FRONT)),
            cuboid((x0 + d, 0, BACK), (x1 - d, h, BACK + d)),
        ]
    )


def _plinth() -> Geometry:
    """A turned stone drum with base and top mouldings, closed."""
    profile = [
        (0, 0), (0.6, 0), (0.6, 0.07), (0.53, 0.12), (0.53, 0.5), (0.585, 0.545), (0.585, 0.605), (0.57, PLINTH),
        (0, PLINTH),
    ]  # fmt: skip
    return lathe(profile, 28)


def box(lights: int = 1, seed: int = 0) -> Scene:
    """A fox of clay in a plaster room: the sun from a round skylight meets it and casts its shadow through the air.

    Args:
        lights: 1 to 32 directional lights.
        seed: of the textures.

    Raises:
        ParameterError: ``lights`` or ``seed`` is not a whole number in range.
    """
    options = Options(lights, seed)
    rng = np.random.default_rng(options.seed)
    plaster = Material(
        "plaster", roughness=0.95, base_color=(1, 1, 1, 1),
        base_color_texture=textures.mottled(
            rng, "plaster", (0.80, 0.74, 0.66), (0.90, 0.86, 0.79), beta=2.2, metres=2.5
        ),
    )  # fmt: skip
    paved = Material(
        "floor", roughness=0.55, base_color=(1, 1, 1, 1),
        base_color_texture=textures.paving(
            rng, "floor", (0.42, 0.33, 0.27), (0.60, 0.49, 0.41), (0.25, 0.21, 0.18), across=5, metres=2.6
        ),
    )  # fmt: skip
    stone = Material(
        "stone", roughness=0.7, base_color=(1, 1, 1, 1),
        base_color_texture=textures.mottled(rng, "stone", (0.62, 0.61, 0.60), (0.80, 0.79, 0.76), beta=1.6, metres=0.8),
    )  # fmt: skip
    clay = Material(
        "clay", roughness=0.45, base_color=(1, 1, 1, 1),
        base_color_texture=textures.mottled(rng, "clay", (0.66, 0.33, 0.19), (0.80, 0.46, 0.28), beta=1.4, metres=0.7),
    )  # fmt: skip
    oak = Material(
        "oak", roughness=0.6, base_color=(1, 1, 1, 1),
        base_color_texture=textures.wood(rng, "oak", (0.42, 0.28, 0.17), (0.62, 0.45, 0.29), size=256),
    )  # fmt: skip
    glaze = Material("glaze", base_color=(0.05, 0.16, 0.24, 1), roughness=0.25)

    floor, walls = _room()
    cube = rounded_box((-0.24, 0, -0.24), (0.24, 0.48, 0.24), 0.02).at(1.75, 0, 0.3, 0.5)
    jar = lathe(
        [(0, 0), (0.14, 0), (0.22, 0.12), (0.25, 0.27), (0.22, 0.43), (0.12, 0.54), (0.1, 0.6), (0.15, 0.68),
         (0.13, 0.68), (0.08, 0.6), (0, 0.5)], 16
    ).at(-1.75, 0, 0.35)  # fmt: skip
    rest = {
        "floor": (floor, paved),
        "walls": (walls, plaster),
        "skirting": (_skirting(), oak),
        "plinth": (_plinth().at(0, 0, -0.15), stone),
        "cube": (cube, oak),
        "jar": (jar, glaze),
    }
    figure = surface_nets(fox, (-0.46, -0.09, -0.6), (0.65, 1.3, 0.5), 0.049)
    missing = TRIANGLES - figure.triangle_count - sum(part.triangle_count for part, _ in rest.values())
    figure = refine(figure, missing, lambda points: project_onto(fox, points))
    rest["fox"] = (figure.placed(scaling(1.25, 1.25, 1.25)).at(-0.06, PLINTH - 0.004, -0.15, -0.3), clay)

    return Scene(
        instances=tuple(Instance(part.mesh(material, name), name=name) for name, (part, material) in rest.items()),
        lights=suns(options.lights, SUN, 10.0, (1.0, 0.93, 0.82), (46, 72)),
        camera=Camera((0.7, 1.35, 2.75), (-0.08, 1.52, -0.6), fov=math.radians(57), exposure=1.6),
        medium=Medium(
            (0.16,) * 3, (0.01,) * 3, HenyeyGreenstein(0.4),
            ((-WIDTH / 2 - WALL, -WALL, BACK - WALL), (WIDTH / 2 + WALL, HEIGHT + WALL, FRONT + WALL)),
        ),
        background=(0.9, 1.25, 1.9),
        ambient=(0.2, 0.2, 0.21),
        looks={
            "screen_space": {"exposure": 1.0, "decay": 0.94, "weight": 0.01},
            "polygonal": {"g": 0.4, "tau": 0.3},
            "froxel": {"g": 0.4, "z_limit": 17.6, "density": 1.0, "c_s": 0.1},
        },
        name="box",
    )  # fmt: skip
