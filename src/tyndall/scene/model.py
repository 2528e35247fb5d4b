"""What a user describes, as plain immutable data.

Units and conventions are glTF's: metres, right-handed, +Y up; a camera looks along its -Z; light is linear with Rec.709
primaries; directional lights are in lux (illuminance of a surface facing them), the others in candela.
Every number is declared once (:func:`tyndall.gpu.params.param`); what is outside its range raises a one-line
:class:`~tyndall.gpu.params.ParameterError`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal, Protocol, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tyndall.gpu.params import ParameterError, check, param

Vec2 = tuple[float, float]
Vec3 = tuple[float, float, float]
Vec4 = tuple[float, float, float, float]
Mat4 = tuple[Vec4, Vec4, Vec4, Vec4]

IDENTITY: Mat4 = ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))


class _Checked:
    def __post_init__(self) -> None:
        check(self)


# --- phase functions ----------------------------------------------------------------------------------------------
# cosθ is the angle between the light's direction of travel and the direction towards the viewer; all integrate to 1.


@dataclass(frozen=True)
class Isotropic(_Checked):
    """p = 1/4π: every direction alike."""

    kind: ClassVar[str] = "isotropic"


@dataclass(frozen=True)
class HenyeyGreenstein(_Checked):
    """Henyey and Greenstein 1941: p = (1−g²) / (4π (1+g²−2g cosθ)^{3/2})."""

    kind: ClassVar[str] = "henyey_greenstein"
    g: float = param(0.0, -0.99, 0.99, "mean cosine; > 0 scatters forwards")


@dataclass(frozen=True)
class Rayleigh(_Checked):
    """Particles much smaller than the wavelength: p = 3/(16π) (1 + cos²θ)."""

    kind: ClassVar[str] = "rayleigh"


@dataclass(frozen=True)
class Gibbons(_Checked):
    """Gibbons 1958, as Dobashi 2000 uses it: p = K (1 + 9 cos^16(θ/2)), K normalised to 1/(4π·2)."""

    kind: ClassVar[str] = "gibbons"


@dataclass(frozen=True)
class Schlick(_Checked):
    """Schlick's rational approximation of Henyey–Greenstein: p = (1−k²) / (4π (1−k cosθ)²)."""

    kind: ClassVar[str] = "schlick"
    k: float = param(0.0, -0.99, 0.99, "eccentricity; k ≈ 1.55 g − 0.55 g³")


Phase = Isotropic | HenyeyGreenstein | Rayleigh | Gibbons | Schlick


@dataclass(frozen=True)
class Medium(_Checked):
    """A homogeneous participating medium, everywhere or inside an axis-aligned box.

    ``extinction`` is scattering + absorption. Light of lights that have a place is attenuated on its way through the
    medium; a directional light's illuminance is that which arrives in the medium.
    """

    scattering: Vec3 = param((0.0, 0.0, 0.0), 0, None, "scattering coefficient σs, red, green, blue", unit="1/m")
    absorption: Vec3 = param((0.0, 0.0, 0.0), 0, None, "absorption coefficient σa, red, green, blue", unit="1/m")
    phase: Phase = param(Isotropic(), doc="phase function")
    bounds: tuple[Vec3, Vec3] | None = param(
        None, doc="lower and upper corner of the medium's box; none: everywhere", unit="m"
    )

    def __post_init__(self) -> None:
        for name in ("scattering", "absorption"):
            value = getattr(self, name)
            if isinstance(value, (int, float, np.number)) and not isinstance(value, bool):
                object.__setattr__(self, name, (float(value),) * 3)
        check(self)
        if self.bounds is not None and not all(a < b for a, b in zip(*self.bounds, strict=True)):
            raise ParameterError(f"bounds: the upper corner {self.bounds[1]} is not above the lower {self.bounds[0]}")

    @property
    def extinction(self) -> Vec3:
        """σt = σs + σa, 1/m."""
        r, g, b = (s + a for s, a in zip(self.scattering, self.absorption, strict=True))
        return (r, g, b)


