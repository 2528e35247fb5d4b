"""What tests put before the camera, and what the closed forms say that the camera must see.

The rays, boxes and closed forms here are written from the definitions, in float64, and share no code with the engine.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tyndall.frame import Renderer
from tyndall.gpu.device import Gpu
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    Gibbons,
    HenyeyGreenstein,
    Implicit,
    Instance,
    Light,
    Material,
    Mesh,
    Phase,
    Rayleigh,
    RectLight,
    Scene,
    Schlick,
    SpotLight,
    Vec3,
)
from tyndall.sdf import box as box_shape
from tyndall.sdf import sphere
from tyndall.techniques.contract import Technique
from tyndall.techniques.shadow.shadow_map import ShadowMap

Floats = NDArray[np.float64]

AHEAD = Camera(position=(0, 0, 0), target=(0, 0, -1), fov=0.9, near=0.05)
WHITE = Material("white", base_color=(1, 1, 1, 1), roughness=1.0)
TINY = (16, 12)


# --- geometry -----------------------------------------------------------------------------------------------------


def quad(a: Vec3, b: Vec3, c: Vec3, d: Vec3, material: Material = WHITE) -> Instance:
    """A quadrilateral whose corners run counter-clockwise seen from its front; uv (0, 0) at ``a``, (1, 1) at ``c``."""
    uvs = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    return Instance(Mesh(np.array([a, b, c, d]), np.array([(0, 1, 2), (0, 2, 3)]), uvs=uvs, material=material))


def wall(z: float, half: float = 20.0, material: Material = WHITE) -> Instance:
    """A square across the view of :data:`AHEAD`, facing +z."""
    return quad((-half, -half, z), (half, -half, z), (half, half, z), (-half, half, z), material)


def floor(y: float, half: float = 20.0, material: Material = WHITE) -> Instance:
    """A level square that faces up."""
    return quad((-half, y, half), (half, y, half), (half, y, -half), (-half, y, -half), material)


def box(low: Vec3, high: Vec3, material: Material = WHITE) -> Instance:
    """A closed box with its faces outward and flat normals."""
    sides = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side, end in ((0, low), (1, high)):
            corners = np.empty((4, 3))
            corners[:, axis] = end[axis]
            corners[:, u] = [low[u], high[u], high[u], low[u]]
            corners[:, v] = [low[v], low[v], high[v], high[v]]
            sides.append(corners if side else corners[::-1])
    first = 4 * np.arange(6)[:, None]
    indices = np.concatenate([first + (0, 1, 2), first + (0, 2, 3)])
    positions = np.concatenate(sides)
    return Instance(Mesh(positions, indices, face_normals(positions, indices), material=material))


def boards(length: float, width: float, count: int, material: Material = WHITE) -> Instance:
    """A level plane of boards along z, side by side, that faces up."""
    x = (np.arange(count + 1) - count / 2) * width
    far, i = count + 1, np.arange(count)
    ends = [np.stack([x, 0 * x, np.full_like(x, z)], 1) for z in (length / 2, -length / 2)]
    sides = [np.stack(corners, 1) for corners in ((i, i + 1, i + far + 1), (i, i + far + 1, i + far))]
    return Instance(Mesh(np.concatenate(ends), np.concatenate(sides), material=material))


@dataclass(frozen=True)
class Turn:
    """A rotation (3, 3) of a whole scene."""

    matrix: Floats

    def point(self, x: float, y: float, z: float) -> Vec3:
        """A point or direction turned."""
        a, b, c = (float(value) for value in self.matrix @ (x, y, z))
        return a, b, c

    def place(self, instance: Instance) -> Instance:
        """A shape turned."""
        transform = np.eye(4)
        transform[:3, :3] = self.matrix
        return Instance(instance.mesh, tuple(tuple(float(x) for x in row) for row in transform))  # type: ignore[arg-type]


def turned(about_z: float, about_y: float) -> Turn:
    """Turned about y, then about z, in radians: by odd angles nothing lies along an axis."""
    c, s, cy, sy = math.cos(about_z), math.sin(about_z), math.cos(about_y), math.sin(about_y)
    return Turn(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]) @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]]))


def face_normals(positions: Floats, indices: NDArray[Any]) -> Floats:
    """The normals (V, 3) of flat faces that share no vertices."""
    a, b, c = (positions[indices[:, i]] for i in range(3))
    n = np.cross(b - a, c - a)
    normals = np.zeros_like(positions)
    for corner in range(3):
        normals[indices[:, corner]] = n / np.linalg.norm(n, axis=1, keepdims=True)
    return normals


def slits(z: float, half: float, width: float, count: int, material: Material = WHITE) -> list[Instance]:
    """A wall of ``count`` upright boards across z with gaps of ``width`` between them."""
    pitch = 2 * half / count
    return [
        box((-half + i * pitch, -half, z - 0.05), (-half + (i + 1) * pitch - width, half, z), material)
        for i in range(count)
    ]


def fields(*implicits: Implicit, specks: Vec3 = (0, -0.5, 0), material: Material = Material()) -> tuple[Implicit, ...]:
    """Implicit surfaces with specks that nobody sees: four in all, of balls and boxes, so that scenes share shaders."""
    shapes = (sphere(1e-6), box_shape(1e-6), sphere(1e-6), sphere(1e-6))
    extra = [Implicit(shape.at(*specks), material=material) for shape in shapes]
    return (*extra[: 4 - len(implicits)], *implicits)


# --- what a camera sees -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Rays:
    """One ray through each pixel's centre: origin (3,), unit directions (H, W, 3), distance per metre of view depth."""

    origin: Floats
    directions: Floats
    stretch: Floats

    def at(self, distance: ArrayLike) -> Floats:
        """Points at a distance (H, W) along the rays."""
        return self.origin + self.directions * np.asarray(distance)[..., None]


