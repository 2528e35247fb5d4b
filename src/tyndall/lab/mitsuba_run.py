"""What runs in Mitsuba's own process: the plugins that Tyndall's scenes need, and the loop over their samples.

``python -m tyndall.lab.mitsuba_run render FOLDER`` reads ``scene.json`` and what it names, and writes ``result.npz``;
``probe VARIANT`` ends with 0 where a variant works. Only :mod:`tyndall.lab.mitsuba` starts it, and only numpy, Mitsuba
and Dr.Jit are imported: an LLVM that does not suit Dr.Jit aborts the process, and it should be a small one.

Light is transported by Mitsuba's own ``volpath`` (``volpathmis`` where the extinction differs between the colours).
What Mitsuba has no plugin for is in :mod:`tyndall.lab.mitsuba_plugins`.

A camera's ray first looks for the surface that Tyndall shows, through holes and culled faces. Then

    radiance = T·(emitted + reflected) + L_v,

where the transmittance T and the emitted light are known exactly, ``volpath`` gives the reflected light for a ray that
begins just before the surface, and L_v for one that ends there: with ``max_depth`` 2 this is direct light and single
scattering; at greater depths L_v holds all light whose last event before the eye was in the air.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.lab.mitsuba_plugins import FAR, Box, enlarged, phase_dict, register

LANES = {"cuda": 1 << 24, "llvm": 1 << 19}  # samples in one launch
LEAST = 32  # samples a pixel before an error is believed
STEP = 2e-5  # of its distance, by which a ray gets past what it goes through; Mitsuba's own step shifts it aside
GAP = 1e-4  # the part of the way to a surface that its own light is looked at from


def main() -> None:
    task, argument = sys.argv[1:3]
    threading.Thread(target=_end_with_parent, daemon=True).start()
    status = 0
    try:
        if task == "probe":
            probe(argument)
        else:
            render(Path(argument))
    except (Exception, KeyboardInterrupt) as error:
        told = str(error).strip().splitlines() or [""]
        print(f"{type(error).__name__}: {told[0]}", file=sys.stderr, flush=True)
        status = 1
    # Mitsuba's and LLVM's own clean-up at exit may crash where the work did not.
    os._exit(status)


def _end_with_parent() -> None:
    """Standard input is a pipe from the parent that nobody writes to: it ends when the parent does."""
    while os.read(0, 4096):
        pass
    os._exit(1)


def report(**news: Any) -> None:
    """One line of JSON to the parent."""
    print(json.dumps(news), flush=True)


def load(variant: str) -> tuple[Any, Any]:
    """Mitsuba and Dr.Jit with a variant set.

    Raises:
        ImportError: the package is missing, or the variant cannot be set here.
    """
    import drjit
    import mitsuba

    mitsuba.set_variant(variant)
    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    return mitsuba, drjit


def probe(variant: str) -> None:
    """A tiny picture with every kind of plugin, as a variant may load and then fail to compile."""
    begin = time.monotonic()
    mi, dr = load(variant)
    material = {"base_color": [0.5] * 4, "metallic": 0.5, "roughness": 0.5, "emissive": [0.0] * 3}
    content = {
        "meshes": [{"file": "mesh.ply", "material": 0}],
        "materials": [{**material, "alpha_cutoff": 0.0, "double_sided": True, "maps": {}}],
        "lights": [_PROBE_LIGHT, {**_PROBE_LIGHT, "kind": "directional", "radius": 0.01}],
        "medium": {
            "scattering": [0.1] * 3,
            "extinction": [0.2] * 3,
            "bounds": [[-2.0] * 3, [2.0] * 3],
            "phase": {"kind": "schlick", "parameter": 0.3},
        },
        "bounds": [[-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]],
        "camera": {"position": [0, 0, 1], "right": [0.4, 0, 0], "up": [0, 0.4, 0], "forward": [0, 0, -1], "near": 0.01},
        "background": [0.0] * 3,
        "ambient": [0.1] * 3,
        "size": [4, 4],
        "depth": 2,
        "filter": "box",
    }
    with tempfile.TemporaryDirectory() as folder:
        corners = np.array([(-1, -1, 0), (1, -1, 0), (0, 1, 0)], np.float32)
        write_ply(Path(folder) / "mesh.ply", corners, np.eye(3)[[2, 2, 2]], np.zeros((3, 2)), np.array([(0, 1, 2)]))
        tracer = Tracer(mi, dr, content, Path(folder))
    mean = np.mean(tracer.samples(1, 4)["radiance"])
    if not mean > 0:
        raise RuntimeError(f"a white picture came out as {mean}")
    report(variant=variant, version=mi.__version__, seconds=round(time.monotonic() - begin, 2))


_PROBE_LIGHT = {
    "kind": "spot",
    "position": [0.0, 0.0, 1.0],
    "direction": [0.0, 0.0, -1.0],
    "intensity": [1.0] * 3,
    "radius": 0.0,
    "cone_scale": 2.0,
    "cone_offset": -1.0,
}


def render(folder: Path) -> None:
    """Add passes until the error asked for, the most samples or the most seconds are reached."""
    begin = time.monotonic()
    content = json.loads((folder / "scene.json").read_text())
    mi, dr = load(content["variant"])
    tracer = Tracer(mi, dr, content, folder)
    most, limit, target, seed = (content[name] for name in ("samples", "seconds", "target", "seed"))
    width, height = content["size"]
    lanes = LANES.get(content["variant"].split("_")[0], 0)
    batch = int(np.clip(lanes // (width * height), 1, most))
    tracer.samples(seed, batch, pixels=min(64, width * height))  # compiles
    depth = tracer.depth()
    setup = time.monotonic() - begin
    report(setup=round(setup, 3))

    sums = Moments((height, width, 3))
    begin = time.monotonic()
    passes = 0
    while True:
        passes += 1
        found = tracer.samples(seed + passes, batch)
        sums.add(found, batch)
        seconds = time.monotonic() - begin
        errors = sums.relative_errors()
        report(samples=sums.count, seconds=round(seconds, 3), errors=errors)
        reached = sums.count >= min(LEAST, most) and all(error <= target for error in errors.values())
        if reached or sums.count + batch > most or (limit and seconds * (passes + 1) / passes > limit):
            break
    results: dict[str, Any] = {
        "depth": depth,
        "samples": sums.count,
        "seconds": seconds,
        "setup": setup,
        "culled": tracer.culled,
        **sums.results(),
    }
    np.savez(folder / "result.npz", **results)


def write_ply(
    path: Path, positions: NDArray[Any], normals: NDArray[Any], uvs: NDArray[Any], triangles: NDArray[Any]
) -> None:
    """A binary PLY file of (V, 3) positions and normals, (V, 2) texture coordinates and (T, 3) indices."""
    vertices = np.zeros(len(positions), np.dtype([("position", "<f4", 3), ("normal", "<f4", 3), ("uv", "<f4", 2)]))
    vertices["position"], vertices["normal"], vertices["uv"] = positions, normals, uvs
    faces = np.zeros(len(triangles), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    faces["count"], faces["corners"] = 3, triangles
    names = ("x", "y", "z", "nx", "ny", "nz", "u", "v")
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(vertices)}",
        *(f"property float {name}" for name in names),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    with path.open("wb") as file:
        file.write(("\n".join(header) + "\n").encode())
        vertices.tofile(file)
        faces.tofile(file)


class Moments:
    """Sums of samples and of their squares, by kind of light and pixel."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.count = 0
        kinds = ("radiance", "inscattered", "surfaces")
        self.first = {kind: np.zeros(shape) for kind in kinds}
        self.second = {kind: np.zeros(shape) for kind in kinds}

    def add(self, found: dict[str, NDArray[Any]], count: int) -> None:
        self.count += count
        for kind, total in self.first.items():
            total += found[kind].reshape(total.shape)
            self.second[kind] += found[f"{kind}_squared"].reshape(total.shape)

    def mean(self, kind: str) -> NDArray[np.float64]:
        value: NDArray[np.float64] = self.first[kind] / self.count
        return value

    def error(self, kind: str) -> NDArray[np.float64]:
        """Standard error of the mean; that of one sample is unknown, and infinite."""
        if self.count < 2:
            return np.full(self.first[kind].shape, np.inf)
        variance = np.maximum(0.0, self.second[kind] / self.count - self.mean(kind) ** 2)
        error: NDArray[np.float64] = np.sqrt(variance / (self.count - 1))
        return error

    def relative_errors(self) -> dict[str, float]:
        """√mean(error²) / mean of the light; of darkness 0."""
        found = {}
        for kind in ("radiance", "inscattered"):
            light, error = float(self.mean(kind).mean()), self.error(kind)
            found[kind] = float(np.sqrt(np.mean(error**2))) / light if light else 0.0
        return found

    def results(self) -> dict[str, NDArray[np.float32]]:
        means = {kind: self.mean(kind).astype(np.float32) for kind in self.first}
        return {**means, **{f"{kind}_error": self.error(kind).astype(np.float32) for kind in self.first}}