# --- lights -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class DirectionalLight(_Checked):
    """A light at infinity. ``intensity`` is the illuminance in lux of a surface that faces it.

    With an ``angular_diameter`` (the sun's is 0.0093) its rays fill a cone evenly, and shadows have a penumbra.
    """

    kind: ClassVar[str] = "directional"
    direction: Vec3 = param((0.0, -1.0, 0.0), doc="direction in which the light travels; any length but zero")
    intensity: float = param(1.0, 0, None, "illuminance", unit="lx")
    color: Vec3 = param((1.0, 1.0, 1.0), 0, None, "linear colour, multiplies the intensity")
    angular_diameter: float = param(0.0, 0, 3, "angle that the light fills in the sky", unit="rad")

    def __post_init__(self) -> None:
        check(self)
        if not any(self.direction):
            raise ParameterError("direction: (0, 0, 0) is no direction")

    @property
    def extent(self) -> float:
        """Tangent of half the angle that the light fills; 0: all rays are parallel."""
        return math.tan(self.angular_diameter / 2)


@dataclass(frozen=True)
class PointLight(_Checked):
    """A light that shines equally in all directions. ``intensity`` is in candela; illuminance falls with 1/r².

    With a ``radius`` it is a sphere of even radiance, ``intensity / (π·radius²)``, and shadows have a penumbra. Outside
    it gives the illuminance of the point at its centre. It is no surface: rays and eyes pass through it.
    """

    kind: ClassVar[str] = "point"
    position: Vec3 = param((0.0, 0.0, 0.0), doc="position", unit="m")
    intensity: float = param(1.0, 0, None, "luminous intensity", unit="cd")
    color: Vec3 = param((1.0, 1.0, 1.0), 0, None, "linear colour, multiplies the intensity")
    radius: float = param(0.0, 0, None, "radius of the sphere that shines; 0 is a point", unit="m")

    @property
    def extent(self) -> float:
        """The radius; 0: the light is a point."""
        return self.radius


@dataclass(frozen=True)
class SpotLight(_Checked):
    """A cone of light, with glTF's falloff (KHR_lights_punctual) between the inner and the outer angle.

    A ``radius`` is that of a :class:`PointLight`; the falloff stays that of the point at its centre.
    """

    kind: ClassVar[str] = "spot"
    position: Vec3 = param((0.0, 0.0, 0.0), doc="position", unit="m")
    direction: Vec3 = param((0.0, -1.0, 0.0), doc="axis of the cone, as the light travels; any length but zero")
    intensity: float = param(1.0, 0, None, "luminous intensity", unit="cd")
    color: Vec3 = param((1.0, 1.0, 1.0), 0, None, "linear colour, multiplies the intensity")
    inner_angle: float = param(0.0, 0, math.pi / 2, "half angle of the full-intensity cone", unit="rad")
    outer_angle: float = param(math.pi / 4, 1e-3, 1.5, "half angle of the cone; beyond it is dark", unit="rad")
    radius: float = param(0.0, 0, None, "radius of the sphere that shines; 0 is a point", unit="m")

    def __post_init__(self) -> None:
        check(self)
        if not any(self.direction):
            raise ParameterError("direction: (0, 0, 0) is no direction")
        if self.inner_angle >= self.outer_angle:
            raise ParameterError(f"inner_angle: {self.inner_angle:g} is not below outer_angle, {self.outer_angle:g}")

    @property
    def extent(self) -> float:
        """The radius; 0: the light is a point."""
        return self.radius

    @property
    def cone(self) -> tuple[float, float]:
        """(scale, offset) of KHR_lights_punctual's falloff ``saturate(cos·scale + offset)²`` from inner to outer angle.

        Its own lower bound of 1e-3 would dim the axis of cones narrower than 2.6°, by a factor of 25 at 1.1°.
        """
        scale = 1 / max(1e-7, math.cos(self.inner_angle) - math.cos(self.outer_angle))
        return scale, -math.cos(self.outer_angle) * scale


