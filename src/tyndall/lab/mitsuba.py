"""Mitsuba 3 as an independent judge of pictures: a scene goes there as files, and a :class:`Truth` comes back.

Mitsuba (Jakob et al. 2022) is a renderer for research that shares no code with Tyndall; its ``volpath`` transports the
light. It runs in a process of its own, never in the caller's: an LLVM that does not suit it aborts the process that
loaded it. Of its variants the first one is taken that works here: ``cuda_ad_rgb`` on an NVIDIA GPU, ``llvm_ad_rgb``,
which compiles for the processor's vectors and needs an LLVM library (19 is known to work, 15 and 16 to abort;
``DRJIT_LIBLLVM_PATH`` names one), and ``scalar_rgb``, which always works, and slowly.

What is rendered: meshes with their instances baked into world space, one mesh per material; implicit surfaces as
triangles; all of the material model, textures, holes and culling; lights with their size; the medium in its box. The
picture is the one that Tyndall's still
frames and :mod:`tyndall.lab.truth` mean: see there for what ambient and emitted light do. What differs:

- textures are read at their finest level, without mip maps, as by the tracer;
- the medium's box is larger by 3e-4 of its distance from the origin for the light on its way *to* a point, as its faces
  must not coincide with a wall's;
- implicit surfaces are meshed at ``resolution`` (:mod:`tyndall.lab.meshed`), so they are off by a part of a cell;
- Mitsuba's rays begin off a surface by 1e-4 of its distance from the origin; thinner gaps between surfaces are lost.

The error of a pixel comes from the scatter of its samples, which are independent.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import logging
import math
import os
import queue
import re
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib import util
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.frame import view_matrix
from tyndall.gpu.params import ParameterError
from tyndall.lab.meshed import RESOLUTION, meshed
from tyndall.lab.mitsuba_run import write_ply
from tyndall.lab.truth import Truth, TruthSettings
from tyndall.scene.model import (
    DirectionalLight,
    HenyeyGreenstein,
    Light,
    Material,
    Medium,
    RectLight,
    Scene,
    Schlick,
    SpotLight,
)

log = logging.getLogger("tyndall")

GET = "pip install 'tyndall[truth]'"
VARIANTS = ("cuda_ad_rgb", "llvm_ad_rgb", "scalar_rgb")
_PROBE_S = 120.0  # a variant that takes longer to draw 16 pixels is taken for broken
_SILENCE_S = 1800.0  # a pass reports when it is done; without a word for so long, the process hangs
_OLDEST_LLVM = 15
_GET_LLVM = "apt-get install libllvm19, or name one by DRJIT_LIBLLVM_PATH"
_MAPS = {"base_color": True, "metallic_roughness": False, "normal": False, "emissive": True}  # and whether sRGB


class MitsubaError(RuntimeError):
    """Mitsuba is missing or failed. The message is one line that says what to install, or which variant failed how."""


@dataclass(frozen=True)
class Variant:
    """A variant of Mitsuba that works on this machine.

    Attributes:
        llvm: the LLVM library that it was tried with; None where it needs none.
        version: Mitsuba's.
    """

    name: str
    llvm: str | None
    version: str


@dataclass(frozen=True)
class Availability:
    """What :func:`available` found.

    Attributes:
        variant: the best that works; None where none does.
        failures: a line for each that was tried before, and why it does not work.
    """

    variant: Variant | None
    failures: tuple[str, ...]

    def __str__(self) -> str:
        if self.variant is None:
            return "; ".join(self.failures)
        with_llvm = f" with {self.variant.llvm}" if self.variant.llvm else ""
        why = f" ({'; '.join(self.failures)})" if self.failures else ""
        return f"Mitsuba {self.variant.version}, {self.variant.name}{with_llvm}{why}"


@cache
def available() -> Availability:
    """Try the variants of Mitsuba, each in a process of its own, until one works; the answer is kept for this process.

    Takes a second or two, and more where variants fail.
    """
    failures: list[str] = []
    for name in VARIANTS:
        try:
            return Availability(_try(name), tuple(failures))
        except MitsubaError as error:
            failures.append(str(error))
            if not _installed():
                break
    return Availability(None, tuple(failures))


@cache
def _try(name: str) -> Variant:
    """A variant, once it has drawn something.

    Raises:
        MitsubaError: it does not.
    """
    if not _installed():
        raise MitsubaError(f"Mitsuba is not installed: {GET}")
    libraries: tuple[str | None, ...] = llvm_libraries() if name.startswith("llvm") else (None,)
    if not libraries:
        raise MitsubaError(f"Mitsuba's {name} finds no LLVM library: {_GET_LLVM}")
    failures = []
    for library in libraries:
        try:
            with _Process(["probe", name], name, library) as process:
                said = list(process.news(_PROBE_S))
        except MitsubaError as error:
            failures.append(f"{error} ({library})" if library else str(error))
        else:
            return Variant(name, library, said[-1]["version"])
    raise MitsubaError(f"{failures[0]}: {_GET_LLVM}" if name.startswith("llvm") else failures[0])


def _installed() -> bool:
    return util.find_spec("mitsuba") is not None


def llvm_libraries() -> tuple[str, ...]:
    """LLVM libraries of this machine, the newest first; only the named one where DRJIT_LIBLLVM_PATH names one."""
    named = os.environ.get("DRJIT_LIBLLVM_PATH")
    if named:
        return (named,)
    patterns = (
        "/usr/lib/*/libLLVM*.so*",
        "/usr/lib64/libLLVM*.so*",
        "/usr/lib/llvm*/lib/libLLVM*.so*",
        "/usr/local/lib/libLLVM*.so*",
        "/opt/homebrew/opt/llvm*/lib/libLLVM.dylib",
        "/usr/local/opt/llvm*/lib/libLLVM.dylib",
    )
    found: dict[Path, int] = {}
    for pattern in patterns:
        for path in Path("/").glob(pattern.lstrip("/")):
            version = re.search(r"libLLVM[-.](?:so\.|dylib\.)?(\d+)", path.name) or re.search(
                r"llvm[-@](\d+)", str(path)
            )
            found.setdefault(path.resolve(), int(version[1]) if version else _OLDEST_LLVM)
    newest = sorted((path for path in found if found[path] >= _OLDEST_LLVM), key=lambda path: -found[path])
    return tuple(str(path) for path in newest)


def judge(
    scene: Scene,
    size: tuple[int, int],
    settings: TruthSettings | None = None,
    *,
    variant: str | None = None,
    resolution: int = RESOLUTION,
    progress: Callable[[float], object] | None = None,
) -> Truth:
    """Render a scene with Mitsuba until the settings are met.

    Args:
        size: width and height in pixels.
        settings: as for :func:`tyndall.lab.truth.trace`.
        variant: one of :data:`VARIANTS`; None takes the best that works, and another where that one fails on the way;
            it logs a warning for each that does not work.
        resolution: of the meshes of implicit surfaces, in cells along each one's longest side.
        progress: hears a fraction of 1, an estimate.

    Returns:
        Its ``seconds`` are those of rendering; start, loading and compiling are ``settings["setup"]``. Its
        ``settings["culled"]`` is the share of camera rays that first met the back of a single-sided surface, and
        ``settings["resolution"]`` that of implicit surfaces, where the scene has any.

    Raises:
        MitsubaError: it is missing, or failed.
        ParameterError: no scene, a size that is not in whole pixels, an unknown variant, or an implicit surface that
            cannot be meshed.
    """
    settings = settings or TruthSettings()
    if not isinstance(scene, Scene):
        raise ParameterError(f"scene: {scene!r} is no Scene; tyndall.load reads one, tyndall.scenes has some")
    if len(size) != 2 or not all(isinstance(side, (int, np.integer)) and side > 0 for side in size):
        raise ParameterError(f"size: {size!r} is not a width and a height in whole pixels")
    if variant is not None and variant not in VARIANTS:
        raise ParameterError(f"variant: '{variant}' is not one of {', '.join(VARIANTS)}")
    if scene.implicits:
        meshes = meshed(scene, resolution)
        found = judge(meshes, size, settings, variant=variant, progress=progress)
        return dataclasses.replace(found, settings={**found.settings, "resolution": resolution})
    if variant is not None:
        return _render(scene, size, settings, _try(variant), progress)
    first = available()
    if first.variant is None:
        raise MitsubaError(first.failures[-1])
    _warn(first)
    failures = []
    for name in VARIANTS[VARIANTS.index(first.variant.name) :]:
        try:
            return _render(scene, size, settings, _try(name), progress)
        except MitsubaError as error:
            failures.append(str(error))
            log.warning(str(error))
    raise MitsubaError(failures[0])


@cache
def _warn(found: Availability) -> None:
    """Once: what does not work may be a hundred times as fast as what does."""
    for line in found.failures:
        log.warning(line)


def _render(
    scene: Scene,
    size: tuple[int, int],
    settings: TruthSettings,
    variant: Variant,
    progress: Callable[[float], object] | None,
) -> Truth:
    with tempfile.TemporaryDirectory(prefix="tyndall-mitsuba-") as name:
        folder = Path(name)
        content = {**export(scene, size, folder), **dataclasses.asdict(settings), "variant": variant.name}
        (folder / "scene.json").write_text(json.dumps(content))
        with _Process(["render", name], variant.name, variant.llvm) as process:
            for news in process.news(_SILENCE_S):
                if progress and "errors" in news:
                    progress(_done(news, settings))
        with np.load(folder / "result.npz") as result:
            found = dict(result)
    made = {
        **dataclasses.asdict(settings),
        "variant": variant.name,
        "version": variant.version,
        "setup": round(float(found["setup"]), 3),
        "culled": float(found["culled"]),
    }
    return Truth(
        judge=f"mitsuba ({variant.name})",
        radiance=found["radiance"],
        inscattered=found["inscattered"],
        surfaces=found["surfaces"],
        depth=found["depth"],
        radiance_error=found["radiance_error"],
        inscattered_error=found["inscattered_error"],
        samples=int(found["samples"]),
        seconds=float(found["seconds"]),
        size=(int(size[0]), int(size[1])),
        settings=made,
    )


def _done(news: dict[str, Any], settings: TruthSettings) -> float:
    """How much of the work is done: an error falls with the root of the samples."""
    error = max(news["errors"].values())
    shares = [news["samples"] / settings.samples]
    if settings.seconds:
        shares.append(news["seconds"] / settings.seconds)
    if 0 < error < math.inf:
        shares.append((settings.target / error) ** 2)
    return float(min(1.0, max(shares)))


# --- the process --------------------------------------------------------------------------------------------------


class _Process:
    """Mitsuba's process. It ends with the ``with`` block, or with this process: its standard input closes.

    Raises:
        MitsubaError: on leaving the block, when the process has failed.
    """

    def __init__(self, arguments: list[str], variant: str, llvm: str | None) -> None:
        self._variant = variant
        environment = dict(os.environ)
        root = str(Path(__file__).parents[2])
        environment["PYTHONPATH"] = os.pathsep.join([root, *filter(None, [environment.get("PYTHONPATH")])])
        if llvm:
            environment["DRJIT_LIBLLVM_PATH"] = llvm
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - closed in __exit__
        self._native = subprocess.Popen(
            [sys.executable, "-m", "tyndall.lab.mitsuba_run", *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env=environment,
            text=True,
        )

    def __enter__(self) -> _Process:
        return self

    def __exit__(self, *_: object) -> None:
        self._native.kill()
        self._native.wait()
        for stream in (self._native.stdin, self._native.stdout, self._errors):
            with contextlib.suppress(OSError):
                if stream is not None:
                    stream.close()

    def news(self, patience: float) -> Iterator[dict[str, Any]]:
        """What it reports, line by line, until it ends.

        Raises:
            MitsubaError: it fails, or is silent for longer than ``patience`` seconds.
        """
        lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()

        def read() -> None:
            with contextlib.suppress(ValueError):  # closed meanwhile
                for line in self._native.stdout or ():
                    lines.put(line)
            lines.put(None)

        threading.Thread(target=read, daemon=True).start()
        while True:
            try:
                line = lines.get(timeout=patience)
            except queue.Empty:
                raise MitsubaError(f"Mitsuba's {self._variant} said nothing for {patience:g} s and was ended") from None
            if line is None:
                break
            if line.startswith("{"):  # libraries may print, too
                yield json.loads(line)
        status = self._native.wait()
        if status:
            raise MitsubaError(f"Mitsuba's {self._variant} failed: {self._reason(status)}")

    def _reason(self, status: int) -> str:
        self._errors.seek(0)
        said = [line.strip() for line in self._errors.read().decode(errors="replace").splitlines() if line.strip()]
        told = [line for line in said if "error" in line.lower()] or said
        ended = f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
        return f"{told[0][:160]} ({ended})" if told else ended


# --- the scene as files -------------------------------------------------------------------------------------------


def export(scene: Scene, size: tuple[int, int], folder: Path) -> dict[str, Any]:
    """Write a scene's meshes (PLY) and texels (NPZ) into a folder; returns the rest of it, for JSON.

    Instances are baked into world space, and those of one material are one mesh. A transform that turns the winding
    round has its triangles turned back, so that the geometric normal points out of the front.
    """
    by_material: dict[int, tuple[Material, list[int]]] = {}
    for index, instance in enumerate(scene.instances):
        material = instance.mesh.material
        by_material.setdefault(id(material), (material, []))[1].append(index)
    images: dict[int, str] = {}
    texels: dict[str, NDArray[np.uint8]] = {}
    materials: list[dict[str, Any]] = []
    meshes: list[dict[str, Any]] = []
    for number, (material, members) in enumerate(by_material.values()):
        maps = {}
        for name, srgb in _MAPS.items():
            texture = getattr(material, f"{name}_texture")
            if texture is None:
                continue
            key = images.setdefault(id(texture.image), f"image{len(images)}")
            texels[key] = texture.image.pixels
            c, s = math.cos(texture.rotation), math.sin(texture.rotation)
            sx, sy = texture.scale
            maps[name] = {
                "image": key,
                "srgb": srgb,
                "wrap": [texture.wrap_u, texture.wrap_v],
                "filter": texture.filter,
                # Columns of translate · rotate · scale, KHR_texture_transform.
                "matrix": [[c * sx, -s * sx], [s * sy, c * sy], list(texture.offset)],
            }
        materials.append(
            {
                "base_color": material.base_color,
                "metallic": material.metallic,
                "roughness": material.roughness,
                "emissive": material.emissive,
                "alpha_cutoff": material.alpha_cutoff if material.alpha_mode == "mask" else 0.0,
                "double_sided": material.double_sided,
                "maps": maps,
            }
        )
        file = f"mesh{number}.ply"
        positions, normals, uvs, triangles = _baked(scene, members)
        write_ply(folder / file, positions, normals, uvs, triangles)
        meshes.append({"file": file, "material": number})
        if np.ptp(np.linalg.norm(normals, axis=1)) > 1e-4:
            # Mitsuba makes a file's normals unit vectors. A stretched instance's are not, and weigh as they are long.
            meshes[-1]["normals"] = f"mesh{number}.npy"
            np.save(folder / f"mesh{number}.npy", normals)
    if texels:
        np.savez(folder / "images.npz", **texels)  # type: ignore[arg-type, unused-ignore]

    camera = scene.camera
    view = view_matrix(camera)
    tangent = math.tan(camera.fov / 2)
    low, high = scene.bounds
    return {
        "meshes": meshes,
        "materials": materials,
        "lights": [_light(light) for light in scene.lights],
        "medium": _medium(scene.medium),
        "bounds": [low.tolist(), high.tolist()],
        "camera": {
            "position": camera.position,
            "right": (view[0, :3] * tangent * size[0] / size[1]).tolist(),
            "up": (view[1, :3] * tangent).tolist(),
            "forward": (-view[2, :3]).tolist(),
            "near": camera.near,
        },
        "background": scene.background,
        "ambient": scene.ambient,
        "size": [int(side) for side in size],
    }


def _baked(
    scene: Scene, members: list[int]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], NDArray[np.int64]]:
    """Positions, normals, texture coordinates and triangles of some instances, in world space.

    Normals of an instance keep their proportions: they are interpolated before they are made unit vectors.
    """
    parts: list[list[NDArray[Any]]] = [[], [], [], []]
    first = 0
    for index in members:
        instance = scene.instances[index]
        mesh = instance.mesh
        matrix = np.asarray(instance.transform, np.float64)
        linear = matrix[:3, :3]
        x, y, z = linear.T
        # The cofactors are the inverse transpose times the determinant, and exist where that is 0.
        mirrored = np.linalg.det(linear) < 0
        cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=1) * (-1 if mirrored else 1)
        normals = np.asarray(mesh.normals, np.float64) @ cofactors.T
        length = np.linalg.norm(normals, axis=1).max()
        parts[0].append((mesh.positions.astype(np.float64) @ linear.T + matrix[:3, 3]).astype(np.float32))
        parts[1].append((normals / (length or 1.0)).astype(np.float32))
        parts[2].append(np.zeros((len(mesh.positions), 2), np.float32) if mesh.uvs is None else mesh.uvs)
        triangles = mesh.indices.astype(np.int64) + first
        parts[3].append(triangles[:, [0, 2, 1]] if mirrored else triangles)
        first += len(mesh.positions)
    positions, normals, uvs, triangles = (np.concatenate(part) for part in parts)
    return positions, normals, uvs, triangles


def _light(light: Light) -> dict[str, Any]:
    found: dict[str, Any] = {
        "kind": light.kind,
        "intensity": [light.intensity * c for c in light.color],
        "radius": light.extent,
    }
    if not isinstance(light, DirectionalLight):
        found["position"] = light.position
    if isinstance(light, (DirectionalLight, SpotLight, RectLight)):
        direction = np.asarray(light.direction, np.float64)
        found["direction"] = (direction / np.linalg.norm(direction)).tolist()
    if isinstance(light, SpotLight):
        found["cone_scale"], found["cone_offset"] = light.cone
    if isinstance(light, RectLight):
        found["across"], found["along"] = (axis.tolist() for axis in light.axes)
    return found


def _medium(medium: Medium) -> dict[str, Any] | None:
    """None where there is nothing in the air."""
    if not any(medium.extinction):
        return None
    phase = medium.phase
    parameter = phase.g if isinstance(phase, HenyeyGreenstein) else phase.k if isinstance(phase, Schlick) else 0.0
    return {
        "scattering": medium.scattering,
        "extinction": medium.extinction,
        "bounds": medium.bounds,
        "phase": {"kind": phase.kind, "parameter": parameter},
    }
