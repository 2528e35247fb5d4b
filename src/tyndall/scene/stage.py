"""A stage for what comes without one: camera, ground, light and air around a mesh file, a mesh or a shape.

Everything is in proportion to the object's radius r, half the diagonal of its bounding box, so that a bunny of 15 cm
and a part of 80 "metres" (an STL in millimetres) give the same picture:

- a camera in three-quarter view, the object 60 % of the picture's height (and at most 85 % of its width at 4:3);
- a grey ground of 16 r by 16 r under the object's lowest point, +Y up;
- a spot light above, to the side and a little behind, 4.5 r away, whose cone holds the object and some ground. Its
  candelas give a white surface that faces it the radiance 1.5 in the middle of the stage, air included:
  E = I·e^(−σt·D)/D² and L = ρE/π (Lambert). What slants away, is not white and is seen through the air then has 0.3 to
  0.8, which is well exposed at exposure 0;
- weak ambient light;
- air in the box over the ground, of an optical depth of 0.6 along the middle of the view, that scatters forwards
  (Henyey–Greenstein, g = 0.3) and absorbs little: it makes the cone, and the shadow in it, visible.

A file's own camera means that the file is a picture already: it gets no ground. A file's own lights stay the only
ones. A medium that the scene has is kept.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tyndall.scene.model import (
    Camera,
    HenyeyGreenstein,
    Implicit,
    Instance,
    Material,
    Medium,
    Mesh,
    Scene,
    Solid,
    SpotLight,
    Vec3,
    box_corners,
)

FILL = 0.6  # of the picture's height
WIDEST = 0.85  # of the picture's width
ASPECT = 4 / 3  # the narrowest picture for which WIDEST holds
FOV = math.radians(35)
VIEW = (30.0, 15.0)  # the camera's azimuth from +Z towards +X, and its elevation, degrees
LIGHT = (VIEW[0] - 105.0, 52.0)  # the same of the light: from the left, a little behind
GROUND = 8.0  # half the ground's side, in r
LIGHT_DISTANCE = 4.5  # in r
POOL = 1.25  # radius of the light's cone around the object, in r
RADIANCE = 1.5  # of a white surface that faces the light
OPTICAL_DEPTH = 0.6
ALBEDO = 0.95  # of the air: scattering / extinction
AMBIENT: Vec3 = (0.05, 0.055, 0.065)

_MOST_POINTS = 10_000  # vertices that framing looks at

Points = NDArray[np.float64]


def stage(scene: Scene | Mesh | Solid) -> Scene:
    """The scene with what it lacks: a camera (and then a ground), a light, a medium. See the module's description.

    A camera or medium equal to the default counts as lacking. A mesh or a solid shape becomes a scene of its own.

    Raises:
        ParameterError: a flat shape, or something else.
    """
    if isinstance(scene, Mesh):
        scene = Scene(instances=(Instance(scene),))
    elif not isinstance(scene, Scene):
        scene = Scene(implicits=(Implicit(scene),))
    low, high = scene.bounds
    centre = (low + high) / 2
    radius = float(np.linalg.norm(high - low)) / 2
    if radius == 0:
        radius = 1.0
    camera = scene.camera
    instances = scene.instances
    if camera == Camera():
        camera = _frame(_points(scene), centre, radius)
        instances = (*instances, _ground(centre, float(low[1]), radius))
    lower = (centre[0] - GROUND * radius, float(low[1]), centre[2] - GROUND * radius)
    upper = (centre[0] + GROUND * radius, float(low[1]) + GROUND * radius, centre[2] + GROUND * radius)
    medium = scene.medium if any(scene.medium.extinction) else _air(camera, lower, upper)
    lights = scene.lights or (_key(centre, radius, medium),)
    ambient = scene.ambient if scene.lights or any(scene.ambient) else AMBIENT
    return scene.with_(instances=instances, camera=camera, lights=lights, medium=medium, ambient=ambient)


def _direction(azimuth: float, elevation: float) -> Points:
    """Unit vector of an azimuth from +Z towards +X and an elevation, degrees."""
    a, e = math.radians(azimuth), math.radians(elevation)
    return np.array([math.sin(a) * math.cos(e), math.sin(e), math.cos(a) * math.cos(e)])


def _vec3(v: Points) -> Vec3:
    return float(v[0]), float(v[1]), float(v[2])


def _points(scene: Scene) -> Points:
    """(N, 3) points of the surface in the world: at most about ``_MOST_POINTS``, spread over all instances, and the
    corners of the boxes of implicit surfaces.
    """
    parts = [box_corners(*implicit.bounds) for implicit in scene.implicits if implicit.bounds is not None]
    if not scene.instances and not parts:
        return box_corners(*scene.bounds)
    total = sum(len(i.mesh.positions) for i in scene.instances)
    step = -(-total // _MOST_POINTS)
    skipped = 0
    for instance in scene.instances:
        chosen = instance.mesh.positions[skipped::step].astype(np.float64)
        skipped = (skipped - len(instance.mesh.positions)) % step
        matrix = np.asarray(instance.transform)
        parts.append(chosen @ matrix[:3, :3].T + matrix[:3, 3])
    return np.concatenate(parts)


def _frame(points: Points, centre: Points, radius: float) -> Camera:
    """A camera that looks at the middle of the points' picture from a distance at which they fill ``FILL`` of it."""
    back = _direction(*VIEW)
    right = np.cross((0.0, 1.0, 0.0), back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    local = (points - centre) @ np.stack([right, up, back], axis=1) / radius
    slope = math.tan(FOV / 2)
    distance, shift = 4.0, np.zeros(3)
    for _ in range(4):  # distance and middle depend on each other, a little

        def spans(d: float, at: Points = local - shift) -> tuple[Points, Points]:
            """Lower and upper corner of the points' picture; ±1 is the edge of the picture across its height."""
            picture = at[:, :2] / ((d - at[:, 2:]) * slope)
            return picture.min(axis=0), picture.max(axis=0)

        near, far = float((local - shift)[:, 2].max()) + 1e-3, 1e3
        for _ in range(40):
            distance = math.sqrt(near * far) if near > 0 else (near + far) / 2
            size = np.subtract(*spans(distance)[::-1]) / 2
            too_near = size[1] > FILL or size[0] > WIDEST * ASPECT
            near, far = (distance, far) if too_near else (near, distance)
        low, high = spans(distance)
        shift[:2] += (low + high) / 2 * distance * slope
    target = centre + radius * (shift[0] * right + shift[1] * up)
    distance = max(distance, 1.5) * radius
    return Camera(
        position=_vec3(target + distance * back), target=_vec3(target), fov=FOV, near=max(distance / 100, 1e-6)
    )


def _ground(centre: Points, height: float, radius: float) -> Instance:
    """A grey square; a unit mesh, so that its float32 corners are exact, and a transform that has the size."""
    square = Mesh(
        positions=np.array([(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)], np.float32),
        indices=np.array([(0, 1, 2), (0, 2, 3)], np.uint32),
        material=Material("ground", base_color=(0.5, 0.5, 0.5, 1.0), roughness=0.9),
        name="ground",
    )
    side = GROUND * radius
    transform = (
        (side, 0.0, 0.0, float(centre[0])),
        (0.0, side, 0.0, height),
        (0.0, 0.0, side, float(centre[2])),
        (0.0, 0.0, 0.0, 1.0),
    )
    return Instance(square, transform, "ground")


def _key(centre: Points, radius: float, medium: Medium) -> SpotLight:
    """The spot light; see the module's description for its candelas."""
    towards = _direction(*LIGHT)
    distance = LIGHT_DISTANCE * radius
    extinction = sum(medium.extinction) / 3
    outer = math.asin(POOL / LIGHT_DISTANCE)
    return SpotLight(
        position=_vec3(centre + distance * towards),
        direction=_vec3(-towards),
        intensity=math.pi * RADIANCE * distance**2 * math.exp(extinction * distance),
        inner_angle=0.8 * outer,
        outer_angle=outer,
    )


def _air(camera: Camera, lower: Vec3, upper: Vec3) -> Medium:
    """Air in a box, of ``OPTICAL_DEPTH`` along the middle of the view."""
    origin = np.array(camera.position)
    direction = np.subtract(camera.target, camera.position)
    direction /= np.linalg.norm(direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossings = np.sort([(np.array(corner) - origin) / direction for corner in (lower, upper)], axis=0)
    enters, leaves = max(0.0, float(np.nanmax(crossings[0]))), float(np.nanmin(crossings[1]))
    length = leaves - enters
    if not length > 0:  # the file's own camera looks past the stage
        length = upper[0] - lower[0]
    scattering, absorption = (fraction * OPTICAL_DEPTH / length for fraction in (ALBEDO, 1 - ALBEDO))
    return Medium((scattering,) * 3, (absorption,) * 3, HenyeyGreenstein(0.3), (lower, upper))