@dataclass(frozen=True)
class RectLight(_Checked):
    """A rectangle that shines evenly on one side: a panel, a window, a softbox.

    ``intensity`` is the whole rectangle's in candela along its normal; aside it falls by the cosine (Lambert 1760), so
    that the radiance is ``intensity / (width·height)`` from everywhere in front of it. It is no surface: rays and eyes
    pass through it.

    Without a ``rotation`` the width is level, and the height as upright as can be; where the light shines straight up
    or down (to 2.6°), the width lies along ±X instead, and the height along Z.
    """

    kind: ClassVar[str] = "rect"
    position: Vec3 = param((0.0, 0.0, 0.0), doc="centre", unit="m")
    direction: Vec3 = param((0.0, -1.0, 0.0), doc="normal of the side that shines; any length but zero")
    intensity: float = param(1.0, 0, None, "luminous intensity along the normal", unit="cd")
    color: Vec3 = param((1.0, 1.0, 1.0), 0, None, "linear colour, multiplies the intensity")
    width: float = param(1.0, 1e-6, None, "width", unit="m")
    height: float = param(1.0, 1e-6, None, "height", unit="m")
    rotation: float = param(0.0, doc="turn about the direction, clockwise as the light travels", unit="rad")

    def __post_init__(self) -> None:
        check(self)
        if not any(self.direction):
            raise ParameterError("direction: (0, 0, 0) is no direction")

    @property
    def extent(self) -> float:
        """Radius of the disc of the same area."""
        return math.sqrt(self.width * self.height / math.pi)

    @property
    def axes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """From the centre to the middles of two edges, across and along, each (3,); across × along is against the
        direction.
        """
        direction = np.asarray(self.direction, np.float64)
        direction = direction / np.linalg.norm(direction)
        upright = np.array([0.0, 1.0, 0.0]) if abs(direction[1]) < 0.999 else np.array([0.0, 0.0, -1.0])
        level = np.cross(direction, upright)
        level /= np.linalg.norm(level)
        steep = np.cross(level, direction)
        c, s = math.cos(self.rotation), math.sin(self.rotation)
        return (c * level - s * steep) * (self.width / 2), (s * level + c * steep) * (self.height / 2)


Light = DirectionalLight | PointLight | SpotLight | RectLight


# --- geometry -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Image:
    """Texels of a texture: (height, width, 4) uint8, first row at v = 0 (glTF: the top of the image)."""

    pixels: NDArray[np.uint8]
    name: str = ""

    def __post_init__(self) -> None:
        p = self.pixels
        if p.dtype != np.uint8 or p.ndim != 3 or p.shape[2] != 4 or 0 in p.shape:
            raise ParameterError(f"pixels: {p.dtype} {p.shape} is not uint8 (height, width, 4)")


@dataclass(frozen=True)
class Texture(_Checked):
    """An image with its sampler and KHR_texture_transform (uv' = translate · rotate · scale · uv)."""

    image: Image = param(..., doc="texels")
    wrap_u: Literal["repeat", "clamp", "mirror"] = param("repeat", doc="addressing across")
    wrap_v: Literal["repeat", "clamp", "mirror"] = param("repeat", doc="addressing down")
    filter: Literal["linear", "nearest"] = param("linear", doc="magnification filter")
    offset: Vec2 = param((0.0, 0.0), doc="translation of the texture coordinate")
    rotation: float = param(0.0, doc="counter-clockwise rotation of the texture coordinate", unit="rad")
    scale: Vec2 = param((1.0, 1.0), doc="scale of the texture coordinate")


