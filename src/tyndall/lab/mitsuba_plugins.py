"""Mitsuba plugins for what Tyndall's scenes have and Mitsuba does not; its just-in-time variants compile them, too.

- ``tyndall_reflection``: the reflection model of wesl/brdf.wesl with the textures of content/mesh.wesl, and holes;
- ``tyndall_lamp``: glTF's spot falloff; lights with a size (a radius, an angular diameter, or a rectangle) that nobody
  sees and that cast no shadow; and directional lights whose illuminance is that which arrives in the medium. Mitsuba
  dims those on their way through the medium, so the lamp is brighter by e^(σt·s), s the length of that way in the
  medium;
- ``tyndall_glow``: emissive surfaces with their texture, seen from both sides;
- ``tyndall_phase``: Gibbons' and Schlick's phase functions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

FAR = 1e9
SHELL = 3e-4  # by how much the medium's box is larger than told, relative to its distance from the origin, and at least
# in metres: its faces must not coincide with a wall's, and lie farther from them than Mitsuba offsets a ray's origin


def register(mi: Any, dr: Any, content: dict[str, Any], images: dict[str, NDArray[np.uint8]]) -> None:
    """Make Mitsuba know Tyndall's plugins; each takes the index of what it stands for."""
    ambient, last = content["ambient"], content["depth"] == 2
    read = _map(mi, dr)
    reflection, glow, lamp = _reflection(mi, dr, read), _glow(mi, dr, read), _lamp(mi, dr, content)

    def material(props: Any) -> dict[str, Any]:
        found: dict[str, Any] = content["materials"][int(props["index"])]
        return found

    mi.register_bsdf("tyndall_reflection", lambda props: reflection(props, material(props), images, ambient, last))
    mi.register_emitter("tyndall_glow", lambda props: glow(props, material(props), images))
    mi.register_emitter("tyndall_lamp", lambda props: lamp(props, content["lights"][int(props["index"])]))
    mi.register_phase("tyndall_phase", _phase(mi, dr))


def phase_dict(phase: dict[str, Any]) -> dict[str, Any]:
    """Mitsuba's own plugin where it has one."""
    kind = phase["kind"]
    if kind == "henyey_greenstein":
        return {"type": "hg", "g": phase["parameter"]}
    if kind in ("isotropic", "rayleigh"):
        return {"type": kind}
    return {"type": "tyndall_phase", "gibbons": kind == "gibbons", "k": phase["parameter"]}


class Box:
    """An axis-aligned box for rays; all of space without bounds."""

    def __init__(self, mi: Any, dr: Any, bounds: Any) -> None:
        self._dr, self.everywhere = dr, bounds is None
        if not self.everywhere:
            self._low, self._high = (mi.Point3f([float(x) for x in corner]) for corner in bounds)

    def interval(self, origin: Any, way: Any, limit: Any) -> tuple[Any, Any]:
        """(begin, end) of the part of a ray from 0 to ``limit`` that is inside, begin ≤ end."""
        if self.everywhere:
            return limit * 0, limit
        dr = self._dr
        safe = dr.select(dr.abs(way) < 1e-20, 1e-20, way)
        a, b = (self._low - origin) / safe, (self._high - origin) / safe
        begin = dr.maximum(dr.max(dr.minimum(a, b)), 0)
        end = dr.minimum(dr.min(dr.maximum(a, b)), limit)
        return begin, dr.maximum(begin, end)

    def contains(self, p: Any) -> Any:
        return self.everywhere or self._dr.all((p > self._low) & (p < self._high))


