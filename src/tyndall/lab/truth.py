"""Truth: a scene traced until its error is as small as asked for, and known.

Light of a pixel is ``L_b·T + L_v`` as in the raster frame, with rays in place of shadow maps and samples in place of
steps. With ``depth = 2``, the meaning of "truth" for all techniques of the frame:

- a surface that the camera sees emits, reflects the ambient light (``ambient·albedo``) and reflects every light that a
  shadow ray reaches, with the frame's own material model; where nothing is hit there is the background. All of it is
  dimmed by the air in front;
- the air scatters every light once, ``L_v = ∫ σs · p · E · V · e^(−σt·s) ds``: visibility by a shadow ray from a
  sampled point of the camera ray. Under a directional light the density of these points falls with the transmittance
  (the mean of the channels' densities); for the others they are even in the angle at the light, inside a spot's cone or
  before a rectangle (Kulla and Fajardo 2012), mixed with the former the denser the air is (balance heuristic: Veach and
  Guibas 1995).

A greater ``depth`` adds all paths of up to that many edges (camera to surface or air is the first), as Mitsuba's
``max_depth`` counts them: light between surfaces, and multiple scattering. The camera ray branches into surface and
air; from there one path each goes on, by the phase function (inverted in closed form), or by the visible normals of the
gloss (Heitz 2018) and the cosine of the base. At each edge one light is asked in the air along it and one at the
surface behind it; channels of a coloured medium share paths by the balance heuristic (Wilkie et al. 2014), and weak
paths end by chance. What bounced rays see:

- emissive surfaces and the background do shine on others, from ``depth = 3`` on, paths of two edges included. At
  ``depth = 2`` they are only seen, as in the frame (in this Mitsuba differs, where they then light what the camera
  sees);
- the ambient light stays what it is in the frame, a term of the surfaces that the camera sees: it stands for bounces,
  and for a truth with bounces it is best set to 0;
- a surface reflects on both sides, and what its shading normal lets through beneath its true face is absorbed. For the
  camera, as in the frame, single-sided materials have no back;
- a directional light's illuminance is that which arrives in the medium, so nothing dims it; the others are dimmed on
  their way. A light with a size is sampled in the cone that it fills, a rectangle in its points; none is itself seen.

**Samples** are Owen-scrambled Sobol points (Burley 2020), which converge faster than random ones, but whose scatter
says nothing of their error. So a pixel's samples come in batches, each with a scrambling of its own: batches are
independent, and the scatter of their means gives the standard error of the whole, honestly for any integrand. It is
known to about ``1/sqrt(2·(batches − 1))`` of itself; there are 16 batches or more if ``samples`` and ``seconds`` allow
it.

**A pilot** of 64 samples, or fewer where ``seconds`` are short, finds out which part of each camera ray each light
reaches, and which pixels scatter. The batches then put most of their samples there (never all), and the pilot is
forgotten: what depends on it is only where samples go, not what they say, so the mean has no bias.

**The unit of light** on the device is the scene's own brightness (:func:`unit_of`), a power of two, so that the squares
of dim and of bright light alike are within the range of its 32-bit numbers.

**A software adapter** silently ends an invocation's loops after some 65,000 turns, and the march through implicit
surfaces takes many. So a dispatch gives a pixel few samples there, each invocation says when its loops were ended
early, and the truth is then traced anew with one sample a dispatch, or refused: it is never silently wrong.

**The error that stops** is :meth:`Truth.relative_error`, of radiance and of in-scattered light alike, summed on the
device. **The cache** keeps truths by content (scene, size, depth, filter, seed, the code that took part, the versions
of wgpu and wesl-py, and whether a processor or a GPU draws), under ``$TYNDALL_CACHE/truth``, of the last few versions
of the code: a truth with a smaller error serves a request for a larger one, is where a request for a smaller one goes
on from, and is never replaced by a worse one.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import math
import shutil
import time
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

import tyndall
from tyndall.frame import depth_range, light_kinds, lights_power, pack_camera, pack_lights, pack_medium
from tyndall.gpu.device import Gpu, GpuError
from tyndall.gpu.params import ParameterError, check, param
from tyndall.gpu.resources import Buffer, Closing
from tyndall.lab.fingerprint import scene_hash
from tyndall.scene.bundled.cache import directory, version_of
from tyndall.scene.files.atomic import atomic_write
from tyndall.scene.model import Scene
from tyndall.sdf.field import Field
from tyndall.sdf.paint import materials_of
from tyndall.tracing.world import World

OWNER = "truth"
BATCHES = 16  # the least number that a standard error is taken from, where samples and seconds last
_MODULE = "package::lab::truth"
_GROUPS = 64  # of the kernel that sums errors; as in truth.wesl
_MOST_LIGHTS = 16  # asked by each sample; as in truth.wesl
_EVEN, _PILOT, _PLANNED = 0, 1, 2  # as in truth.wesl
_PILOT_BATCHES, _PILOT_SAMPLES = 4, 16
_PILOT_NUMBERS = 1 << 30  # sequences of their own
_WORTH_A_PILOT = 1024  # samples
_SUBMIT_S = 0.25  # work sent at once: short enough for any driver's watchdog, long enough to fill a device
_LOOP_LIMIT = 50_000  # iterations that a software adapter runs before it silently cuts an invocation's loops: 2^16
_VERSIONS = 4  # of the code, whose truths the cache keeps
_RAY_STEPS = 200  # iterations of a ray among triangles, generously
_MARCH_STEPS, _LISTED = 60, 24  # of a ray through implicit surfaces, and what it runs at each; many need more

Floats = NDArray[np.float32]
Kind = Literal["radiance", "inscattered"]


@dataclass(frozen=True)
class TruthSettings:
    """When a truth is good enough, and what it holds.

    It is done when the relative standard error is ``target`` or smaller, or else after ``samples`` or ``seconds``.
    """

    target: float = param(0.01, 0, 1, "relative standard error to stop at; see Truth.relative_error")
    samples: int = param(65536, 32, 1 << 24, "most samples of a pixel")
    seconds: float = param(0.0, 0, None, "longest time; 0: no limit", unit="s")
    depth: int = param(2, 2, 64, "most edges of a path; 2: surfaces lit directly, light scattered once in the air")
    filter: Literal["centre", "box"] = param("centre", doc="rays through pixels' centres, or through all of a pixel")
    seed: int = param(0, 0, 2**32 - 1, "of the samples")

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, eq=False)
class Truth:
    """What a judge of pictures found, traced here or by another renderer. Light is linear, before exposure.

    Attributes:
        judge: who: "traced", or another renderer's name and variant.
        radiance: (H, W, 3) float32, ``L_b·T + L_v``.
        inscattered: (H, W, 3) float32, ``L_v``: the part whose last scattering was in the air.
        surfaces: (H, W, 3) float32, ``L_b·T``: the part that comes from surfaces or the background; None where unknown.
        depth: (H, W) float32, metres along the view axis through the pixels' centres, inf for background; None where
            unknown.
        radiance_error, inscattered_error: (H, W, 3) float32, standard errors of the means.
        samples: of each pixel.
        seconds: that it took to trace, when it was traced.
        size: width and height in pixels.
        settings: how it was made, as plain data.
        batches: independent ones that the errors are estimated from: they have one degree of freedom less; None where
            that is so many that it does not matter.
    """

    judge: str
    radiance: Floats
    inscattered: Floats
    surfaces: Floats | None
    depth: Floats | None
    radiance_error: Floats
    inscattered_error: Floats
    samples: int
    seconds: float
    size: tuple[int, int]
    settings: Mapping[str, Any]
    batches: int | None = None

    @property
    def freedom(self) -> int | None:
        """Degrees of freedom of the errors, for :func:`tyndall.lab.ztest.z_test`; None where there are many."""
        return None if self.batches is None else self.batches - 1

    def relative_error(self, kind: Kind = "radiance") -> float:
        """The relative standard error ``sqrt(mean(error²)) / mean(light)`` over all pixels and channels; 0 without
        light.
        """
        light = self.radiance if kind == "radiance" else self.inscattered
        error = self.radiance_error if kind == "radiance" else self.inscattered_error
        return _relative(float(np.mean(np.square(error, dtype=np.float64))), float(light.mean(dtype=np.float64)))


def trace(
    scene: Scene,
    size: tuple[int, int],
    settings: TruthSettings | None = None,
    *,
    gpu: Gpu | None = None,
    adapter: str | None = None,
    cache: bool = True,
    progress: Callable[[float], object] | None = None,
) -> Truth:
    """Trace a scene until the settings are met.

    Args:
        size: width and height in pixels.
        settings: :class:`TruthSettings`; the default asks for a relative standard error of 1 %.
        gpu: the device; one is made, and closed, when none is given.
        adapter: part of an adapter's name, for a device of its own.
        cache: look for an earlier truth, and keep this one.
        progress: hears a fraction of 1, an estimate.

    Raises:
        GpuError: no adapter, a picture or scene beyond its limits, or rays that march through implicit surfaces for
            longer than a software adapter lets them.
        ParameterError: no scene, a size that is not in whole pixels, or light beyond the range of 32-bit numbers.
    """
    settings = settings or TruthSettings()
    if not isinstance(scene, Scene):
        raise ParameterError(f"scene: {scene!r} is no Scene; tyndall.load reads one, tyndall.scenes has some")
    if len(size) != 2 or not all(isinstance(side, (int, np.integer)) for side in size):
        raise ParameterError(f"size: {size!r} is not a width and a height in whole pixels")
    if min(size) < 1:
        raise GpuError(f"size: {size[0]}×{size[1]} is not a picture")
    size = int(size[0]), int(size[1])
    device = gpu or Gpu(adapter)
    try:
        entry = _entry(scene, size, settings, device) if cache else None
        before = _load(entry, size) if entry else None
        if before is not None and _met(before, settings):
            if progress:
                progress(1.0)
            return _described(before, settings)
        try:
            with _Tracer(device, scene, size, settings) as tracer:
                found = _converge(tracer, settings, before, progress)
        except _CutOffError:
            with _Tracer(device, scene, size, settings, most_samples=1) as tracer:
                found = _converge(tracer, settings, before, progress)
    finally:
        if gpu is None:
            device.close()
    if entry:
        with contextlib.suppress(OSError):  # a cache that cannot be written is no error
            _save(entry, found)
    return found


def unit_of(scene: Scene) -> float:
    """About the brightest light of a scene, a power of two; 1 without light. See the module.

    Raises:
        ParameterError: it is beyond the range of 32-bit numbers.
    """
    start, reach = depth_range(scene.camera, scene)
    materials = [instance.mesh.material for instance in scene.instances]
    for implicit in scene.implicits:
        materials += [implicit.material, *materials_of(implicit.shape)]
    emissive = (max(material.emissive) for material in materials)
    brightest = max(lights_power(scene, reach - start), *scene.ambient, *scene.background, *emissive)
    if brightest > float(np.finfo(np.float32).max):
        raise _out_of_range()
    return math.ldexp(1.0, math.frexp(brightest)[1]) if brightest > 0 else 1.0


def _in_unit(scene: Scene, unit: float) -> Scene:
    """The scene with all light but what surfaces emit divided by ``unit``."""
    ambient, background = ((r / unit, g / unit, b / unit) for r, g, b in (scene.ambient, scene.background))
    lights = []
    for light in scene.lights:
        r, g, b = (c * light.intensity / unit for c in light.color)
        lights.append(dataclasses.replace(light, intensity=1.0, color=(r, g, b)))
    return scene.with_(lights=lights, ambient=ambient, background=background)


def _out_of_range() -> ParameterError:
    return ParameterError("truth: light beyond the range of 32-bit numbers; scale the scene's lights")


def _relative(square_error: float, mean: float) -> float:
    if square_error <= 0:
        return 0.0
    return math.sqrt(square_error) / mean if mean > 0 else math.inf


def _described(truth: Truth, settings: TruthSettings) -> Truth:
    return dataclasses.replace(truth, settings=dataclasses.asdict(settings))


# --- convergence --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Level:
    """Means over pixels and channels, of radiance and of in-scattered light: of the light, and of its square error."""

    samples: int
    light: tuple[float, float]
    square: tuple[float, float]

    @classmethod
    def of(cls, truth: Truth) -> _Level:
        light = [float(x.mean(dtype=np.float64)) for x in (truth.radiance, truth.inscattered)]
        errors = (truth.radiance_error, truth.inscattered_error)
        square = [float(np.square(x, dtype=np.float64).mean()) for x in errors]
        return cls(truth.samples, (light[0], light[1]), (square[0], square[1]))

    def pooled(self, other: _Level) -> _Level:
        """Of the mean of both, weighed by their samples."""
        samples = self.samples + other.samples
        a, b = self.samples / samples, other.samples / samples
        light = [a * x + b * y for x, y in zip(self.light, other.light, strict=True)]
        square = [a * a * x + b * b * y for x, y in zip(self.square, other.square, strict=True)]
        return _Level(samples, (light[0], light[1]), (square[0], square[1]))

    @property
    def error(self) -> float:
        """The greater of the two relative standard errors."""
        return max(_relative(s, m) for s, m in zip(self.square, self.light, strict=True))


def _met(truth: Truth, settings: TruthSettings) -> bool:
    return _Level.of(truth).error <= settings.target or truth.samples + 2 > settings.samples


def _affordable(settings: TruthSettings, room: int) -> Callable[[_Level, float], int]:
    """How many samples an ordinary pixel's batch takes, so that the target is met with :data:`BATCHES` of them.

    A longer sequence serves better than more sequences: the error of a batch falls almost as 1/n, that of their mean as
    the square root. A power of two, as the points are evenest then.
    """

    def choose(pilot: _Level, seconds: float) -> int:
        # The plan itself takes most of the error away.
        gain = 0.25 * math.sqrt(_PILOT_BATCHES / BATCHES)
        wanted = pilot.samples / _PILOT_BATCHES * gain * min(pilot.error / max(settings.target, 1e-6), 1e6)
        most = room / BATCHES
        if settings.seconds:
            most = min(most, settings.seconds / max(seconds, 1e-9) / BATCHES)
        return int(2 ** math.floor(math.log2(max(1.0, min(max(wanted * math.sqrt(2), 4.0), most, 1024.0)))))

    return choose


def _converge(
    tracer: _Tracer, settings: TruthSettings, before: Truth | None, progress: Callable[[float], object] | None
) -> Truth:
    begin = time.monotonic()
    known = _Level.of(before) if before else None
    room = settings.samples - (before.samples if before else 0)
    # An earlier run's batches have numbers below its samples: no sequence is used twice.
    number = before.samples if before else 0
    count, check_at, share = 0, BATCHES, 0.0
    if room < _WORTH_A_PILOT:
        tracer.even(max(1, room // BATCHES))
    elif pilot := tracer.affordable_pilot(number, settings.seconds) if settings.seconds else _PILOT_SAMPLES:
        tracer.pilot(number, pilot, _affordable(settings, room))
    else:
        count = 2
    while count < 2 or (count + 1) * tracer.samples <= room:
        elapsed = time.monotonic() - begin
        if settings.seconds and elapsed > settings.seconds and count >= 2:
            break
        tracer.batch(number + count)
        count += 1
        if count == 2 and tracer.may_be_cut_off:
            tracer.level()  # to find out before the long rest
        if count >= check_at:
            level = tracer.level()
            level = known.pooled(level) if known else level
            if not all(math.isfinite(x) for x in (*level.light, *level.square)):
                raise _out_of_range()
            if level.error <= settings.target:
                break
            check_at = count + max(1, count // 8)
            share = max(share, (settings.target / level.error) ** 2)
        if progress:
            first, all_samples = 0.5 * min(count / BATCHES, 1.0), count * tracer.samples / room
            timed = elapsed / settings.seconds if settings.seconds else 0.0
            share = min(1.0, max(share, first, all_samples, timed))
            progress(share)
    found = dataclasses.replace(tracer.result(), seconds=time.monotonic() - begin)
    if not all(np.isfinite(x).all() for x in (found.radiance, found.radiance_error, found.inscattered_error)):
        raise _out_of_range()
    if progress:
        progress(1.0)
    return _described(_pooled(before, found) if before else found, settings)


def _pooled(a: Truth, b: Truth) -> Truth:
    """Two independent truths of one thing as one, weighed by their samples."""
    samples = a.samples + b.samples
    p, q = np.float32(a.samples / samples), np.float32(b.samples / samples)
    assert a.surfaces is not None
    assert b.surfaces is not None
    return dataclasses.replace(
        b,
        radiance=p * a.radiance + q * b.radiance,
        inscattered=p * a.inscattered + q * b.inscattered,
        surfaces=p * a.surfaces + q * b.surfaces,
        radiance_error=np.hypot(p * a.radiance_error, q * b.radiance_error),
        inscattered_error=np.hypot(p * a.inscattered_error, q * b.inscattered_error),
        samples=samples,
        seconds=a.seconds + b.seconds,
        # A bound: the degrees of freedom of a sum are at least those of either.
        batches=None if a.batches is None or b.batches is None else min(a.batches, b.batches),
    )


# --- device -------------------------------------------------------------------------------------------------------


class _CutOffError(GpuError):
    """The adapter ended an invocation's loops before they were done."""

    def __init__(self) -> None:
        super().__init__(
            "truth: rays march for longer through these implicit surfaces than a software adapter lets them"
        )