@dataclass(frozen=True)
class Material(_Checked):
    """glTF metallic-roughness. Factors multiply their textures; colour textures are sRGB, the others linear."""

    name: str = param("", doc="name")
    base_color: Vec4 = param((0.8, 0.8, 0.8, 1.0), 0, 1, "linear albedo (or specular colour of a metal) and alpha")
    metallic: float = param(0.0, 0, 1, "0 dielectric, 1 metal")
    roughness: float = param(0.8, 0, 1, "perceptual roughness; α = roughness²")
    emissive: Vec3 = param((0.0, 0.0, 0.0), 0, None, "emitted radiance, strength included")
    base_color_texture: Texture | None = param(None, doc="sRGB colour and alpha")
    metallic_roughness_texture: Texture | None = param(None, doc="roughness in green, metallic in blue")
    normal_texture: Texture | None = param(None, doc="tangent-space normals")
    emissive_texture: Texture | None = param(None, doc="sRGB emission")
    alpha_mode: Literal["opaque", "mask"] = param("opaque", doc="mask: texels below the cutoff are holes")
    alpha_cutoff: float = param(0.5, 0, 1, "alpha below this is a hole")
    double_sided: bool = param(False, doc="lit from both sides; no back-face culling")
    reflections: bool = param(False, doc="shows what is around as a polished surface does; of implicit surfaces")
    transmission: float = param(0.0, 0, 1, "part of what a dielectric does not reflect that passes; implicit surfaces")
    ior: float = param(1.5, 1, 4, "index of refraction, against that of the air")
    attenuation_distance: float = param(
        1.0, 1e-6, None, "way inside after which the base colour is left of white light", unit="m"
    )


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with one material.

    Attributes:
        positions: (V, 3) float32, metres.
        indices: (T, 3) uint32, counter-clockwise seen from outside.
        normals: (V, 3) float32; made unit length where they are not. None: area-weighted means of the faces around.
        uvs: (V, 2) float32 or None.
        material: how the surface reflects.

    Raises:
        ParameterError: shapes that do not fit, an index out of range, a position that is not finite, or a normal that
            points nowhere.
    """

    positions: NDArray[np.float32]
    indices: NDArray[np.uint32]
    normals: NDArray[np.float32] | None = None
    uvs: NDArray[np.float32] | None = None
    material: Material = Material()
    name: str = ""

    def __post_init__(self) -> None:
        def array(name: str, dtype: Any, width: int) -> NDArray[Any]:
            value = np.ascontiguousarray(getattr(self, name), dtype)
            if value.ndim != 2 or value.shape[1] != width:
                raise ParameterError(f"{name}: shape {value.shape} is not (count, {width})")
            object.__setattr__(self, name, value)
            return value

        positions = array("positions", np.float32, 3)
        if len(np.asarray(self.indices)) and np.asarray(self.indices).min() < 0:
            raise ParameterError("indices: a negative index")
        indices = array("indices", np.uint32, 3)
        if not len(positions) or not len(indices):
            raise ParameterError("positions: a mesh without triangles")
        if not np.isfinite(positions).all():
            raise ParameterError("positions: a position is not finite")
        if indices.max() >= len(positions):
            raise ParameterError(f"indices: {indices.max()} is beyond the last of {len(positions)} vertices")
        if self.normals is None:
            object.__setattr__(self, "normals", vertex_normals(positions, indices))
        for name, width in (("normals", 3), ("uvs", 2)):
            if getattr(self, name) is not None and len(array(name, np.float32, width)) != len(positions):
                raise ParameterError(f"{name}: {len(getattr(self, name))} for {len(positions)} vertices")
        object.__setattr__(self, "normals", _unit(np.asarray(self.normals)))

    @property
    def triangle_count(self) -> int:
        return len(self.indices)

    @cached_property
    def bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lower and upper corner, each (3,)."""
        return self.positions.min(axis=0), self.positions.max(axis=0)


def _unit(normals: NDArray[np.float32]) -> NDArray[np.float32]:
    """The normals themselves where all have unit length to 1e-3, so that saved ones load bit for bit."""
    square = np.einsum("ij,ij->i", normals, normals)
    if np.abs(square - 1).max() < 2e-3:
        return normals
    with np.errstate(over="ignore", invalid="ignore"):
        length = np.linalg.norm(normals.astype(np.float64), axis=1, keepdims=True)
    if not (np.isfinite(length) & (length > 0)).all():
        raise ParameterError("normals: a normal is zero or not finite")
    return (normals / length).astype(np.float32)


def box_corners(low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.float64]:
    """The (8, 3) corners of the axis-aligned box between two of them, each (3,)."""
    return np.array([[(low, high)[(i >> axis) & 1][axis] for axis in range(3)] for i in range(8)])