def enlarged(bounds: Sequence[Sequence[float]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower and upper corner of the medium's box as Mitsuba gets it."""
    low, high = np.array(bounds, np.float64)
    margin = SHELL * (1 + max(np.abs(low).max(), np.abs(high).max()))
    return low - margin, high + margin


def _map(mi: Any, dr: Any) -> Callable[..., Any]:
    """A texture of a material."""

    class Map:
        """A texture: texels of level 0, linear light, with its own addressing."""

        def __init__(self, given: dict[str, Any], images: dict[str, NDArray[np.uint8]]) -> None:
            texels = images[given["image"]].astype(np.float32) / 255
            if given["srgb"]:
                rgb = texels[..., :3]
                texels[..., :3] = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
            self.wrap, self.matrix = given["wrap"], given["matrix"]
            self.size = (texels.shape[1], texels.shape[0])
            # A border of what lies beyond the edge, so that filtering needs no addressing.
            modes: dict[str, Any] = {"repeat": "wrap", "clamp": "edge", "mirror": "symmetric"}
            for axis, wrap in ((1, self.wrap[0]), (0, self.wrap[1])):
                border = [(0, 0)] * 3
                border[axis] = (1, 1)
                texels = np.pad(texels, border, mode=modes[wrap])
            filtering = dr.FilterMode.Linear if given["filter"] == "linear" else dr.FilterMode.Nearest
            # Without the GPU's own filter: its weights have 8 bits.
            self.texels = mi.Texture2f(
                mi.TensorXf(texels), use_accel=False, filter_mode=filtering, wrap_mode=dr.WrapMode.Clamp
            )

        def turned(self, u: Any, v: Any, moved: float) -> tuple[Any, Any]:
            (a, b), (c, d), (e, f) = self.matrix
            return a * u + c * v + e * moved, b * u + d * v + f * moved

        def at(self, uv: Any) -> Any:
            place = []
            for value, wrap, size in zip(self.turned(uv.x, uv.y, 1.0), self.wrap, self.size, strict=True):
                if wrap == "repeat":
                    value = value - dr.floor(value)
                elif wrap == "mirror":
                    value = 1 - dr.abs(value - 2 * dr.floor(value / 2) - 1)
                else:
                    value = dr.clip(value, 0, 1)
                place.append((value * size + 1) / (size + 2))
            return self.texels.eval(mi.Point2f(*place))

    return Map


def _reflection(mi: Any, dr: Any, read: Callable[..., Any]) -> Callable[..., Any]:
    """A material: wesl/brdf.wesl with its textures, lit from the side that is seen."""

    class Reflection(mi.BSDF):  # type: ignore[misc, name-defined, unused-ignore]
        """``last``: paths end here, and directions are drawn for nothing."""

        def __init__(
            self, props: Any, material: dict[str, Any], images: Any, ambient: Sequence[float], last: bool
        ) -> None:
            super().__init__(props)
            self.given, self.ambient, self.last = material, ambient, last
            self.maps = {name: read(given, images) for name, given in material["maps"].items()}
            sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components = [mi.BSDFFlags.GlossyReflection | sides]
            if material["alpha_cutoff"] > 0:
                self.m_components = [*self.m_components, mi.BSDFFlags.Null | sides]
            self.m_flags = self.m_components[0] | self.m_components[-1]

        def base(self, si: Any) -> tuple[Any, Any]:
            """Colour and alpha."""
            *rgb, alpha = self.given["base_color"]
            color = mi.Color3f(rgb)
            if "base_color" in self.maps:
                texel = self.maps["base_color"].at(si.uv)
                color, alpha = color * mi.Color3f(texel[0], texel[1], texel[2]), alpha * texel[3]
            return color, alpha

        def solid(self, si: Any) -> Any:
            """Not a hole."""
            cutoff = self.given["alpha_cutoff"]
            return self.base(si)[1] >= cutoff if cutoff > 0 else mi.Bool(True)

        def surface(self, si: Any) -> tuple[Any, Any, Any, Any]:
            """Normal on the viewer's side, colour, metallic, roughness."""
            metallic, roughness = self.given["metallic"], self.given["roughness"]
            if "metallic_roughness" in self.maps:
                texel = self.maps["metallic_roughness"].at(si.uv)
                roughness, metallic = roughness * texel[1], metallic * texel[2]
            normal = mi.Vector3f(si.sh_frame.n)
            if "normal" in self.maps:
                normal = self.perturbed(si, normal)
            viewer = si.to_world(si.wi)
            normal = dr.select(dr.dot(si.n, viewer) > 0, normal, -normal)
            return normal, self.base(si)[0], metallic, roughness

        def perturbed(self, si: Any, normal: Any) -> Any:
            """content/mesh.wesl's tangent-space bump: along the cotangent frame, whichever derivatives span it."""
            map = self.maps["normal"]
            texel = map.at(si.uv)
            bump = [2 * texel[i] - 1 for i in range(3)]
            p2, p1 = dr.cross(si.dp_dv, normal), dr.cross(normal, si.dp_du)
            duv1, duv2 = map.turned(1.0, 0.0, 0.0), map.turned(0.0, 1.0, 0.0)
            side = dr.sign(dr.dot(normal, dr.cross(si.dp_du, si.dp_dv)))
            t = (p2 * duv1[0] + p1 * duv2[0]) * side
            b = (p2 * duv1[1] + p1 * duv2[1]) * side

            def unit(v: Any) -> Any:
                return v * dr.rsqrt(dr.maximum(dr.dot(v, v), 1e-30))

            return dr.normalize(unit(t) * bump[0] - unit(b) * bump[1] + normal * bump[2])

        def gloss_share(self, metallic: Any) -> Any:
            """How often a direction is drawn from the gloss."""
            return 0.5 + 0.4 * metallic

        def value(self, si: Any, wo: Any) -> Any:
            """reflect_light of wesl/brdf.wesl; 0 beneath the true face, which a shading normal may let through."""
            normal, albedo, metallic, roughness = self.surface(si)
            viewer, light = si.to_world(si.wi), si.to_world(wo)
            n_l, n_v, _, l_h, ggx = self.angles(normal, roughness, viewer, light)
            alpha = dr.maximum(roughness * roughness, 2e-3)
            a2 = alpha * alpha

            def grazing(cosine: Any) -> Any:
                m = dr.clip(1 - cosine, 0, 1)
                return m * m * m * m * m

            smith = 0.5 / dr.maximum(
                n_l * dr.sqrt(n_v * n_v * (1 - a2) + a2) + n_v * dr.sqrt(n_l * n_l * (1 - a2) + a2), 1e-7
            )
            f0 = 0.04 * (1 - metallic) + albedo * metallic
            fresnel = f0 + (1 - f0) * grazing(l_h)
            gloss = 1 - roughness
            through = 0.96 / (1 - gloss / 21) * (1 - gloss * grazing(n_l)) * (1 - gloss * grazing(n_v))
            value = (albedo * (through * (1 - metallic) / dr.pi) + fresnel * (ggx * smith)) * n_l
            lit = (n_l > 0) & (dr.dot(si.n, light) * dr.dot(si.n, viewer) > 0) & self.solid(si)
            return dr.select(lit, value, 0)

        def density(self, si: Any, wo: Any) -> Any:
            """Of :meth:`sample`'s directions."""
            normal, _, metallic, roughness = self.surface(si)
            n_l, _, n_h, l_h, ggx = self.angles(normal, roughness, si.to_world(si.wi), si.to_world(wo))
            share = self.gloss_share(metallic)
            facet = ggx * n_h / dr.maximum(4 * dr.abs(l_h), 1e-9)
            return dr.select((n_l > 0) & self.solid(si), share * facet + (1 - share) * n_l / dr.pi, 0)

        def angles(self, normal: Any, roughness: Any, viewer: Any, light: Any) -> tuple[Any, Any, Any, Any, Any]:
            """n·l, n·v, n·h, l·h, and the density of microfacets (GGX) there."""
            h = dr.normalize(viewer + light)
            n_v = dr.maximum(dr.abs(dr.dot(normal, viewer)), 1e-4)
            n_h = dr.clip(dr.dot(normal, h), 0, 1)
            alpha = dr.maximum(roughness * roughness, 2e-3)
            d = n_h * n_h * (alpha * alpha - 1) + 1
            return dr.dot(normal, light), n_v, n_h, dr.dot(light, h), alpha * alpha / (dr.pi * d * d)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any]:
            solid = self.solid(si)
            drawn = mi.BSDFSample3f()
            drawn.eta = 1.0
            drawn.sampled_component = dr.select(solid, mi.UInt32(0), mi.UInt32(1))
            drawn.sampled_type = dr.select(
                solid, mi.UInt32(int(mi.BSDFFlags.GlossyReflection)), mi.UInt32(int(mi.BSDFFlags.Null))
            )
            if self.last:
                drawn.wo, drawn.pdf = -si.wi, dr.select(solid, mi.Float(0), mi.Float(1))
                return drawn, dr.select(solid, mi.Color3f(0), mi.Color3f(1))
            normal, _, metallic, roughness = self.surface(si)
            viewer = si.to_world(si.wi)
            frame = mi.Frame3f(normal)
            alpha = dr.maximum(roughness * roughness, 2e-3)
            tangent2 = alpha * alpha * sample2.x / dr.maximum(1 - sample2.x, 1e-9)
            cosine = dr.rsqrt(1 + tangent2)
            sine = dr.sqrt(dr.maximum(1 - cosine * cosine, 0))
            angle = 2 * dr.pi * sample2.y
            h = frame.to_world(mi.Vector3f(sine * dr.cos(angle), sine * dr.sin(angle), cosine))
            mirrored = 2 * dr.dot(viewer, h) * h - viewer
            matte = frame.to_world(mi.warp.square_to_cosine_hemisphere(sample2))
            wo = si.to_local(dr.select(sample1 < self.gloss_share(metallic), mirrored, matte))
            density = self.density(si, wo)
            drawn.wo = dr.select(solid, wo, -si.wi)
            drawn.pdf = dr.select(solid, density, 1)
            weight = dr.select(density > 0, self.value(si, wo) / dr.maximum(density, 1e-30), 0)
            return drawn, dr.select(solid, weight, 1)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.value(si, wo)

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.density(si, wo)

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            return self.value(si, wo), self.density(si, wo)

        def eval_null_transmission(self, si: Any, active: Any = True) -> Any:
            return mi.Color3f(dr.select(self.solid(si), 0, 1))

        def has_attribute(self, name: str, active: Any = True) -> Any:
            return mi.Bool(name in ("emitted", "double_sided"))

        def eval_attribute_1(self, name: str, si: Any, active: Any = True) -> Any:
            return mi.Float(float(self.given["double_sided"]))

        def eval_attribute_3(self, name: str, si: Any, active: Any = True) -> Any:
            """What only the eye sees: reflected ambient light, and emitted where paths end and emitters are none."""
            light = mi.Color3f(self.ambient) * self.base(si)[0]
            if self.last:
                texel = self.maps["emissive"].at(si.uv) if "emissive" in self.maps else (1, 1, 1)
                light = light + mi.Color3f(self.given["emissive"]) * mi.Color3f(texel[0], texel[1], texel[2])
            return light

        def to_string(self) -> str:
            return "TyndallReflection[]"

    return Reflection


def _glow(mi: Any, dr: Any, read: Callable[..., Any]) -> Callable[..., Any]:
    """An emissive surface, on both sides. Paths find it by themselves; it is not asked for light."""

    class Glow(mi.Emitter):  # type: ignore[misc, name-defined, unused-ignore]
        def __init__(self, props: Any, material: dict[str, Any], images: Any) -> None:
            super().__init__(props)
            self.radiance = material["emissive"]
            self.map = read(material["maps"]["emissive"], images) if "emissive" in material["maps"] else None
            self.m_flags = int(mi.EmitterFlags.Surface)

        def eval(self, si: Any, active: Any = True) -> Any:
            texel = self.map.at(si.uv) if self.map else (1, 1, 1)
            return mi.Color3f(self.radiance) * mi.Color3f(texel[0], texel[1], texel[2])

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            ds = mi.DirectionSample3f()
            ds.p, ds.n, ds.d = it.p, mi.Normal3f(0, 1, 0), mi.Vector3f(0, 1, 0)
            ds.uv, ds.time, ds.dist = mi.Point2f(0.0, 0.0), it.time, mi.Float(0.0)
            ds.pdf, ds.delta = mi.Float(0.0), mi.Bool(False)
            return ds, mi.Color3f(0.0)

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return mi.Float(0.0)

        def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return mi.Color3f(0.0)

        def bbox(self) -> Any:
            return mi.ScalarBoundingBox3f()

        def to_string(self) -> str:
            return "TyndallGlow[]"

    return Glow


def _lamp(mi: Any, dr: Any, content: dict[str, Any]) -> Callable[..., Any]:
    """A light of Tyndall's. To Mitsuba it is a point or a direction, drawn anew for each sample."""
    medium = content["medium"]
    low, high = np.array(content["bounds"], np.float64)
    size = float(np.linalg.norm(high - low)) or 1.0
    # A shadow ray stops short of its end by this factor.
    stretch = 1 / (1 - mi.math.ShadowEpsilon)
    world = Box(mi, dr, (low - 1e-3 * size, high + 1e-3 * size))
    air = Box(mi, dr, medium and medium["bounds"] and enlarged(medium["bounds"]))

    class Lamp(mi.Emitter):  # type: ignore[misc, name-defined, unused-ignore]
        def __init__(self, props: Any, light: dict[str, Any]) -> None:
            super().__init__(props)
            self.given = light
            far = light["kind"] == "directional"
            self.m_flags = int(mi.EmitterFlags.DeltaDirection if far else mi.EmitterFlags.DeltaPosition)
            self.m_needs_sample_2 = self.m_needs_sample_3 = False

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            given = self.given
            intensity = mi.Color3f(given["intensity"])
            radius = given["radius"]
            if given["kind"] == "directional":
                axis = -mi.Vector3f(given["direction"])
                spread = 1 - 1 / float(np.sqrt(1 + radius * radius))
                # Even radiance E/(π sin²θ) over the cone's 2π(1 − cosθ).
                light = intensity * (2 / (2 - spread))
            elif given["kind"] == "rect":
                # Points even in area, each a small Lambertian of its part of the whole's candela.
                at = mi.Point3f(given["position"]) + (2 * sample.x - 1) * mi.Vector3f(given["across"])
                way = at + (2 * sample.y - 1) * mi.Vector3f(given["along"]) - it.p
                d2 = dr.maximum(dr.dot(way, way), 1e-8)
                distance = dr.sqrt(d2)
                axis = way / distance
                light = intensity * (dr.maximum(-dr.dot(axis, mi.Vector3f(given["direction"])), 0) / d2)
            else:
                way = mi.Point3f(given["position"]) - it.p
                d2 = dr.maximum(dr.dot(way, way), 1e-8)
                distance = dr.sqrt(d2)
                axis = way / distance
                sine2 = dr.minimum(radius * radius / d2, 1)
                spread = sine2 / (1 + dr.sqrt(1 - sine2))
                light = intensity * (2 / (2 - spread) / d2)
            if given["kind"] == "spot":
                cosine = -dr.dot(axis, mi.Vector3f(given["direction"]))
                falloff = dr.clip(cosine * given["cone_scale"] + given["cone_offset"], 0, 1)
                light = light * falloff * falloff
            if radius > 0 and given["kind"] != "rect":
                up = 1 - sample.x * spread
                side = dr.sqrt(dr.maximum(0, (1 - up) * (1 + up)))
                angle = 2 * dr.pi * sample.y
                local = mi.Vector3f(side * dr.cos(angle), side * dr.sin(angle), up)
                axis = mi.Frame3f(axis).to_world(local)
            if given["kind"] == "directional":
                # Nothing can be in the way beyond the scene.
                _, distance = world.interval(it.p, axis, FAR)
                distance = distance + 1e-3 * size
                if medium:
                    begin, end = air.interval(it.p, axis, distance)
                    light = light * dr.exp(mi.Color3f(medium["extinction"]) * (end - begin))
            ds = mi.DirectionSample3f()
            ds.p = it.p + axis * (distance * stretch)
            ds.n = mi.Normal3f(-axis)
            ds.uv = mi.Point2f(0.0, 0.0)
            ds.time = it.time
            ds.d = axis
            ds.dist = distance * stretch
            ds.pdf = mi.Float(1.0)
            ds.delta = mi.Bool(True)
            return ds, light

        def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return mi.Float(0.0)

        def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
            return mi.Color3f(0.0)

        def eval(self, si: Any, active: Any = True) -> Any:
            return mi.Color3f(0.0)

        def bbox(self) -> Any:
            return mi.ScalarBoundingBox3f()

        def to_string(self) -> str:
            return "TyndallLamp[]"

    return Lamp


def _phase(mi: Any, dr: Any) -> Callable[..., Any]:
    """Gibbons' and Schlick's phase functions, each drawn by inverting its distribution."""

    class Phase(mi.PhaseFunction):  # type: ignore[misc, name-defined, unused-ignore]
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            self.gibbons, self.k = bool(props["gibbons"]), float(props["k"])
            self.m_flags = int(mi.PhaseFunctionFlags.Anisotropic)

        def value(self, cosine: Any) -> Any:
            if self.gibbons:
                c2 = 0.5 * (1 + cosine)
                c8 = dr.square(dr.square(c2))
                return (1 + 9 * c8 * c8) / (8 * dr.pi)
            d = 1 - self.k * cosine
            return (1 - self.k * self.k) / (4 * dr.pi * d * d)

        def sample(self, ctx: Any, it: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any, Any]:
            x = sample2.x
            if self.gibbons:
                # Half is even; ∫ of the other, 9/2 ((1 + c)/2)⁸, is ((1 + c)/2)⁹.
                cosine = dr.select(sample1 < 0.5, 2 * x - 1, 2 * dr.power(dr.maximum(x, 1e-30), 1 / 9) - 1)
            else:
                cosine = (2 * x + self.k - 1) / (2 * self.k * x - self.k + 1)
            sine = dr.sqrt(dr.maximum(0, 1 - cosine * cosine))
            angle = 2 * dr.pi * sample2.y
            wo = mi.Frame3f(-it.wi).to_world(mi.Vector3f(sine * dr.cos(angle), sine * dr.sin(angle), cosine))
            return wo, mi.Color3f(1.0), self.value(cosine)

        def eval_pdf(self, ctx: Any, it: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            value = self.value(-dr.dot(wo, it.wi))
            return mi.Color3f(value), value

        def to_string(self) -> str:
            return "TyndallPhase[]"

    return Phase