class _Tracer(Closing):
    """A scene's rays, and the sums of their light, on a device.

    Args:
        most_samples: of a pixel in one dispatch; None: by what rays are likely to take.
    """

    def __init__(
        self,
        gpu: Gpu,
        scene: Scene,
        size: tuple[int, int],
        settings: TruthSettings,
        *,
        most_samples: int | None = None,
    ) -> None:
        self._gpu, self.size, self._settings = gpu, size, settings
        self._buffers: list[Buffer] = []
        self._world: World | None = None
        pixels = size[0] * size[1]
        try:
            # Small first: a picture that does not fit is refused before a tree is built.
            self._sums = self._buffer("sums", 32 * pixels, "vec4f")
            self._moments = self._buffer("moments", 64 * pixels, "vec4f")
            guided = len(scene.lights) if len(scene.lights) <= _MOST_LIGHTS else 0
            self._guides = self._buffer("guides", 4 * pixels * max(1, guided), "u32")
            self._plan = self._buffer("plan", 4 * pixels, "u32")
            self._depths = self._buffer("depths", 4 * pixels, "f32")
            self._totals = self._buffer("totals", 16 * _GROUPS, "vec4f")
            self._unit = unit_of(scene)
            lit = _in_unit(scene, self._unit)
            camera = pack_camera(scene.camera, lit, size, gpu.dtype("package::wesl::camera::Camera"))
            camera["seed"] = settings.seed
            self._world = World(gpu, scene)
            self._scope = {
                **self._world.bindings,
                "camera": self._struct("camera", np.array([camera]), "package::wesl::camera::Camera").uniform(),
                "medium": self._struct(
                    "medium",
                    np.array([pack_medium(scene.medium, gpu.dtype("package::wesl::medium::Medium"))]),
                    "package::wesl::medium::Medium",
                ).uniform(),
                "lights": self._lights(lit).read().declaring(**light_kinds(scene)),
                "sums": self._sums.split(write=True),
                "moments": self._moments.split(write=True),
                "guides": self._guides.split(write=True),
                "plan": self._plan.split(write=True),
                "depths": self._depths.split(write=True),
                "totals": self._totals.read_write(),
            }
            dtype = gpu.dtype(f"{_MODULE}::Job")
            self._job = np.zeros(1, dtype)
            self._job["depth"] = settings.depth
            self._job["over_pixel"] = settings.filter == "box"
            self._job["emission"] = 1 / self._unit
            self._job["soft"] = any(light.extent > 0 for light in scene.lights)
            self._job_buffer = self._struct("job", self._job, f"{_MODULE}::Job")
            self._scope["job"] = self._job_buffer.uniform()
        except BaseException:
            self.close()
            raise
        self._entry = "trace_direct" if settings.depth == 2 else "trace_paths"
        # Pixels times samples of a dispatch: few at first, then as many as keep the device busy for a while.
        self._software = gpu.adapter_info["adapter_type"] == "CPU"
        self._budget = 1 << 14 if self._software else 1 << 18
        rays = 1 + 2 * min(len(scene.lights), _MOST_LIGHTS) + 6 * (settings.depth - 2)
        steps = _RAY_STEPS + (_marched(self._world.fields) if self._world.fields else 0)
        likely = max(1, _LOOP_LIMIT // (rays * steps)) if self._software else 1 << 16
        self._most_samples = most_samples or likely
        self._pending, self._since = 0, time.monotonic()
        self._batches, self._samples, self._most, self._squares = 0, 1.0, 1, 0.0

    def _buffer(self, label: str, data: NDArray[Any] | int, element: str, usage: str = "storage") -> Buffer:
        buffer = self._gpu.buffer(f"truth.{label}", data, owner=OWNER, element=element, usage=usage)
        self._buffers.append(buffer)
        return buffer

    def _struct(self, label: str, rows: NDArray[Any], element: str) -> Buffer:
        return self._buffer(label, rows, element, "uniform")

    def _lights(self, scene: Scene) -> Buffer:
        element = "package::wesl::light::Light"
        return self._buffer("lights", pack_lights(scene, self._gpu.dtype(element)), element)

    def _dispatch(self, entry: str, width: int, height: int = 1, **job: int) -> None:
        for name, value in job.items():
            self._job[name] = value
        self._gpu.write(self._job_buffer, self._job)
        self._gpu.compute(f"truth.{entry}", _MODULE, entry).bind(self._scope).dispatch(width, height)
        self._gpu.submit()

    def _strips(self, entry: str, first: int, end: int, **job: int) -> None:
        """All rows and samples ``first`` to ``end`` of every pixel, in dispatches of about the budget."""
        width, height = self.size
        while first < end:
            rows = min(height, max(8, self._budget // width // 8 * 8))
            chunk = min(end - first, self._most_samples, max(1, self._budget // (width * height)))
            for row in range(0, height, rows):
                now = min(rows, height - row)
                self._dispatch(entry, width, now, first_row=row, rows=now, first_sample=first, samples=chunk, **job)
                self._account(width * now * chunk)
            first += chunk

    def _account(self, work: int) -> None:
        """Wait when a budget's worth of work is under way, and fit the budget to the time it took."""
        self._pending += work
        if self._pending < self._budget:
            return
        self._gpu.wait()
        now = time.monotonic()
        rate = self._pending / max(now - self._since, 1e-6)
        self._budget = int(np.clip(rate * _SUBMIT_S, self._budget / 4, self._budget * 4))
        self._budget = max(self._budget, 8 * self.size[0])
        self._pending, self._since = 0, now

    @property
    def may_be_cut_off(self) -> bool:
        """Whether the adapter may end loops early."""
        return self._software and self._world is not None and self._world.fields is not None

    def even(self, samples: int) -> None:
        """Give every pixel as many samples a batch."""
        self._samples, self._job["stage"], self._job["batch_samples"] = float(samples), _EVEN, samples
        self._batches = 0

    def affordable_pilot(self, number: int, seconds: float) -> int:
        """The samples of a pilot's batch that leave it two fifths of the time; 0 where even the smallest is too long.

        Two batches of one sample tell: the first one compiles. They count where no pilot comes to forget them.
        """
        self.even(1)
        self.batch(number)
        self._gpu.wait()
        begin = time.monotonic()
        self.batch(number + 1)
        self._gpu.wait()
        each = _PILOT_BATCHES * (time.monotonic() - begin)
        return next((samples for samples in (16, 8, 4, 2) if samples * each <= 0.6 * seconds), 0)

    def pilot(self, number: int, samples: int, choose: Callable[[_Level, float], int]) -> None:
        """Find out where the lights are met and which pixels scatter, and plan the batches by it.

        What the pilot saw is then forgotten: the plan may depend on it, and a mean that held it would be biased.

        Args:
            samples: of each of its batches; the more, the narrower the lights' places are known.
            choose: an ordinary pixel's samples of a batch, from the pilot's level and its seconds for each sample.
        """
        begin = time.monotonic()
        self.even(samples)
        self._job["stage"] = _PILOT
        self._job["slack"] = 2.05 / (_PILOT_BATCHES * samples)
        for k in range(_PILOT_BATCHES):
            # Parts of one sequence: what they leave between them is as even as it can be.
            self._batch(_PILOT_NUMBERS + number, k * samples, (k + 1) * samples)
        level = self.level()
        seconds = (time.monotonic() - begin) / level.samples
        self._job["square"] = max(self._squares, 1e-37)
        self._job["batch_samples"] = choose(level, seconds)
        self._dispatch("make_plan", *self.size)
        plan = self._gpu.read_buffer(self._plan)[: self.size[0] * self.size[1]]
        self._samples, self._most, self._batches = float(plan.mean()), int(plan.max()), 0
        self._job["stage"] = _PLANNED

    @property
    def samples(self) -> float:
        """Of a batch, the mean over the pixels."""
        return self._samples

    def batch(self, number: int) -> None:
        """One batch more, with the sequences of ``number``."""
        planned = int(self._job["stage"][0]) == _PLANNED
        self._batch(number, 0, self._most if planned else int(self._samples))

    def _batch(self, number: int, first: int, end: int) -> None:
        if not self._pending:
            self._since = time.monotonic()
        self._batches += 1
        self._strips(self._entry, first, end, batch=number)
        self._dispatch("merge_batch", *self.size, batches=self._batches)

    def level(self) -> _Level:
        """How far it has come; waits for the device."""
        self._dispatch("sum_errors", 256 * _GROUPS)
        sums = self._gpu.read_buffer(self._totals).view(np.float32).reshape(-1, 4).sum(axis=0, dtype=np.float64)
        light, air, square, air_square = (float(x) / (3 * self.size[0] * self.size[1]) for x in sums)
        if light < 0:
            raise _CutOffError
        self._squares = 3 * (square + air_square)  # of an ordinary pixel, all channels
        scale = self._batches * (self._batches - 1)
        unit = self._unit
        lights, squares = (unit * light, unit * air), (unit**2 / scale * square, unit**2 / scale * air_square)
        return _Level(round(self._batches * self._samples), lights, squares)

    def result(self) -> Truth:
        """The means and their standard errors, read back."""
        self._job["stage"] = _EVEN
        self._strips("trace_depth", 0, 1)
        width, height = self.size
        moments = self._gpu.read_buffer(self._moments).view(np.float32).reshape(height, width, 4, 4)[..., :3]
        moments = moments.astype(np.float64)
        depth = self._gpu.read_buffer(self._depths).view(np.float32)[: width * height].reshape(height, width)
        surfaces, air = moments[..., 0, :], moments[..., 1, :]
        if surfaces.min() < 0:
            raise _CutOffError
        scale = 1 / (self._batches * (self._batches - 1))
        errors = [np.sqrt(np.maximum(moments[..., i, :], 0) * scale) for i in (2, 3)]
        with np.errstate(over="ignore"):  # who asked for it is told
            light = [(x * self._unit).astype(np.float32) for x in (surfaces + air, air, surfaces, *errors)]
        return Truth(
            judge="traced",
            radiance=light[0],
            inscattered=light[1],
            surfaces=light[2],
            depth=np.where(depth < 0, np.float32(np.inf), depth),
            radiance_error=light[3],
            inscattered_error=light[4],
            samples=round(self._batches * self._samples),
            seconds=0.0,
            size=self.size,
            settings={},
            batches=self._batches,
        )

    def close(self) -> None:
        """Free all that was made on the device."""
        self._gpu.discard()
        for buffer in self._buffers:
            buffer.destroy()
        self._buffers.clear()
        if self._world is not None:
            self._world.close()
            self._world = None
        self._gpu.forget_groups()


def _marched(fields: Field) -> int:
    """Iterations that a ray through implicit surfaces is likely to stay below."""
    return _MARCH_STEPS * (1 + min(fields.size, _LISTED))


# --- cache --------------------------------------------------------------------------------------------------------

_ARRAYS = ("radiance", "inscattered", "surfaces", "depth", "radiance_error", "inscattered_error")


def _entry(scene: Scene, size: tuple[int, int], settings: TruthSettings, gpu: Gpu) -> Path:
    """The file of a truth: under the version of the code that takes part, by what it is a truth of."""
    package = Path(tyndall.__file__).parent
    sources = [
        Path(__file__),
        package / "frame.py",
        Path(__file__).with_suffix(".wesl"),
        package / "content" / "mesh.py",
    ]
    sources += sorted(p for p in (package / "wesl").glob("*.wesl"))
    for layer in ("sdf", "tracing"):
        files = (package / layer).iterdir()
        sources += sorted(p for p in files if p.suffix in (".py", ".wesl") and "_test" not in p.name)
    # Compilers differ in rounding, and may have errors of their own: one truth is no other's.
    drawn = f"{gpu.adapter_info['adapter_type'] == 'CPU'} {metadata.version('wgpu')} {metadata.version('wesl-py')}"
    content = f"{scene_hash(scene)} {size[0]} {size[1]} {settings.depth} {settings.filter} {settings.seed} {drawn}"
    key = hashlib.sha256(content.encode()).hexdigest()[:32]
    return directory() / "truth" / version_of(sources) / f"{key}.npz"


def _load(entry: Path, size: tuple[int, int]) -> Truth | None:
    """The truth of an entry; None where there is none, or a damaged one."""
    try:
        with np.load(entry, allow_pickle=False) as file:
            arrays = {name: file[name] for name in _ARRAYS}
            about = json.loads(str(file["about"]))
        shapes = [(size[1], size[0]) if name == "depth" else (size[1], size[0], 3) for name in _ARRAYS]
        if [a.shape for a in arrays.values()] != shapes or any(a.dtype != np.float32 for a in arrays.values()):
            return None
        return Truth(
            "traced",
            **arrays,
            samples=int(about["samples"]),
            seconds=float(about["seconds"]),
            size=size,
            settings={},
            batches=int(about["batches"]),
        )
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, zlib.error):
        return None


def _save(entry: Path, truth: Truth) -> None:
    """Keep a truth, unless another process has left a better one meanwhile; and of other versions the newest."""
    entry.parent.mkdir(parents=True, exist_ok=True)
    there = _load(entry, truth.size)
    if there is not None and _Level.of(there).error <= _Level.of(truth).error:
        return
    about = json.dumps({"samples": truth.samples, "seconds": truth.seconds, "batches": truth.batches})
    with atomic_write(entry) as file:
        np.savez(file, about=np.array(about), **{name: getattr(truth, name) for name in _ARRAYS})
    others = [other for other in entry.parent.parent.iterdir() if other != entry.parent]
    for other in sorted(others, key=_age)[_VERSIONS - 1 :]:
        shutil.rmtree(other, ignore_errors=True)


def _age(folder: Path) -> float:
    """Smaller is younger; a folder that another process has removed meanwhile is the oldest."""
    try:
        return -folder.stat().st_mtime
    except OSError:
        return math.inf