class Tracer:
    """A scene in Mitsuba, and samples of its pixels. ``content`` is what ``scene.json`` holds."""

    def __init__(self, mi: Any, dr: Any, content: dict[str, Any], folder: Path) -> None:
        self.mi, self.dr, self.content = mi, dr, content
        self.scalar = mi.variant().startswith("scalar")
        self.culled = 0.0
        self._sights: dict[int, dict[str, Any]] = {}
        images: dict[str, NDArray[np.uint8]] = {}
        if (folder / "images.npz").exists():
            with np.load(folder / "images.npz") as file:
                images = dict(file)
        medium = content["medium"]
        self.medium: Any = None
        self.air = Box(mi, dr, medium and medium["bounds"])
        self.solid_air = Box(mi, dr, None)  # as Mitsuba has it
        self.may_be_outside = False
        scene: dict[str, Any] = {"type": "scene"}
        register(mi, dr, content, images)
        for index, _ in enumerate(content["lights"]):
            scene[f"light {index}"] = {"type": "tyndall_lamp", "index": index}
        if medium:
            sigma = np.maximum(
                medium["extinction"], 1e-6 * max(medium["extinction"])
            )  # a colour without loses no sample
            grey = bool(np.ptp(sigma) <= 1e-6 * sigma.max())
            albedo = np.minimum(np.divide(medium["scattering"], sigma), 1.0)
            self.medium = mi.load_dict(
                {
                    "type": "homogeneous",
                    "albedo": {"type": "rgb", "value": [float(x) for x in albedo]},
                    "sigma_t": {"type": "rgb", "value": [float(x) for x in sigma / sigma.max()]},
                    "scale": float(sigma.max()),
                    "has_spectral_extinction": not grey,
                    "phase": phase_dict(medium["phase"]),
                }
            )
            if medium["bounds"] is not None:
                low, high = enlarged(medium["bounds"])
                self.solid_air = Box(mi, dr, (low, high))
                scene_low, scene_high = np.array(content["bounds"])
                self.may_be_outside = bool((scene_low < low).any() or (scene_high > high).any())
                transform = mi.ScalarTransform4f()
                scene["medium"] = {
                    "type": "cube",
                    "to_world": transform.translate(list((low + high) / 2)).scale(list((high - low) / 2)),
                    "bsdf": {"type": "null"},
                    "interior": self.medium,
                }
        else:
            grey = True
        bounces = content["depth"] > 2  # else what shines is only seen, which _sample sees to
        if bounces and any(content["background"]):
            scene["background"] = {"type": "constant", "radiance": {"type": "rgb", "value": content["background"]}}
        asked = len(content["lights"]) + ("background" in scene)
        for index, mesh in enumerate(content["meshes"]):
            shape: dict[str, Any] = {
                "type": "ply",
                "filename": str(folder / mesh["file"]),
                "bsdf": {"type": "tyndall_reflection", "index": mesh["material"]},
            }
            if bounces and any(content["materials"][mesh["material"]]["emissive"]):
                shape["emitter"] = {"type": "tyndall_glow", "index": mesh["material"]}
                if asked:  # Mitsuba refuses a scene whose lights all have no weight
                    shape["emitter"]["sampling_weight"] = 0.0
            scene[f"mesh {index}"] = shape
            if "normals" in mesh:
                scene[f"mesh {index}"] = loaded = mi.load_dict(shape)
                parameters = mi.traverse(loaded)
                normals = np.load(folder / mesh["normals"]).ravel()
                parameters["vertex_normals"] = type(parameters["vertex_normals"])(normals)
                parameters.update()
        if len(scene) == 1 + len(content["lights"]) and not medium:
            scene["nothing"] = {"type": "sphere", "radius": 1e-6, "center": [0.0, -1e6, 0.0]}
        self.scene = mi.load_dict(scene)

        def integrator(hide: bool) -> Any:
            kind = "volpath" if grey else "volpathmis"
            depth = {"max_depth": content["depth"], "rr_depth": 1000}
            return mi.load_dict({"type": kind, **depth, "hide_emitters": hide})

        self.integrator = integrator(False)
        # A ray that ends in the air would see the background there. (To hide an emissive surface is to see through it.)
        self.air_integrator = integrator(True)
        self.sampler = mi.load_dict({"type": "independent"})

    # --- samples --------------------------------------------------------------------------------------------------

    def samples(self, seed: int, count: int, pixels: int | None = None) -> dict[str, NDArray[Any]]:
        """Sums over ``count`` samples of every pixel, and of their squares: (pixels, 3) each, by kind.

        Args:
            pixels: the number of pixels, from the first row on; None for all.
        """
        width, height = self.content["size"]
        total = width * height if pixels is None else pixels
        return (self._scalar_samples if self.scalar else self._parallel_samples)(seed, count, total)

    def _parallel_samples(self, seed: int, count: int, pixels: int) -> dict[str, NDArray[Any]]:
        mi, dr = self.mi, self.dr
        # A literal seed would be part of the kernel, which then is compiled for every pass.
        self.sampler.seed(dr.opaque(mi.UInt32, seed), pixels * count)
        pixel = dr.arange(mi.UInt32, pixels * count) // count
        inscattered, surfaces, culled = self._sample(pixel)
        everywhere = dr.zeros(mi.Float, pixels * count)  # what no sample takes part in is a single number
        sums = {}
        for kind, light in (
            ("inscattered", inscattered),
            ("surfaces", surfaces),
            ("radiance", inscattered + surfaces),
        ):
            sums[kind] = [dr.block_sum(c + everywhere, count) for c in light]
            sums[f"{kind}_squared"] = [dr.block_sum(dr.square(c) + everywhere, count) for c in light]
        seen = dr.mean(dr.select(culled, 1.0, 0.0))
        dr.eval(sums, seen)
        self.culled = float(seen[0])
        return {kind: np.stack([np.array(c) for c in value], axis=-1) for kind, value in sums.items()}

    def _scalar_samples(self, seed: int, count: int, pixels: int) -> dict[str, NDArray[Any]]:
        self.sampler.seed(seed)
        kinds = ("inscattered", "surfaces", "radiance")
        sums = {name: np.zeros((pixels, 3)) for kind in kinds for name in (kind, f"{kind}_squared")}
        met = 0
        for pixel in range(pixels):
            for _ in range(count):
                inscattered, surfaces, culled = self._sample(pixel)
                met += bool(culled)
                for kind, light in zip(kinds, (inscattered, surfaces, inscattered + surfaces), strict=True):
                    value = np.array([light[0], light[1], light[2]])
                    sums[kind][pixel] += value
                    sums[f"{kind}_squared"][pixel] += value**2
        self.culled = met / (pixels * count)
        return sums

    def _camera_ray(self, pixel: Any, dx: Any, dy: Any) -> Any:
        """Origin, unit direction, and the ray's length for 1 m of view depth; as in wesl/camera.wesl."""
        mi, dr, camera = self.mi, self.dr, self.content["camera"]
        width, height = self.content["size"]
        column, row = pixel % width, pixel // width
        x = 2 * (mi.Float(column) + dx) / width - 1
        y = 1 - 2 * (mi.Float(row) + dy) / height
        way = mi.Vector3f(camera["forward"]) + x * mi.Vector3f(camera["right"]) + y * mi.Vector3f(camera["up"])
        stretch = dr.norm(way)
        return mi.Point3f(camera["position"]), way / stretch, stretch

    def _sample(self, pixel: Any) -> tuple[Any, Any, Any]:
        """(L_v, T·L_b, whether a culled face was met) of one sample of pixels."""
        sight = self._sights.get(pixel) if self.scalar else None
        if sight is None:
            sight = self._sight(pixel)
            if self.scalar and self.content["filter"] == "centre" and sight["parts"] == 1:
                self._sights[pixel] = sight  # no chance in it: the same for all samples
        surfaces = sight["emitted"] + sight["dimmed"] * self._reflected(sight)
        inscattered = self.mi.Color3f(0.0)
        if self.medium is not None and any(self.content["medium"]["scattering"]):
            light = self._light(self.air_integrator, sight["air"], self.medium, sight["has_air"])
            inscattered = light * sight["air_weight"]
        return inscattered, surfaces, sight["culled"]

    def _sight(self, pixel: Any) -> dict[str, Any]:
        """What is known without light's transport: the surface a camera ray meets, and the air in front."""
        mi, dr, content = self.mi, self.dr, self.content
        jitter = self.sampler.next_2d() if content["filter"] == "box" else mi.Point2f(0.5, 0.5)
        origin, way, stretch = self._camera_ray(pixel, jitter.x, jitter.y)
        seen = self._look(origin, way, content["camera"]["near"] * stretch)
        hit, end = seen["hit"], dr.select(seen["hit"], seen["t"], FAR)
        begin, leave = self.air.interval(origin, way, end)
        emitted = mi.Color3f(content["background"])
        if not self.scalar or hit:
            emitted = dr.select(hit, seen["si"].bsdf().eval_attribute_3("emitted", seen["si"], hit), emitted)
        emitted = emitted * self._dimmed(leave - begin)

        before = end * (1 - GAP)
        begin, leave = self.air.interval(origin, way, before)
        position = origin + way * before
        in_air = self.solid_air.contains(position)
        # One of the parts between holes and culled faces: a ray forgets its end when it passes through a hole.
        first = dr.maximum(begin, seen["first"] * (1 + STEP))
        last = dr.minimum(leave, seen["last"] * (1 - GAP))
        return {
            "culled": seen["culled"],
            "parts": seen["parts"],
            "emitted": emitted,
            "dimmed": self._dimmed(leave - begin),
            "ray": mi.RayDifferential3f(mi.Ray3f(position, way)),
            "hit_in_air": hit & in_air,
            "hit_outside": hit & (in_air == False),  # noqa: E712 - of a scalar, too
            "air": mi.RayDifferential3f(mi.Ray3f(origin + way * first, way, last - first, 0.0, mi.Color0f())),
            "has_air": last > first,
            "air_weight": self._dimmed(first - begin) * seen["parts"],
        }

    def _light(self, integrator: Any, ray: Any, medium: Any, active: Any) -> Any:
        mi, dr = self.mi, self.dr
        if self.scalar and not active:
            return mi.Color3f(0.0)
        light, _, _ = integrator.sample(self.scene, self.sampler, ray, medium, active)
        return dr.select(active, light, 0.0)

    def _reflected(self, sight: dict[str, Any]) -> Any:
        """Light that a surface reflects towards the eye, seen from just before it."""
        light = self._light(self.integrator, sight["ray"], self.medium, sight["hit_in_air"])
        if self.may_be_outside:
            light = light + self._light(self.integrator, sight["ray"], None, sight["hit_outside"])
        return light

    def _dimmed(self, length: Any) -> Any:
        """Beer–Lambert."""
        medium = self.content["medium"]
        if not medium:
            return self.mi.Color3f(1.0)
        return self.dr.exp(-self.mi.Color3f(medium["extinction"]) * length)

    def _look(self, origin: Any, way: Any, near: Any) -> dict[str, Any]:
        """The first surface that is shown: holes and the backs of single-sided surfaces are passed.

        Those divide the ray into parts. One of them is chosen, each as likely as the others, while they are found.
        """
        mi, dr, sampler = self.mi, self.dr, self.sampler

        def along(state: dict[str, Any]) -> Any:
            return mi.Ray3f(state["from"], way)

        def body(s: dict[str, Any]) -> dict[str, Any]:
            si = self.scene.ray_intersect(along(s), s["active"])
            shape = s["active"] & si.is_valid()
            t = dr.dot(si.p - origin, way)
            air = shape & si.is_medium_transition()  # the face of the medium's box: no surface of Tyndall's
            solid = shape & ~air
            bsdf = si.bsdf()
            hole = solid & (bsdf.eval_null_transmission(si, solid).x > 0)
            back = solid & ~hole & (dr.dot(si.n, way) > 0) & (bsdf.eval_attribute_1("double_sided", si, solid) < 0.5)
            skipped = hole | back
            shown = solid & ~skipped
            last = dr.select(s["open"] & solid, t, s["last"])
            parts = dr.select(skipped, s["parts"] + 1, s["parts"])
            chosen = skipped & (sampler.next_1d(s["active"]) * parts < 1)
            return {
                "from": dr.select(skipped | air, origin + way * (t * (1 + STEP)), s["from"]),
                "active": (skipped | air) & (parts < 1000),
                "hit": s["hit"] | shown,
                "t": dr.select(shown, t, s["t"]),
                "parts": parts,
                "first": dr.select(chosen, t, s["first"]),
                "last": dr.select(chosen, FAR, last),
                "open": dr.select(solid, chosen, s["open"]),
                "culled": s["culled"] | back,
            }

        def scalar_body(s: dict[str, Any]) -> dict[str, Any]:
            si = self.scene.ray_intersect(along(s))
            if not si.is_valid():
                return {**s, "active": False}
            t = dr.dot(si.p - origin, way)
            onward = {**s, "from": origin + way * (t * (1 + STEP))}
            if si.is_medium_transition():
                return onward
            bsdf = si.bsdf()
            hole = bsdf.eval_null_transmission(si).x > 0
            back = not hole and dr.dot(si.n, way) > 0 and bsdf.eval_attribute_1("double_sided", si) < 0.5
            closed = {"last": t if s["open"] else s["last"], "open": False}
            if not (hole or back):
                return {**s, **closed, "hit": True, "t": t, "active": False}
            parts = s["parts"] + 1
            if sampler.next_1d() * parts < 1:
                closed = {"first": t, "last": FAR, "open": True}
            return {**onward, **closed, "parts": parts, "culled": s["culled"] or back, "active": parts < 1000}

        start = {
            "from": origin + way * near,
            "active": mi.Bool(True),
            "hit": mi.Bool(False),
            "t": mi.Float(FAR),
            "parts": mi.Float(1),
            "first": mi.Float(0),
            "last": mi.Float(FAR),
            "open": mi.Bool(True),
            "culled": mi.Bool(False),
        }
        if self.scalar:
            while start["active"]:
                start = scalar_body(start)
        else:
            # The sampler's state changes in the loop, and so is part of its state.
            names = list(start)

            def condition(sampler: Any, *values: Any) -> Any:
                return values[names.index("active")]

            def step(sampler: Any, *values: Any) -> Any:
                after = body(dict(zip(names, values, strict=True)))
                return (sampler, *(after[name] for name in names))

            _, *values = dr.while_loop((sampler, *start.values()), condition, step)
            start = dict(zip(names, values, strict=True))
        # The surface itself once more: a loop's state is cheaper without it.
        si = self.scene.ray_intersect(mi.Ray3f(start["from"], way), start["hit"])
        return {**start, "si": si}

    def depth(self) -> NDArray[np.float32]:
        """(H, W) float32: metres along the view axis at the pixels' centres, infinite for the background."""
        mi, dr = self.mi, self.dr
        width, height = self.content["size"]

        def one(pixel: Any) -> Any:
            origin, way, stretch = self._camera_ray(pixel, 0.5, 0.5)
            seen = self._look(origin, way, self.content["camera"]["near"] * stretch)
            return dr.select(seen["hit"], seen["t"] / stretch, dr.inf)

        if self.scalar:
            values = [one(pixel) for pixel in range(width * height)]
        else:
            self.sampler.seed(0, width * height)
            values = one(dr.arange(mi.UInt32, width * height))
        return np.array(values, np.float32).reshape(height, width)


if __name__ == "__main__":
    main()
