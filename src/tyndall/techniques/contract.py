"""What techniques have in common, and what each of them sees of a frame.

A technique is a frozen dataclass of declared parameters with a name, a source and one method, ``render(view)``. Its
shader is the ``.wesl`` file of the same name beside it. A :class:`View` gives it the frame's resources by name,
textures of its own that live as long as the technique is in use, and passes whose names begin with the technique's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from numpy.typing import NDArray

from tyndall.gpu.device import ComputePass, Gpu
from tyndall.gpu.params import check
from tyndall.gpu.resources import Bound, Buffer, ParamsBuffer, Resource, Texture
from tyndall.scene.model import Camera, Scene
from tyndall.sdf.field import Field
from tyndall.tracing.world import World


class Unsupported(ValueError):  # noqa: N818 - a refusal, not a fault
    """A technique cannot draw this scene; the message says why and what to use instead."""


class Technique:
    """Base of all techniques: parameters are checked when one is made.

    Attributes:
        name: as on the command line.
        paper: who described it, and when.
        advice: one honest line on when to use it.
        reads_maps: whether it reads the shadow maps themselves, beyond asking for visibility.
        lights_air: whether it asks the shadow technique about points in the air.
        casts_rays: whether it asks :attr:`View.world`; the frame then builds it before it records anything.
        tests_depth: whether it draws against the picture's depth buffer, beyond asking for a pixel's depth.
        reads_motion: whether it asks where what a pixel shows was in the last frame (``motion.wesl``).
        receivers: what a shadow technique shades: all surfaces, or flat ones only ("planes"); the rest is lit.
    """

    name: ClassVar[str]
    paper: ClassVar[str]
    advice: ClassVar[str]
    reads_maps: ClassVar[bool] = False
    lights_air: ClassVar[bool] = True
    casts_rays: ClassVar[bool] = False
    tests_depth: ClassVar[bool] = False
    reads_motion: ClassVar[bool] = False
    receivers: ClassVar[Literal["all", "planes"]] = "all"

    def __post_init__(self) -> None:
        check(self)

    @property
    def up_to_scale(self) -> bool:
        """Whether its light is right only up to a factor: the models of the papers have units of their own."""
        return getattr(self, "model", None) == "paper"

    def supports(self, scene: Scene) -> None:
        """Raise :class:`Unsupported` if the technique cannot draw a scene."""

    @classmethod
    def shader(cls) -> str:
        """The WESL module beside the technique's Python module."""
        return "package::" + cls.__module__.removeprefix("tyndall.").replace(".", "::")


