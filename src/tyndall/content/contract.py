"""What every kind of scene content can do: meshes and implicit surfaces now; particles and terrain in the same words.

Content draws itself into the G-buffer and draws its depth from a light; with these two it is seen, and casts and
receives shadows by every technique that works on images. What is not drawn with triangles is marched by compute passes
before or after the render pass of the others. What consists of polygons can also describe its outline, from
which shadow volumes and penumbra wedges are made; what cannot, or only in part, says so, and these techniques then take
the shadow of the rest from a shadow map. What is drawn with triangles or quads can also draw its shadow on planes;
``casting.wesl`` has what its shaders need for that. Rays meet it through :mod:`tyndall.tracing`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal, Protocol

from tyndall.gpu.device import Blend
from tyndall.gpu.resources import Bound, Resource, Texture

if TYPE_CHECKING:
    from tyndall.content.outline import Outline
    from tyndall.content.rasterize import Triangles

Cull = Literal["none", "front", "back"]
Casters = Literal["all", "beside_outline"]
Prepared = Literal["depth", "flattened", "silhouette"]

PLANE_FORMAT = "depth32float"
"""Of the depth that stands for the plane that a pixel shows."""

SHADE_TARGET: tuple[str, Blend | None] = ("rgba8unorm", Blend("zero", "one-minus-src"))
"""Images of shade, a channel for each light or plane: the light that passes. A fragment takes away what it returns."""


class Content(Protocol):
    """One kind of scene content on the device.

    Attributes:
        emits: whether something of it shines by itself.
    """

    emits: bool

    def draw_gbuffer(self, native_pass: Any, scope: Mapping[str, Bound], *, emissive: bool) -> None:
        """Draw into the G-buffer; ``scope`` binds ``camera``. It has an emissive target only if some content emits."""

    def march_gbuffer(self, scope: Mapping[str, Bound], depth: Texture | None, *, emissive: bool, alone: bool) -> None:
        """Put what is not drawn with triangles into the G-buffer, where it is nearer than what has been drawn.

        Args:
            scope: binds ``camera``, ``depth``, and for compute to write ``normal_roughness_out``,
                ``albedo_metallic_out`` and, if some content emits, ``emissive_out``.
            depth: to be drawn into; None where nothing asks for it as a depth buffer.
            alone: nothing has been drawn, and nothing cleared: every pixel of the targets is written.
        """

    def prepare(self, what: Prepared, scope: Mapping[str, Bound], size: tuple[int, int], owner: str) -> None:
        """Record the compute passes that ``draw_depth``, ``draw_flattened`` or ``draw_silhouette`` need, before the
        render pass that it is called in.

        Args:
            scope: what that method gets; for "flattened", once for all lights and planes, what the frame binds, and
                as ``which`` a depth that is above 0 where a pixel shows a plane.
            size: of what is drawn into.
            owner: first part of the passes' names.
        """

    def draw_depth(self, native_pass: Any, scope: Mapping[str, Bound], cull: Cull, casters: Casters = "all") -> None:
        """Draw depth as a light sees it; ``scope`` binds ``shadow_layers`` and ``layer``.

        Args:
            cull: faces to leave out, as the light sees them, of what has faces.
            casters: "beside_outline" leaves out what :meth:`outline` describes.
        """

    def draw_flattened(self, native_pass: Any, scope: Mapping[str, Bound]) -> None:
        """Darken what is in its shadow on a plane, as a camera sees it; what cannot be flattened draws nothing.

        Args:
            scope: binds ``camera``, ``flattenings``, ``flattening`` and its light's number ``light_index``; the depth
                test is for equality, and the viewport sets the depth.
        """

    def draw_silhouette(self, native_pass: Any, scope: Mapping[str, Bound], targets: int) -> None:
        """Darken what a light sees of it, whatever is nearer; what cannot say where it is draws nothing.

        Args:
            scope: binds ``silhouettes`` and ``layer``.
            targets: how many images of shade are drawn at once, with a channel for each plane that it is in front of.
        """

    def outline(self) -> Outline | None:
        """The adjacency of the polygons that it casts shadows with; None where it has none."""

    def triangles(self) -> Triangles | None:
        """The same polygons, for passes in compute that draw their depth; None where it has none."""

    def casts_beside_outline(self) -> bool:
        """Whether something of it casts a shadow that :meth:`outline` and :meth:`triangles` do not describe."""

    def resources(self) -> list[Resource]:
        """What it holds on the device."""

    def forget_bundles(self) -> None:
        """Drop recorded draws, so that destroyed resources are not kept alive by them."""

    def close(self) -> None:
        """Free all device memory."""