def vertex_normals(positions: NDArray[np.float32], indices: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Area-weighted vertex normals, (V, 3) unit float32; +Y where the area around is 0 or beyond float32."""
    a, b, c = (positions[indices[:, i]] for i in range(3))
    face = np.cross(b - a, c - a).astype(np.float64)
    normals = np.stack(
        [np.bincount(indices.ravel(), np.repeat(face[:, axis], 3), minlength=len(positions)) for axis in range(3)],
        axis=1,
    )
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    usable = (length >= 1e-30) & (length < np.inf)
    normals = np.where(usable, normals, (0, 1, 0)) / np.where(usable, length, 1)
    return normals.astype(np.float32)


@dataclass(frozen=True, eq=False)
class Instance:
    """A mesh placed in the world by a 4×4 matrix (row-major, column vectors: p' = M·p)."""

    mesh: Mesh
    transform: Mat4 = IDENTITY
    name: str = ""

    def __post_init__(self) -> None:
        matrix = np.asarray(self.transform, np.float64)
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
            raise ParameterError("transform: not 4×4 finite numbers")
        rows = tuple(tuple(float(x) for x in row) for row in matrix)
        object.__setattr__(self, "transform", rows)


class Solid(Protocol):
    """What the scene must know of an implicit surface: :class:`tyndall.sdf.Shape` is one."""

    def moved(self, moves: Mapping[str, Iterator[NDArray[np.float64]]]) -> Solid:
        """The same with its named parts moved, each part by the next of its name's 4×4 transforms."""

    dimension: int

    @property
    def box(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lower and upper corner (3,) of its inside; ±inf where it has no end."""


@dataclass(frozen=True, eq=False)
class Implicit:
    """An implicit surface in the world.

    Attributes:
        shape: signed distances in its own space, a :class:`tyndall.sdf.Shape` of three dimensions.
        transform: 4×4 affine (row-major, column vectors: p' = M·p) from its own space to the world.
        material: of what in it has none of its own.
        name: by which a frame places and moves it.

    Raises:
        ParameterError: a flat shape, or a transform that has no inverse.
    """

    shape: Solid
    transform: Mat4 = IDENTITY
    material: Material = Material()
    name: str = ""

    def __post_init__(self) -> None:
        if getattr(self.shape, "dimension", None) != 3:
            raise ParameterError(f"shape: {type(self.shape).__name__} is no solid shape; extrude or revolve a flat one")
        if not isinstance(self.material, Material):
            raise ParameterError(f"material: {self.material!r} is no Material")
        if not isinstance(self.name, str):
            raise ParameterError(f"name: {self.name!r} is no name")
        rows = tuple(tuple(float(x) for x in row) for row in placement(self.transform))
        object.__setattr__(self, "transform", rows)

    @cached_property
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Lower and upper corner in the world, each (3,); None where it has no end."""
        return self.bounds_at(np.asarray(self.transform))

    def bounds_at(self, matrix: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """:attr:`bounds` where its transform is this 4×4 one."""
        if self._corners is None:
            return None
        world = self._corners @ matrix[:3, :3].T + matrix[:3, 3]
        return world.min(axis=0), world.max(axis=0)

    @cached_property
    def _corners(self) -> NDArray[np.float64] | None:
        low, high = self.shape.box
        return box_corners(low, high) if np.isfinite(low).all() and np.isfinite(high).all() else None


@dataclass(frozen=True, eq=False)
class Volume:
    """A cloud: a medium that fills the inside of an implicit surface, which itself is not seen.

    Attributes:
        shape: signed distances in its own space, a :class:`tyndall.sdf.Shape` of three dimensions, with an end.
        medium: what scatters and absorbs there; its ``bounds`` do not count.
        transform: 4×4 affine (row-major, column vectors: p' = M·p) from its own space to the world.
        edge: how far inside of the surface the medium reaches its whole density, in metres; 0 is a sharp edge.
        name: of no consequence.

    Raises:
        ParameterError: a flat shape or one without an end, a transform that has no inverse, or a negative edge.
    """

    shape: Solid
    medium: Medium
    transform: Mat4 = IDENTITY
    edge: float = 0.0
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "transform", self.surface.transform)
        if not isinstance(self.medium, Medium):
            raise ParameterError(f"medium: {self.medium!r} is no Medium")
        if self.surface.bounds is None:
            raise ParameterError("shape: it has no end; a volume must")
        if not 0 <= self.edge < math.inf:
            raise ParameterError(f"edge: {self.edge} is no width")

    @cached_property
    def surface(self) -> Implicit:
        """Where the medium ends."""
        return Implicit(self.shape, self.transform, name=self.name)


@dataclass(frozen=True)
class Camera(_Checked):
    """A pinhole camera with an infinite far plane."""

    position: Vec3 = param((0.0, 1.0, 5.0), doc="position", unit="m")
    target: Vec3 = param((0.0, 0.0, 0.0), doc="point that is in the middle of the picture", unit="m")
    up: Vec3 = param((0.0, 1.0, 0.0), doc="direction that is upright in the picture")
    fov: float = param(math.radians(45), 0.01, 3.1, "vertical field of view", unit="rad")
    near: float = param(0.01, 1e-6, None, "distance of the near plane", unit="m")
    exposure: float = param(0.0, -30, 30, "exposure compensation; each step doubles the light", unit="EV")

    def __post_init__(self) -> None:
        check(self)
        forward = np.subtract(self.target, self.position)
        if np.linalg.norm(np.cross(forward, self.up)) <= 1e-9 * np.linalg.norm(forward) * np.linalg.norm(self.up):
            raise ParameterError("target: the camera looks along its up direction, or nowhere")


Motion = Callable[[float], Mapping[str, ArrayLike]]


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything a picture is made of.

    ``looks`` holds, by technique name, the parameters that suit this scene (``{"froxel": {"z_limit": 17.6}}``); a
    technique made for the scene starts from them.

    ``motion`` says where implicit surfaces are at a time in seconds: by the name of an object, or of a part of one, how
    it is moved from where it stands at rest, in the space that holds it (an object: the world). That is one 4×4
    transform, (N, 4, 4) for N of the same name in the order in which they stand in the scene, or (N, 3) for ways in
    metres; see :func:`transforms`. :meth:`at_time` is the still scene of a moment. ``room`` is a box that what moves
    does not leave, so that maps need not be fitted anew.

    Raises:
        ParameterError: an instance or light that is none, a colour that is negative or not finite, an upper corner
            below the lower one.
    """

    instances: tuple[Instance, ...] = ()
    lights: tuple[Light, ...] = ()
    camera: Camera = Camera()
    medium: Medium = Medium()
    background: Vec3 = param((0.0, 0.0, 0.0), 0, None, "linear radiance where no surface is")
    ambient: Vec3 = param((0.0, 0.0, 0.0), 0, None, "linear radiance that arrives from everywhere")
    looks: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    name: str = "scene"
    implicits: tuple[Implicit, ...] = ()
    motion: Motion | None = None
    room: tuple[Vec3, Vec3] | None = param(None, doc="lower and upper corner of all that moves", unit="m")
    volumes: tuple[Volume, ...] = ()

    def __post_init__(self) -> None:
        check(self)
        if self.room is not None and not all(a <= b for a, b in zip(*self.room, strict=True)):
            raise ParameterError(f"room: the upper corner {self.room[1]} is below the lower {self.room[0]}")
        for name in ("instances", "lights", "implicits", "volumes"):
            if not isinstance(getattr(self, name), Iterable):
                raise ParameterError(f"{name}: {type(getattr(self, name)).__name__} is no list of them")
        object.__setattr__(self, "instances", tuple(self.instances))
        object.__setattr__(self, "lights", tuple(self.lights))
        object.__setattr__(self, "implicits", tuple(self.implicits))
        object.__setattr__(self, "volumes", tuple(self.volumes))
        kinds_of = {
            "instances": (Instance,),
            "lights": get_args(Light),
            "implicits": (Implicit,),
            "volumes": (Volume,),
        }
        for name, kinds in kinds_of.items():
            for index, item in enumerate(getattr(self, name)):
                if not isinstance(item, kinds):
                    expected = " or ".join(kind.__name__ for kind in kinds)
                    raise ParameterError(f"{name}[{index}]: {type(item).__name__} is not {expected}")

    @property
    def triangle_count(self) -> int:
        """Triangles in the world: an instanced mesh counts once for each instance."""
        return sum(i.mesh.triangle_count for i in self.instances)

    @cached_property
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lower and upper corner of the world's box, each (3,), ``room`` included; the unit cube around 0 without
        geometry.

        Implicit surfaces that have no end do not count.
        """
        lows, highs = [], []
        if self.room is not None:
            lows.append(np.array(self.room[0]))
            highs.append(np.array(self.room[1]))
        for instance in self.instances:
            low, high = (c.astype(np.float64) for c in instance.mesh.bounds)
            matrix = np.asarray(instance.transform)
            world = box_corners(low, high) @ matrix[:3, :3].T + matrix[:3, 3]
            lows.append(world.min(axis=0))
            highs.append(world.max(axis=0))
        for implicit in (*self.implicits, *(volume.surface for volume in self.volumes)):
            if implicit.bounds is not None:
                lows.append(implicit.bounds[0])
                highs.append(implicit.bounds[1])
        if not lows:
            return np.full(3, -0.5), np.full(3, 0.5)
        return np.min(lows, axis=0), np.max(highs, axis=0)

    def with_(self, **changes: Any) -> Scene:
        """A copy with some fields replaced."""
        return dataclasses.replace(self, **changes)

    def at_time(self, time: float) -> Scene:
        """The still scene of a moment, in seconds.

        Raises:
            ParameterError: ``motion`` gives what are no transforms, or fewer than there are objects or parts.
        """
        if self.motion is None:
            return self
        moves = {name: iter(transforms(name, value)) for name, value in self.motion(time).items()}
        moved = []
        try:
            for one in self.implicits:
                place: Any = np.asarray(one.transform)
                if one.name and one.name in moves:
                    place = next(moves[one.name]) @ place
                shape = one.shape.moved(moves)
                moved.append(dataclasses.replace(one, shape=shape, transform=place))
        except StopIteration:
            raise ParameterError("motion: fewer transforms than objects or parts of the name") from None
        return self.with_(implicits=tuple(moved), motion=None)


def placement(transform: ArrayLike) -> NDArray[np.float64]:
    """A copy of a 4×4 affine transform, as an array.

    Raises:
        ParameterError: it is none, or has no inverse.
    """
    matrix = np.array(transform, np.float64)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all() or abs(np.linalg.det(matrix[:3, :3])) < 1e-30:
        raise ParameterError("transform: not 4×4 finite numbers that have an inverse")
    if matrix[3].tolist() != [0, 0, 0, 1]:
        raise ParameterError("transform: its last row is not 0, 0, 0, 1")
    return matrix


def translations(ways: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 4, 4) transforms that move by (N, 3) ways in metres."""
    made = np.tile(np.eye(4), (len(ways), 1, 1))
    made[:, :3, 3] = ways
    return made


def transforms(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """(N, 4, 4) from one 4×4 transform, N of them, or (N, 3) ways in metres.

    Raises:
        ParameterError: another shape of array; ``name`` says whose.
    """
    try:
        given = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        raise ParameterError(f"{name}: {value!r:.60} is neither transforms nor ways") from None
    if given.shape[-2:] == (4, 4) and given.ndim in (2, 3):
        if not (given[..., 3, :] == (0, 0, 0, 1)).all():
            raise ParameterError(f"{name}: the last row of a transform is not 0, 0, 0, 1")
        return given.reshape(-1, 4, 4)
    if given.ndim == 2 and given.shape[1] == 3:
        return translations(given)
    raise ParameterError(f"{name}: shape {given.shape} is neither of 4×4 transforms nor (count, 3) of ways")