@dataclass
class View:
    """A frame, as one technique sees it.

    Attributes:
        images: the frame's images by name; "inscatter" (rgba32float) and "transmittance_map" are what a volumetric
            technique writes.
        scope: what the technique's shader may import from ``package::bindings``.
        overlay: virtual modules, ``package::visibility`` among them once the shadows are drawn.
        size: width and height of the picture in pixels.
        frame: frames drawn before this one.
        make_world: gives :attr:`world`.
        fields: the scene's implicit surfaces on the device, up to date; None where it has none.
        owner: "family.name": owner in the ledger and prefix of its passes.
        maps_wanted: whether the volumetric technique reads shadow maps; what a shadow technique need not draw
            otherwise.
        air_wanted: whether the volumetric technique asks for visibility in the air.
    """

    gpu: Gpu
    scene: Scene
    size: tuple[int, int]
    owner: str
    technique: Technique
    images: Mapping[str, Texture] = field(default_factory=dict)
    scope: dict[str, Any] = field(default_factory=dict)
    overlay: dict[str, str] = field(default_factory=dict)
    frame: int = 0
    maps_wanted: bool = False
    air_wanted: bool = True
    make_world: Callable[[], World] | None = None
    fields: Field | None = None
    _camera: Camera | None = None
    _resources: dict[str, Resource] = field(default_factory=dict)
    _descriptions: dict[str, Any] = field(default_factory=dict)
    _kept: dict[str, tuple[Any, Any]] = field(default_factory=dict)
    _params: ParamsBuffer | None = None
    _parts: dict[str, View] = field(default_factory=dict)

    @property
    def world(self) -> World:
        """The scene for rays, which all techniques of a frame share; built when it is asked for first."""
        assert self.make_world is not None, "this view is of no frame"
        return self.make_world()

    @property
    def camera(self) -> Camera:
        """The frame's camera; the scene's until a frame is drawn."""
        return self._camera or self.scene.camera

    @camera.setter
    def camera(self, camera: Camera) -> None:
        self._camera = camera

    @property
    def params(self) -> Bound:
        """The uniform of the technique's parameters."""
        if self._params is None:
            self._params = self.gpu.params(f"{self.owner}.params", self.technique, owner=self.owner)
        return self._params.bound

    def texture(
        self, label: str, size: tuple[int, ...], format: str, *, dimension: str = "2d", usage: str = "sampled storage"
    ) -> Texture:
        """The technique's own texture of this label; made on first use, made anew when its description changes."""
        made = self._owned(
            label,
            (size, format, dimension, usage),
            lambda name: self.gpu.texture(name, size, format, owner=self.owner, dimension=dimension, usage=usage),
        )
        assert isinstance(made, Texture)
        return made

    def buffer(
        self, label: str, make: Callable[[], NDArray[Any] | int], *, element: str, usage: str = "storage"
    ) -> Buffer:
        """The technique's own buffer of this label; ``make`` gives its contents, or its bytes, on first use."""
        made = self._owned(
            label,
            (element, usage),
            lambda name: self.gpu.buffer(name, make(), owner=self.owner, element=element, usage=usage),
        )
        assert isinstance(made, Buffer)
        return made

    def fitted(self, label: str, make: Callable[[], NDArray[Any]], *, element: str) -> Buffer:
        """As :meth:`buffer`, of what depends on the scene's box; written anew when that changes."""
        made = self.buffer(label, make, element=element)
        box = tuple(corner.tobytes() for corner in self.scene.bounds)
        self.keep(f"{label} fitted", box, lambda: self.gpu.write(made, make()))
        return made

    def keep(self, label: str, key: Any, make: Callable[[], Any]) -> Any:
        """What was made for this label, of nothing that must be destroyed; made anew when the key changes."""
        if label not in self._kept or self._kept[label][0] != key:
            self._kept[label] = key, make()
        return self._kept[label][1]

    def _owned(self, label: str, description: Any, make: Any) -> Resource:
        held = self._resources.get(label)
        if held is not None and self._descriptions[label] == description:
            return held
        if held is not None:
            held.destroy()
            self.gpu.forget_groups()
        self._descriptions[label] = description
        made: Resource = make(f"{self.owner}.{label}")
        self._resources[label] = made
        return made

    def compute(self, entry: str) -> ComputePass:
        """A compute pass named ``family.technique.entry`` that runs this entry point of the technique's shader."""
        made = self.gpu.compute(f"{self.owner}.{entry}", self.technique.shader(), entry)
        return made.bind(self.scope, params=self.params).overlay(self.overlay)

    def part(self, technique: Technique, label: str | None = None) -> View:
        """The same frame as another technique sees it that this one makes use of; it lives as long as this view.

        Args:
            label: of this use, where the technique's name is not enough to tell it from another.
        """
        label = label or technique.name
        made = self._parts.get(label)
        if made is None or made.technique != technique:
            if made is not None:
                made.close()
                self.gpu.forget_groups()
            made = View(
                self.gpu,
                self.scene,
                self.size,
                f"{self.owner}.{label}",
                technique,
                make_world=self.make_world,
            )
            self._parts[label] = made
        made.scene, made.fields = self.scene, self.fields
        made.images, made.scope, made.overlay, made.frame = self.images, self.scope, self.overlay, self.frame
        made.camera, made.maps_wanted, made.air_wanted = self.camera, self.maps_wanted, self.air_wanted
        return made

    def forget(self) -> None:
        """Make anew what was kept: what a discarded frame recorded did not happen."""
        self._kept.clear()
        for part in self._parts.values():
            part.forget()

    def resources(self) -> list[Resource]:
        """What the technique holds on the device."""
        own = [*self._resources.values(), *([self._params] if self._params else [])]
        return own + [resource for part in self._parts.values() for resource in part.resources()]

    def close(self) -> None:
        """Free the technique's textures and uniforms."""
        for resource in self.resources():
            resource.destroy()
        self._resources.clear()
        self._parts.clear()
        self._kept.clear()
        self._params = None


@dataclass(frozen=True)
class Visibility:
    """What a shadow technique provides to the frame.

    What is exact only on surfaces takes the module of the shadow map for the air.

    Attributes:
        module: a WESL module with ``fn visibility(light: u32, position: vec3f, normal: vec3f) -> f32``, for any point;
            the normal is zero in the air.
        surfaces: a WESL module with ``fn surface_visibility(light: u32, pixel: vec2u, position: vec3f, normal: vec3f)
            -> f32``, for what a pixel shows, and ``fn towards_light(light: u32, position: vec3f, normal: vec3f) ->
            vec3f``, the unit direction for which the surface's reflection of the light is taken: that to its centre,
            or above it where the horizon cuts the light and the technique knows what it leaves.
        bindings: what these modules import from ``package::bindings``.
        maps: the shadow maps, a depth layer per map (reversed-Z; 0 where nothing was drawn); None only where none are
            wanted.
        overlay: other modules that stand for real ones in all that imports these.
    """

    module: str
    surfaces: str
    bindings: Mapping[str, Any]
    maps: Texture | None = None
    overlay: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Occlusion:
    """What an occlusion technique provides to the frame.

    Attributes:
        module: a WESL module with ``fn ambient_visibility(pixel: vec2u) -> f32``, the part of the ambient light, by
            the cosine, that reaches what a pixel shows.
        bindings: what that module imports from ``package::bindings``.
    """

    module: str
    bindings: Mapping[str, Any] = field(default_factory=dict)