def rays(camera: Camera, size: tuple[int, int]) -> Rays:
    """The rays of a pinhole camera; pixel centres at +0.5, first row on top."""
    width, height = size
    forward = np.subtract(camera.target, camera.position)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    tangent = math.tan(camera.fov / 2)
    x = (2 * (np.arange(width) + 0.5) / width - 1) * tangent * width / height
    y = (1 - 2 * (np.arange(height) + 0.5) / height) * tangent
    through = forward + x[None, :, None] * right + y[:, None, None] * up
    stretch = np.linalg.norm(through, axis=2)
    return Rays(np.array(camera.position, float), through / stretch[..., None], stretch)


def hit_box(origin: ArrayLike, directions: ArrayLike, low: ArrayLike, high: ArrayLike) -> tuple[Floats, Floats]:
    """Distances at which rays enter and leave a box; entry > exit where they miss."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a = (np.asarray(low) - origin) / directions
        b = (np.asarray(high) - origin) / directions
    return np.fmax.reduce(np.fmin(a, b), axis=-1), np.fmin.reduce(np.fmax(a, b), axis=-1)


@dataclass(frozen=True)
class Hit:
    """Where rays meet a scene first: distance (…), inf for none; face normal towards the ray (…, 3); uv (…, 2)."""

    distance: Floats
    normal: Floats
    uv: Floats
    instance: NDArray[np.int64]


def cast(scene: Scene, origins: ArrayLike, directions: ArrayLike, *, skip_holes: bool = True) -> Hit:
    """Intersect rays with all triangles of a scene (Möller and Trumbore 1997), by brute force.

    With ``skip_holes`` a masked material's texels below the cutoff, looked up without filtering, let the ray pass.
    """
    directions = np.asarray(directions, float)
    origins = np.broadcast_to(np.asarray(origins, float), directions.shape)
    best = Hit(
        np.full(directions.shape[:-1], np.inf),
        np.zeros(directions.shape),
        np.zeros((*directions.shape[:-1], 2)),
        np.full(directions.shape[:-1], -1),
    )
    for number, instance in enumerate(scene.instances):
        matrix, mesh = np.asarray(instance.transform), instance.mesh
        world = mesh.positions.astype(float) @ matrix[:3, :3].T + matrix[:3, 3]
        for corners in mesh.indices:
            a, b, c = world[corners]
            e1, e2 = b - a, c - a
            p = np.cross(directions, e2)
            with np.errstate(divide="ignore", invalid="ignore"):
                inverse = 1 / (p @ e1)
                s = origins - a
                u = (s * p).sum(-1) * inverse
                q = np.cross(s, e1)
                v = (q * directions).sum(-1) * inverse
                t = (q @ e2) * inverse
                found = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-6) & (t < best.distance)
            uv = np.zeros((*found.shape, 2))
            if mesh.uvs is not None:
                ua, ub, uc = mesh.uvs[corners].astype(float)
                uv[found] = ua + u[found, None] * (ub - ua) + v[found, None] * (uc - ua)
            material = mesh.material
            if skip_holes and material.alpha_mode == "mask":
                found &= _alpha(material, uv) >= material.alpha_cutoff
            n = np.cross(e1, e2)
            n = n / np.linalg.norm(n) * np.where((directions @ n) > 0, -1.0, 1.0)[..., None]
            best.distance[found], best.normal[found] = t[found], n[found]
            best.uv[found], best.instance[found] = uv[found], number
    return best


def _alpha(material: Material, uv: Floats) -> Floats:
    alpha = np.full(uv.shape[:-1], material.base_color[3])
    if material.base_color_texture is not None:
        pixels = material.base_color_texture.image.pixels
        x = np.floor(uv[..., 0] % 1 * pixels.shape[1]).astype(int)
        y = np.floor(uv[..., 1] % 1 * pixels.shape[0]).astype(int)
        alpha = alpha * pixels[y, x, 3] / 255
    return alpha


def lit(scene: Scene, light: Light, points: Floats) -> NDArray[np.bool_]:
    """Whether nothing of the scene stands between points (…, 3) and a light."""
    if isinstance(light, DirectionalLight):
        towards = np.broadcast_to(-np.array(light.direction) / np.linalg.norm(light.direction), points.shape)
        reach = np.full(points.shape[:-1], np.inf)
    else:
        way = np.array(light.position) - points
        reach = np.linalg.norm(way, axis=-1)
        towards = way / reach[..., None]
    start = points + 1e-4 * towards
    return cast(scene, start, towards).distance >= reach - 2e-4


def phase(model: Phase, cosine: ArrayLike) -> Floats:
    """Phase functions as in their papers, 1/sr."""
    c = np.asarray(cosine, float)
    match model:
        case HenyeyGreenstein(g):
            return (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * c) ** 1.5)
        case Rayleigh():
            return 3 / (16 * np.pi) * (1 + c * c)
        case Gibbons():
            return (1 + 9 * np.cos(np.arccos(np.clip(c, -1, 1)) / 2) ** 16) / (8 * np.pi)
        case Schlick(k):
            return (1 - k * k) / (4 * np.pi * (1 - k * c) ** 2)
        case _:
            return np.full_like(c, 1 / (4 * np.pi))


def slab(sigma: ArrayLike, length: ArrayLike) -> Floats:
    """∫₀^length e^(−σs) ds for σ (3,) and lengths (H, W) → (H, W, 3); an infinite length is allowed where σ > 0."""
    sigma, length = np.asarray(sigma, float), np.asarray(length, float)[..., None]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(sigma > 0, -np.expm1(-sigma * length) / np.where(sigma > 0, sigma, 1), length)


def lit_slab(scene: Scene, size: tuple[int, int], begin: ArrayLike, end: ArrayLike, start: ArrayLike = 0.0) -> Floats:
    """Light (H, W, 3) that the scene's directional lights scatter towards the camera between two distances.

    ``L = σs·p(θ)·E·e^(−σt·(begin − start))·(1 − e^(−σt·(end − begin)))/σt``; ``start`` is where the medium begins.
    """
    medium, seen = scene.medium, rays(scene.camera, size)
    shape = seen.stretch.shape
    begin, end, start = (np.broadcast_to(np.asarray(x, float), shape) for x in (begin, end, start))
    total = np.zeros((*shape, 3))
    for light in scene.lights:
        assert isinstance(light, DirectionalLight)
        travels = np.array(light.direction) / np.linalg.norm(light.direction)
        p = phase(medium.phase, -(seen.directions @ travels))
        total += p[..., None] * light.intensity * np.array(light.color)
    dimmed = np.exp(-np.array(medium.extinction) * (begin - start)[..., None])
    return np.array(medium.scattering) * total * dimmed * slab(medium.extinction, np.maximum(end - begin, 0))


def quadrature(scene: Scene, light: Light, size: tuple[int, int], begin: ArrayLike, end: ArrayLike) -> Floats:
    """Unshadowed single scattering (H, W, 3) of a near light between two distances, by Gauss–Legendre; a rectangle's as
    from its mean direction.

    The medium must hold both the camera and the light.
    """
    nodes, weights = np.polynomial.legendre.leggauss(256)
    medium, seen = scene.medium, rays(scene.camera, size)
    begin, end = (np.broadcast_to(np.asarray(x, float), seen.stretch.shape) for x in (begin, end))
    sigma = np.array(medium.extinction)
    total = np.zeros((*seen.stretch.shape, 3))
    for node, weight in zip(nodes, weights, strict=True):
        s = begin + (end - begin) * (node + 1) / 2
        irradiance, travels = arriving(light, sigma, seen.at(s))
        if isinstance(light, RectLight):
            irradiance = irradiance * fluence_ratio(light, seen.at(s))[..., None]
        p = phase(medium.phase, -(travels * seen.directions).sum(-1))
        total += (weight / 2 * (end - begin) * p)[..., None] * irradiance * np.exp(-sigma * s[..., None])
    return np.array(medium.scattering) * total


def arriving(light: Light, sigma: ArrayLike, points: Floats) -> tuple[Floats, Floats]:
    """Irradiance (…, 3) of a surface that faces the light, and its unit direction of travel (…, 3), at points."""
    colour = light.intensity * np.array(light.color)
    if isinstance(light, DirectionalLight):
        travels = np.array(light.direction) / np.linalg.norm(light.direction)
        return np.broadcast_to(colour, points.shape), np.broadcast_to(travels, points.shape)
    way = points - np.array(light.position)
    r = np.linalg.norm(way, axis=-1, keepdims=True)
    if isinstance(light, RectLight):
        vector = vector_irradiance(light, points)
        size = np.linalg.norm(vector, axis=-1, keepdims=True)
        return size * colour * np.exp(-np.asarray(sigma) * r), np.where(
            size > 0, -vector / np.maximum(size, 1e-30), way / r
        )
    irradiance = colour / r**2 * np.exp(-np.asarray(sigma) * r)
    if isinstance(light, SpotLight):
        # The formula of KHR_lights_punctual.
        axis = np.array(light.direction) / np.linalg.norm(light.direction)
        scale = 1 / (math.cos(light.inner_angle) - math.cos(light.outer_angle))
        offset = -math.cos(light.outer_angle) * scale
        irradiance = irradiance * np.clip((way / r) @ axis * scale + offset, 0, 1)[..., None] ** 2
    return irradiance, way / r


def _corners(light: RectLight, points: Floats) -> tuple[list[Floats], Floats]:
    """The ways (…, 3) from points to a rectangle's corners, and whether the points are before it."""
    across, along = light.axes
    way = np.array(light.position) - points
    ways = [way + u * across + v * along for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return ways, (way @ np.array(light.direction) < 0).astype(float)


def vector_irradiance(light: RectLight, points: Floats) -> Floats:
    """Lambert's sum over the sides of a rectangle of 1 cd, (…, 3) towards it: the angle that each fills by its plane's
    normal; 0 behind it.
    """
    ways, before = _corners(light, points)
    units = [way / np.linalg.norm(way, axis=-1, keepdims=True) for way in ways]
    total = np.zeros(points.shape)
    for a, b in zip(units, [*units[1:], units[0]], strict=True):
        normal = np.cross(a, b)
        sine = np.linalg.norm(normal, axis=-1)
        total += (np.arctan2(sine, (a * b).sum(-1)) / np.maximum(sine, 1e-30))[..., None] * normal
    return 0.5 / (light.width * light.height) * total * before[..., None]


def fluence_ratio(light: RectLight, points: Floats) -> Floats:
    """The solid angle (…) that a rectangle fills over the irradiance that its radiance gives a surface facing it."""
    (a, b, c, d), before = _corners(light, points)
    angle = np.zeros(points.shape[:-1])
    for p, q, r in ((a, b, c), (a, c, d)):  # Van Oosterom and Strackee 1983
        lengths = [np.linalg.norm(x, axis=-1) for x in (p, q, r)]
        below = np.prod(lengths, axis=0)
        for x, y, z in ((p, q, 2), (q, r, 0), (r, p, 1)):
            below = below + (x * y).sum(-1) * lengths[z]
        angle += 2 * np.arctan2(np.abs((p * np.cross(q, r)).sum(-1)), below)
    size = np.linalg.norm(vector_irradiance(light, points), axis=-1) * light.width * light.height
    return np.where(before > 0, angle / np.maximum(size, 1e-30), 1.0)


def reflected(
    material: Material, normal: ArrayLike, to_viewer: ArrayLike, to_light: ArrayLike, albedo: ArrayLike | None = None
) -> Floats:
    """Metallic-roughness BRDF times cos θ_l for unit vectors (…, 3): glTF's gloss over Shirley 1997's matte base."""
    n, v, l = (np.asarray(x, float) for x in (normal, to_viewer, to_light))
    color = np.array(material.base_color[:3]) if albedo is None else np.asarray(albedo)
    h = v + l
    h = h / np.linalg.norm(h, axis=-1, keepdims=True)

    def dot(a: Floats, b: Floats) -> Floats:
        return (a * b).sum(-1, keepdims=True)

    n_l, n_v, n_h, l_h = np.maximum(dot(n, l), 0), np.maximum(np.abs(dot(n, v)), 1e-4), dot(n, h), dot(l, h)
    a2 = max(material.roughness**2, 2e-3) ** 2
    d = a2 / (np.pi * (n_h**2 * (a2 - 1) + 1) ** 2)
    g = 0.5 / (n_l * np.sqrt(n_v**2 * (1 - a2) + a2) + n_v * np.sqrt(n_l**2 * (1 - a2) + a2))
    f0 = 0.04 + (color - 0.04) * material.metallic
    f = f0 + (1 - f0) * (1 - l_h) ** 5
    gloss = 1 - material.roughness
    through = 0.96 / (1 - gloss / 21) * (1 - gloss * (1 - n_l) ** 5) * (1 - gloss * (1 - n_v) ** 5)
    return np.where(n_l > 0, (through * color * (1 - material.metallic) / np.pi + f * d * g) * n_l, 0.0)


def surface_light(scene: Scene, size: tuple[int, int], normal: ArrayLike, distance: ArrayLike) -> Floats:
    """Unshadowed radiance (H, W, 3) of the first instance's material, of normals (…, 3), at distances."""
    seen = rays(scene.camera, size)
    material = scene.instances[0].mesh.material
    total = np.zeros((*seen.stretch.shape, 3)) + np.array(scene.ambient) * material.base_color[:3] + material.emissive
    for light in scene.lights:
        irradiance, travels = arriving(light, np.array(scene.medium.extinction), seen.at(distance))
        total += irradiance * reflected(material, np.array(normal, float), -seen.directions, -travels)
    return total


# --- the engine ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Shot:
    """What a renderer drew, read back: see the methods of :class:`tyndall.frame.Renderer` of these names."""

    inscattered: Floats
    transmittance: Floats
    base: Floats
    radiance: Floats
    depth: Floats
    picture: NDArray[np.uint8]
    memory: dict[str, int]


def shoot(
    gpu: Gpu,
    scene: Scene,
    size: tuple[int, int] = TINY,
    *,
    volumetric: str | Technique = "off",
    shadow: str | Technique = ShadowMap(size=512),
    antialiasing: str | Technique = "none",
    tonemap: str | Technique = "none",
    frames: int = 1,
    seed: int = 0,
) -> Shot:
    """Draw a scene and read everything back."""
    with Renderer(
        scene,
        size,
        gpu=gpu,
        volumetric=volumetric,
        shadow=shadow,
        antialiasing=antialiasing,
        tonemap=tonemap,
        seed=seed,
    ) as renderer:
        for _ in range(frames):
            renderer.draw()
        return read(renderer)


def read(renderer: Renderer) -> Shot:
    """Everything that can be read back from a renderer's last frame."""
    return Shot(
        renderer.inscattered().astype(float),
        renderer.transmittance().astype(float),
        renderer.base().astype(float),
        renderer.radiance().astype(float),
        renderer.depth().astype(float),
        renderer.picture(),
        renderer.memory(),
    )


@contextlib.contextmanager
def module(gpu: Gpu, name: str, text: str) -> Iterator[str]:
    """A WESL module ``package::name`` for a while; the name must be new, since pipelines are cached by it."""
    path, linker = f"package::{name}", gpu.linker
    linker.modules[path], linker.filenames[path] = text, f"{name}.wesl"
    linker.__dict__.pop("_compiler", None)
    try:
        yield path
    finally:
        del linker.modules[path], linker.filenames[path]
        linker.__dict__.pop("_compiler", None)


def evaluate(
    gpu: Gpu, name: str, text: str, inputs: NDArray[np.float32], scope: Mapping[str, Any] | None = None
) -> NDArray[np.float32]:
    """Run ``fn evaluate(x: vec4f) -> vec4f`` of a WESL text on rows (N, 4); the module's name must be new.

    ``scope`` binds what the text imports from ``package::bindings``.
    """
    rows = np.ascontiguousarray(inputs, np.float32)
    source = gpu.buffer("test.in", rows, owner="test", element="vec4f")
    target = gpu.buffer("test.out", rows.nbytes, owner="test", element="vec4f")
    body = """
        import package::bindings::{inputs, outputs};
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3u) {
            if id.x < arrayLength(&inputs) {
                outputs[id.x] = evaluate(inputs[id.x]);
            }
        }
    """
    imports, rest = _split_imports(text)
    try:
        with module(gpu, name, imports + body + rest) as path:
            gpu.compute(name, path).bind(scope, inputs=source.read(), outputs=target.read_write()).dispatch(len(rows))
            raw = gpu.read_buffer(target)
    finally:
        source.destroy()
        target.destroy()
        gpu.forget_groups()
    return raw.view(np.float32).reshape(rows.shape).copy()


def _split_imports(text: str) -> tuple[str, str]:
    lines = text.splitlines()
    imports = [line for line in lines if line.strip().startswith("import")]
    return "\n".join(imports) + "\n", "\n".join(line for line in lines if not line.strip().startswith("import"))


def difference(a: Any, b: Any) -> float:
    """Root mean square of a − b relative to the mean of |b|."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    return float(np.sqrt(np.mean((a - b) ** 2)) / np.mean(np.abs(b)))


def shade(
    gpu: Gpu,
    scene: Scene,
    shadow: str | Technique,
    size: tuple[int, int],
    *,
    frames: int = 1,
    camera: Camera | None = None,
) -> Floats:
    """(H, W): what of the light reaches what each pixel shows, a mean over frames; 1 where there is none to lose."""
    with Renderer(scene, size, gpu=gpu, volumetric="off", antialiasing="none", shadow=shadow) as renderer:
        renderer.draw(camera, casters=False)
        full = renderer.base()[..., 0].astype(float)
        got = np.zeros_like(full)
        for _ in range(frames):
            renderer.draw(camera)
            got += renderer.base()[..., 0] / frames
    return np.where(full > 0, got / np.where(full > 0, full, 1), 1)


def sheet_edge(light: Light, height: float, half: float = 3.0, edge: float = 0.0) -> Scene:
    """A wall at z = −3 before :data:`AHEAD`, and a sheet ``height`` metres above it, over all x < ``edge``."""
    z = height - 3
    sheet = quad((-half, -half, z), (edge, -half, z), (edge, half, z), (-half, half, z))
    return Scene([wall(-3, half), sheet], [light], AHEAD)


def disk_part(x: ArrayLike) -> Floats:
    """The part of a unit disk on the near side of a line at x, −1 … 1: what a straight edge leaves of a round light."""
    s = np.clip(np.asarray(x, float), -1, 1)
    return (np.arccos(-s) + s * np.sqrt(1 - s * s)) / np.pi
