"""Mitsuba's pictures of Tyndall's scenes are the closed forms' and our truth's; what goes wrong with it is one line.

Small pictures come from ``scalar_rgb``, which works everywhere and compiles nothing.
"""

from __future__ import annotations

import json
import logging
import math
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from importlib import util
from pathlib import Path
from typing import Any

import numpy as np
import props
import pytest

from tyndall import sdf
from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError
from tyndall.lab import mitsuba
from tyndall.lab.mitsuba import MitsubaError, available, judge
from tyndall.lab.truth import Truth, TruthSettings, trace
from tyndall.lab.ztest import z_test
from tyndall.scene.model import (
    Camera,
    DirectionalLight,
    Gibbons,
    HenyeyGreenstein,
    Image,
    Implicit,
    Instance,
    Isotropic,
    Material,
    Medium,
    Mesh,
    Phase,
    PointLight,
    Rayleigh,
    RectLight,
    Scene,
    Schlick,
    SpotLight,
    Texture,
)

pytestmark = pytest.mark.skipif(util.find_spec("mitsuba") is None, reason="Mitsuba is not installed")

ONCE = TruthSettings(target=0.0, seconds=1e-6)  # a single sample of each pixel, where there is no noise
ROUGH = Material("rough", base_color=(0.7, 0.5, 0.3, 1), roughness=0.6)
SUN = DirectionalLight((0.3, -0.4, -1.0), 2.0, (1.0, 0.8, 0.5))
BULB = PointLight((0.4, 0.3, -2.0), 3.0, (0.5, 1.0, 0.8))
BEAM = SpotLight((0.6, 1.8, -2.5), (-0.3, -1.0, -0.2), 5.0, inner_angle=0.5, outer_angle=1.2)
ROOM = ((-9.0, -9.0, -4.0), (9.0, 9.0, 9.0))


def draw(scene: Scene, size: tuple[int, int] = props.TINY, settings: TruthSettings = ONCE) -> Truth:
    return judge(scene, size, settings, variant="scalar_rgb")


def few(samples: int, **more: Any) -> TruthSettings:
    return TruthSettings(target=0.0, samples=samples, **more)


# --- closed forms -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("light", [SUN, BULB, BEAM], ids=lambda light: light.kind)
def test_a_wall_reflects_what_its_brdf_says(light: Any) -> None:
    # One light: of several, a sample asks one.
    gold = Material(base_color=(0.9, 0.6, 0.2, 1), metallic=0.8, roughness=0.3, emissive=(0.1, 0.0, 0.2))
    for material in (ROUGH, gold):
        scene = Scene((props.wall(-4, material=material),), (light,), props.AHEAD, ambient=(0.1, 0.2, 0.3))
        seen = props.rays(scene.camera, props.TINY)
        found = draw(scene)
        assert found.depth == pytest.approx(np.full((12, 16), 4.0), rel=1e-5)
        expected = props.surface_light(scene, props.TINY, (0, 0, 1), 4 * seen.stretch)
        assert found.radiance == pytest.approx(expected, rel=1e-3, abs=1e-5)


@pytest.mark.parametrize("phase", [Isotropic(), HenyeyGreenstein(0.6), Rayleigh(), Gibbons(), Schlick(-0.5)])
def test_sunlit_air_is_the_closed_form(phase: Phase) -> None:
    # The camera is in the air's box, whose face is at z = −4; the sun is as bright as told everywhere in it.
    medium = Medium((0.3, 0.2, 0.1), (0.1, 0.2, 0.3), phase, ROOM)
    scene = Scene((props.wall(-6),), (SUN,), props.AHEAD, medium)
    found = draw(scene, (4, 3), few(300))
    _, leave = props.hit_box(scene.camera.position, props.rays(scene.camera, (4, 3)).directions, *ROOM)
    expected = props.lit_slab(scene, (4, 3), 0, leave)
    result = z_test(found.inscattered, expected, found.inscattered_error)
    assert result, str(result)
    assert found.relative_error("inscattered") < 0.08


def test_colours_of_a_medium_and_its_box_are_kept() -> None:
    # The camera is outside the box; what is between it and the wall is known exactly.
    medium = Medium((0.0, 0.0, 0.0), (0.1, 0.5, 0.0), bounds=((-9, -9, -5), (9, 9, -2)))
    material = Material(base_color=(0, 0, 0, 1), emissive=(1.0, 2.0, 3.0))
    scene = Scene((props.wall(-6, 3, material),), (), props.AHEAD, medium, background=(0.5, 0.5, 0.5))
    found = draw(scene, (16, 12))
    stretch = props.rays(scene.camera, (16, 12)).stretch[..., None]
    light = np.where(np.isfinite(found.depth)[..., None], material.emissive, scene.background)
    assert found.radiance == pytest.approx(light * np.exp(-np.array(medium.extinction) * 3 * stretch), rel=1e-5)
    assert not found.inscattered.any()
    assert 0.2 < np.isfinite(found.depth).mean() < 1


def test_a_beam_in_coloured_air_is_the_quadrature() -> None:
    medium = Medium((0.3, 0.2, 0.1), (0.02, 0.05, 0.3), HenyeyGreenstein(0.4))  # everywhere
    scene = Scene((props.wall(-4),), (BEAM,), props.AHEAD, medium)
    found = draw(scene, (4, 3), few(600))
    seen = props.rays(scene.camera, (4, 3))
    expected = props.quadrature(scene, BEAM, (4, 3), 0, 4 * seen.stretch)
    result = z_test(found.inscattered, expected, found.inscattered_error)
    assert result, str(result)


def test_rays_over_the_pixel_see_what_covers_it() -> None:
    # The left edge of the wall is at 0.3 of the second of four pixels.
    half = math.tan(props.AHEAD.fov / 2) * 4
    edge = half * 4 / 3 * (-1 + 2 * 1.3 / 4)
    white = Material(base_color=(0, 0, 0, 1), emissive=(1, 1, 1))
    right = props.quad((edge, -9, -4), (9, -9, -4), (9, 9, -4), (edge, 9, -4), white)
    scene = Scene((right,), (), props.AHEAD)
    found = draw(scene, (4, 3), few(400, filter="box"))
    expected = np.zeros((3, 4, 3))
    expected[:, 1], expected[:, 2:] = 0.7, 1.0
    result = z_test(found.radiance, expected, found.radiance_error)
    assert result, str(result)
    assert found.radiance_error[:, 1] == pytest.approx(math.sqrt(0.7 * 0.3 / 400), rel=0.2)
    assert not found.radiance_error[:, (0, 2, 3)].any()


# --- geometry and materials ---------------------------------------------------------------------------------------


def leaf() -> Image:
    """A disc of a leaf on nothing."""
    y, x = np.mgrid[:32, :32] - 15.5
    pixels = np.full((32, 32, 4), 200, np.uint8)
    pixels[..., 3] = np.where(x * x + y * y < 150, 255, 0)
    return Image(pixels)


def collection() -> Scene:
    """Instances that are scaled, mirrored, masked, or seen from behind."""
    hollow = Material(base_color_texture=Texture(leaf()), alpha_mode="mask", double_sided=True)
    wedge = Mesh(
        np.array([(-0.5, 0, 0), (0.7, 0, 0), (-0.5, 0.9, 0.4), (0, 0, -1)], np.float32),
        np.array([(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)], np.uint32),
        material=ROUGH,
    )
    back = props.quad((1, -2, -3), (-1, -2, -3), (-1, -0.5, -3), (1, -0.5, -3), ROUGH)  # clockwise to the camera

    def placed(x: float, y: float, z: float, sx: float, sy: float, sz: float) -> tuple[tuple[float, ...], ...]:
        return ((sx, 0, 0, x), (0, sy, 0, y), (0, 0, sz, z), (0, 0, 0, 1))

    return Scene(
        (
            props.wall(-7, 4, ROUGH),
            Instance(wedge, placed(-1.2, 0.2, -5, 1, 1, 1)),
            Instance(wedge, placed(1.2, 0.2, -5, -1.2, 0.8, 1.5)),
            props.quad((-2, -1.5, -4), (-0.5, -1.5, -4), (-0.5, 0, -4), (-2, 0, -4), hollow),
            props.quad((2, -1.5, -4), (0.5, -1.5, -4), (0.5, 0, -4), (2, 0, -4), hollow),
            back,
        ),
        (SUN,),
        props.AHEAD,
        Medium((0.1, 0.1, 0.1), bounds=((-9, -9, -8), (9, 9, -3.5))),
    )


def test_surfaces_are_where_the_frame_draws_them(gpu: Gpu) -> None:
    scene = collection()
    found = draw(scene, (32, 24))
    drawn = props.shoot(gpu, scene, (32, 24)).depth
    assert found.depth is not None
    seen, expected = np.isfinite(found.depth), np.isfinite(drawn)
    assert (seen != expected).mean() < 0.005
    assert 0.7 < seen.mean() < 0.95
    both = seen & expected
    # At edges of the mask, filtering by mip maps and without differ.
    assert (np.abs(found.depth[both] - drawn[both]) > 1e-3).mean() < 0.01
    assert (found.depth[both] < 4.5).mean() > 0.05
    assert found.settings["culled"] > 0.05


def test_stretched_instances_shine_as_ours_do(gpu: Gpu) -> None:
    # Smooth normals of instances that are stretched and mirrored, in a narrow highlight; light from within the mesh's
    # back would show a wrong winding.
    positions = np.array([(x, y, 0.3 * (1 - x * x) * (1 - y * y)) for y in (-1, 0, 1) for x in (-1, 0, 1)], np.float32)
    corners = [(0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4), (3, 4, 7), (3, 7, 6), (4, 5, 8), (4, 8, 7)]
    mesh = Mesh(positions, np.array(corners, np.uint32), material=Material(metallic=1.0, roughness=0.3))
    instances = tuple(
        Instance(mesh, ((sx, 0, 0, x), (0, 0.5, 0, 0), (0, 0, 2.5, -4), (0, 0, 0, 1)))
        for x, sx in ((-1.1, 0.9), (1.1, -0.9))
    )
    scene = Scene(instances, (DirectionalLight((0.1, -0.2, -1), 3.0),), props.AHEAD)
    found = draw(scene, (32, 24))
    ours = trace(scene, (32, 24), TruthSettings(target=0.1), gpu=gpu, cache=False)
    assert (found.radiance > 0).mean() > 0.15
    off = np.abs(found.radiance - ours.radiance) > 2e-3 * ours.radiance.max()
    assert off.mean() < 0.005  # at the mesh's seen edges


def waves(height: int, width: int, low: int = 0, high: int = 255, blue: int | None = None) -> Image:
    """Smooth texels that repeat."""
    y, x = np.mgrid[:height, :width] / height
    channels = [np.sin(2 * np.pi * (x * (1 + c) + y * (2 - c)) + c) for c in range(4)]
    pixels = np.stack([low + (high - low) * (0.5 + 0.5 * c) for c in channels], axis=-1).astype(np.uint8)
    if blue is not None:
        pixels[..., 2] = blue
    return Image(pixels)


def test_textures_are_read_as_ours_are(gpu: Gpu) -> None:
    # Each with its own addressing and transform; the mask's holes let light and eye through.
    patterned = Material(
        base_color_texture=Texture(waves(16, 16), "mirror", "repeat", offset=(0.1, 0.2), rotation=0.4, scale=(3, 1.4)),
        metallic=0.8,
        metallic_roughness_texture=Texture(waves(8, 8, 60), "clamp", "mirror", scale=(2.5, 2.5), offset=(-0.7, -0.7)),
        normal_texture=Texture(waves(16, 16, 100, 156, 255), scale=(2, 1), rotation=0.3),
        emissive=(0.03, 0.02, 0.01),
        emissive_texture=Texture(waves(8, 8), filter="nearest"),
    )
    holed = Material(
        base_color=(0.2, 0.8, 0.3, 0.9),
        base_color_texture=Texture(waves(16, 16)),
        alpha_mode="mask",
        alpha_cutoff=0.45,
        double_sided=True,
    )
    screen = props.quad((0.2, -0.6, -2.5), (1.6, -0.6, -2.9), (1.6, 0.9, -2.9), (0.2, 0.9, -2.5), holed)
    light = DirectionalLight((-0.4, -0.1, -1), 3.0)
    scene = Scene((props.wall(-4, 2.5, patterned), screen), (light,), props.AHEAD, ambient=(0.1, 0.1, 0.1))
    found = draw(scene, (32, 24))
    ours = trace(scene, (32, 24), TruthSettings(target=0.1), gpu=gpu, cache=False)
    off = np.abs(found.radiance - ours.radiance) > 2e-3 * ours.radiance.max()
    assert off.mean() < 0.01  # at edges of holes, and of texels that are not filtered
    assert 0.02 < (found.depth < 3).mean() < 0.2
    assert found.radiance.std() > 0.1 * found.radiance.mean()


def test_the_bsdf_is_the_shaders_and_draws_what_it_says(tmp_path: Path) -> None:
    materials = [
        Material(base_color=(0.8, 0.5, 0.2, 1), metallic=m, roughness=r) for m, r in ((0, 0.8), (1, 0.4), (0.5, 0.15))
    ]
    wi = props_directions(0)
    scene = Scene(tuple(props.wall(-4, material=m) for m in materials), (SUN,), props.AHEAD)
    content = mitsuba.export(scene, (1, 1), tmp_path)
    (tmp_path / "scene.json").write_text(json.dumps({**content, "depth": 3, "filter": "centre"}))
    wo = props_directions(1)
    np.savez(tmp_path / "directions.npz", wi=wi, wo=wo)
    script = tmp_path / "script.py"
    script.write_text(_BSDF_SCRIPT)
    subprocess.run([sys.executable, script, tmp_path], check=True, env=environment(), timeout=120)
    with np.load(tmp_path / "found.npz") as file:
        found = dict(file)
    for index, material in enumerate(materials):
        expected = props.reflected(material, (0, 0, 1), wi, wo)
        assert found["value"][index] == pytest.approx(expected, rel=2e-4, abs=1e-6)
        # The mean of value/density is the albedo; so is the mean over even directions of the hemisphere.
        u = (np.arange(200_000)[:, None] + 0.5) * (0.618033988749895, 0.754877666246693) % 1
        z, angle = u[:, :1], 2 * np.pi * u[:, 1:]
        even = np.concatenate([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=1)
        viewer = np.array([0.6, 0.0, 0.8])
        albedo = 2 * np.pi * props.reflected(material, (0, 0, 1), viewer, even).mean(axis=0)
        weights = found["weights"][index]
        error = weights.std(axis=0) / math.sqrt(len(weights))
        result = z_test(*(x.reshape(1, 1, 3) for x in (weights.mean(axis=0), albedo, error)), tolerance=2e-3)
        assert result, str(result)
        # What is drawn falls into each eighth of azimuth and half of height as often as the density says.
        drawn = found["drawn"][index]
        expected_density = density(material, viewer, even)
        for half in (0, 1):
            for eighth in range(8):
                share = 2 * np.pi * (expected_density * inside(even, half, eighth)).mean()
                counted = inside(drawn, half, eighth).mean()
                assert counted == pytest.approx(share, abs=5 * math.sqrt(share / len(drawn)) + 2e-3)


def inside(directions: np.ndarray, half: int, eighth: int) -> np.ndarray:
    azimuth = np.arctan2(directions[:, 1], directions[:, 0]) % (2 * np.pi)
    upper = (directions[:, 2] > 0.7) == bool(half)
    return upper & (directions[:, 2] > 0) & (np.floor(azimuth / (np.pi / 4)) == eighth)


def density(material: Material, viewer: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """A mixture of GGX's normals and the cosine."""
    h = viewer + wo
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    a2 = max(material.roughness**2, 2e-3) ** 2
    ggx = a2 / (np.pi * (h[:, 2] ** 2 * (a2 - 1) + 1) ** 2)
    share = 0.5 + 0.4 * material.metallic
    facet = ggx * h[:, 2] / (4 * (wo * h).sum(axis=1))
    return np.asarray(share * facet + (1 - share) * wo[:, 2] / np.pi)


def props_directions(seed: int) -> np.ndarray:
    """Directions (100, 3) of the upper hemisphere."""
    v = np.random.default_rng(seed).normal(size=(100, 3))
    v[:, 2] = np.abs(v[:, 2]) + 0.05
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))


_BSDF_SCRIPT = """
import json, sys
from pathlib import Path
import numpy as np
from tyndall.lab.mitsuba_run import Tracer, load

folder = Path(sys.argv[1])
mi, dr = load("scalar_rgb")
content = json.loads((folder / "scene.json").read_text())
Tracer(mi, dr, content, folder)
given = np.load(folder / "directions.npz")
random = np.random.default_rng(2)
context = mi.BSDFContext()
value, weights, drawn = [], [], []

def seen(direction):
    si = mi.SurfaceInteraction3f()
    si.n, si.sh_frame, si.wi = mi.Normal3f(0, 0, 1), mi.Frame3f(mi.Vector3f(0, 0, 1)), mi.Vector3f(direction)
    si.wi = si.to_local(si.wi)
    return si

for index in range(len(content["materials"])):
    bsdf = mi.load_dict({"type": "tyndall_reflection", "index": index})
    row = []
    for wi, wo in zip(given["wi"].tolist(), given["wo"].tolist()):
        si = seen(wi)
        row.append(list(bsdf.eval(context, si, si.to_local(mi.Vector3f(wo)))))
    value.append(row)
    si = seen([0.6, 0.0, 0.8])
    pairs = [bsdf.sample(context, si, r[0], mi.Point2f(r[1:])) for r in random.random((2500, 3)).tolist()]
    weights.append([list(weight) for _, weight in pairs])
    drawn.append([list(si.to_world(sample.wo)) for sample, _ in pairs])
np.savez(folder / "found.npz", value=value, weights=weights, drawn=drawn)
"""


# --- our truth ----------------------------------------------------------------------------------------------------


def clear(scene: Scene) -> Scene:
    return scene.with_(medium=Medium())


def occluded(*lights: Any) -> Scene:
    """A box that throws its shadow through the air onto floor and wall, with its lights out of the view."""
    inside = (props.floor(-1.2, 4, ROUGH), props.wall(-5, 4, ROUGH), props.box((-0.6, -0.7, -3.4), (0.5, 0.3, -2.6)))
    return Scene(inside, lights, props.AHEAD, THICK, background=(0.1, 0.2, 0.3), ambient=(0.05, 0.05, 0.05))


def glowing() -> Scene:
    """An emissive box over a floor, under a sky, without any lamp."""
    box = props.box((-0.5, -0.9, -3.4), (0.4, -0.2, -2.6), Material(base_color=(0.5, 0.5, 0.5, 1), emissive=(3, 2, 1)))
    return Scene((props.floor(-1.2, 3, ROUGH), box), (), props.AHEAD, background=(0.2, 0.3, 0.4))


def rounded() -> Scene:
    """As :func:`occluded`, but an implicit surface throws the shadow: two materials melt, and there is a cut."""
    red = Material("red", base_color=(0.8, 0.2, 0.1, 1), roughness=0.5)
    shape = sdf.union(sdf.sphere(0.5).material(red), sdf.box((0.9, 0.4, 0.4)).at(0.4, -0.2, 0), smooth=0.15)
    thing = (shape - sdf.sphere(0.3).at(0.1, 0.3, 0.4)).at(-0.1, -0.3, -3.0)
    return occluded(HIGH, LAMP).with_(
        instances=(props.floor(-1.2, 4, ROUGH), props.wall(-5, 4, ROUGH)), implicits=(Implicit(thing, material=ROUGH),)
    )


THICK = Medium((0.15, 0.15, 0.15), (0.05, 0.05, 0.05), HenyeyGreenstein(0.3), ((-4, -1.2, -5), (4, 4, 2)))
HIGH = DirectionalLight((0.4, -1, -0.3), 2.0)
LAMP = PointLight((1.5, 2.0, -1.5), 12.0, (1, 0.8, 0.6))
SPOT = SpotLight((-0.8, 2.6, -2.0), (0.3, -1, -0.2), 25.0, inner_angle=0.4, outer_angle=0.9)
BALL = PointLight((1.5, 2.0, -1.5), 12.0, radius=0.5)
PANEL = RectLight((1.5, 2.0, -1.5), (-0.6, -1, -0.4), 12.0, (1, 0.8, 0.6), width=1.6, height=0.5, rotation=0.4)
SUNK = RectLight((2.2, -1.2, -3.4), (-1, 0.2, -0.3), 6.0, width=1.0, height=1.4, rotation=0.3)  # half under the floor
VIEW = (6, 4)  # few pixels of many samples: means are normal, as the test has them, when samples are many

SCENES: dict[str, tuple[Scene, int, int]] = {  # with samples and depth
    "surfaces only": (clear(occluded(HIGH, LAMP, SPOT)), 150, 2),
    "directional light": (occluded(HIGH), 500, 2),
    "point light": (occluded(LAMP), 500, 2),
    "spot light": (occluded(SPOT), 500, 2),
    "light with a radius": (occluded(BALL), 500, 2),
    "rectangular light": (occluded(PANEL), 500, 2),
    "rectangular light, cut by the floor": (clear(occluded(SUNK)), 1500, 2),
    "soft sun in coloured air": (
        occluded(DirectionalLight((0.4, -1, -0.3), 2.0, angular_diameter=0.2)).with_(
            medium=Medium((0.2, 0.1, 0.05), (0.02, 0.05, 0.1), Rayleigh(), THICK.bounds)
        ),
        500,
        2,
    ),
    "multiple scattering": (occluded(HIGH), 500, 4),
    "light of surfaces and sky": (glowing(), 400, 3),
    "implicit surfaces": (rounded(), 500, 2),
}


@pytest.fixture(scope="module")
def judged() -> Iterator[Any]:
    """Mitsuba's pictures of the scenes by name, made while the first of them are looked at."""
    pool = ThreadPoolExecutor(2)

    @cache
    def start(name: str) -> Future[Truth]:
        scene, samples, depth = SCENES[name]
        return pool.submit(draw, scene, VIEW, few(samples, depth=depth, seed=7))

    def get(name: str) -> Truth:
        names = list(SCENES)
        for following in names[names.index(name) : names.index(name) + 3]:
            start(following)
        return start(name).result()

    yield get
    pool.shutdown(cancel_futures=True)


@pytest.mark.parametrize("name", SCENES)
def test_our_truth_is_mitsubas(name: str, judged: Any, gpu: Gpu) -> None:
    scene, _, depth = SCENES[name]
    ours = trace(scene, VIEW, TruthSettings(target=4e-3, samples=2048, depth=depth), gpu=gpu, cache=False)
    theirs = judged(name)
    for kind in ("radiance", "inscattered"):
        result = z_test(
            getattr(theirs, kind),
            getattr(ours, kind),
            getattr(theirs, f"{kind}_error"),
            getattr(ours, f"{kind}_error"),
            b_freedom=ours.freedom,
            tolerance=5e-4,
        )
        assert result, f"{kind}: {result}"
    if any(scene.medium.scattering):
        assert ours.inscattered.mean() > 0.02
    assert theirs.relative_error() < 0.15
    assert theirs.depth == pytest.approx(ours.depth, rel=1e-4)
    assert theirs.judge == "mitsuba (scalar_rgb)"


def test_the_best_variant_agrees_with_the_scalar_one() -> None:
    best = available()
    if best.variant is None or best.variant.name == "scalar_rgb":
        pytest.skip(f"only scalar_rgb works: {'; '.join(best.failures)}")
    scene = occluded(HIGH)
    found = judge(scene, (32, 24), few(256))
    assert found.judge == f"mitsuba ({best.variant.name})"
    ours = trace(scene, (32, 24), TruthSettings(target=2e-3, samples=1024), cache=False)
    errors = (found.radiance_error, ours.radiance_error)
    result = z_test(found.radiance, ours.radiance, *errors, b_freedom=ours.freedom, tolerance=5e-4)
    assert result, str(result)


# --- when to stop, and what goes wrong ----------------------------------------------------------------------------


def test_it_stops_at_the_target() -> None:
    heard: list[float] = []
    scene = occluded(HIGH)
    found = judge(scene, (4, 3), TruthSettings(target=0.2), variant="scalar_rgb", progress=heard.append)
    assert max(found.relative_error("radiance"), found.relative_error("inscattered")) <= 0.2 * (1 + 1e-5)
    assert 32 <= found.samples < 4096
    assert heard[-1] == pytest.approx(1)
    assert found.surfaces is not None
    assert found.radiance == pytest.approx(found.surfaces + found.inscattered, rel=1e-5)
    assert found.settings["setup"] > 0 < found.seconds


def test_missing_mitsuba_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mitsuba, "_installed", lambda: False)
    forget()
    try:
        with pytest.raises(MitsubaError, match=r"pip install 'tyndall\[truth\]'"):
            judge(Scene(), (4, 4))
        assert available().variant is None
        assert len(available().failures) == 1
    finally:
        forget()


def test_a_bad_llvm_is_one_line_that_names_the_variant(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(tmp_path / "libLLVM-99.so"))
    forget()
    try:
        with pytest.raises(MitsubaError, match=r"llvm_ad_rgb failed: .*libLLVM-99\.so") as caught:
            judge(Scene(), (4, 4), variant="llvm_ad_rgb")
        assert "\n" not in str(caught.value)
    finally:
        forget()


def forget() -> None:
    """What was found out about variants."""
    available.cache_clear()
    mitsuba._try.cache_clear()


def test_another_variant_takes_over(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    def variant(name: str) -> mitsuba.Variant:
        return mitsuba.Variant(name, None, "3")

    def render(scene: Scene, size: Any, settings: Any, chosen: mitsuba.Variant, progress: Any) -> str:
        if chosen.name != "scalar_rgb":
            raise MitsubaError(f"Mitsuba's {chosen.name} failed: signal SIGABRT")
        return chosen.name

    found = mitsuba.Availability(variant("llvm_ad_rgb"), ("Mitsuba's cuda_ad_rgb failed: no driver",))
    monkeypatch.setattr(mitsuba, "available", lambda: found)
    monkeypatch.setattr(mitsuba, "_try", variant)
    monkeypatch.setattr(mitsuba, "_render", render)
    with caplog.at_level(logging.WARNING, "tyndall"):
        assert judge(Scene(), (4, 4)) == "scalar_rgb"
        assert "cuda_ad_rgb failed: no driver" in caplog.text
        assert "llvm_ad_rgb failed" in caplog.text
        caplog.clear()
        judge(Scene(), (4, 4))
    assert "no driver" not in caplog.text, "once is enough"


def test_a_crash_and_a_silence_are_told() -> None:
    with pytest.raises(MitsubaError, match=r"scalar_rgb failed: .*FileNotFoundError") as caught:
        run_to_its_end("/nowhere")
    assert "\n" not in str(caught.value)
    with mitsuba._Process(["probe", "scalar_rgb"], "scalar_rgb", None) as process:
        process._native.kill()
        with pytest.raises(MitsubaError, match="scalar_rgb failed: signal SIGKILL"):
            list(process.news(30))
    with (
        mitsuba._Process(["probe", "scalar_rgb"], "scalar_rgb", None) as process,
        pytest.raises(MitsubaError, match="said nothing for 0.01 s"),
    ):
        list(process.news(0.01))


def run_to_its_end(folder: str) -> None:
    with mitsuba._Process(["render", folder], "scalar_rgb", None) as process:
        list(process.news(30))


def environment() -> dict[str, str]:
    source = str(Path(mitsuba.__file__).parents[2])
    return {**os.environ, "PYTHONPATH": os.pathsep.join([source, os.environ.get("PYTHONPATH", "")])}


def test_its_process_ends_with_ours(tmp_path: Path) -> None:
    content = mitsuba.export(occluded(HIGH), (64, 64), tmp_path)
    endless = {**content, "target": 0.0, "samples": 1 << 20, "seconds": 0.0, "depth": 2, "filter": "box", "seed": 0}
    (tmp_path / "scene.json").write_text(json.dumps({**endless, "variant": "scalar_rgb"}))
    command = [sys.executable, "-m", "tyndall.lab.mitsuba_run", "render", str(tmp_path)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment())
    try:
        assert process.stdin is not None
        assert process.stdout is not None
        assert b"setup" in process.stdout.readline()
        process.stdin.close()
        begin = time.monotonic()
        assert process.wait(timeout=20) == 1
        assert time.monotonic() - begin < 10
    finally:
        process.kill()
        process.wait()
        if process.stdout:
            process.stdout.close()


def test_the_newest_llvm_is_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    names = ("libLLVM-14.so.1", "libLLVM-15.so.1", "libLLVM.so.19.1", "libLLVM-16.so")
    found = [Path("/usr/lib/x86_64-linux-gnu") / name for name in names]
    monkeypatch.setattr(Path, "glob", lambda self, pattern: iter(found if "usr/lib/*" in pattern else []))
    monkeypatch.setattr(Path, "resolve", lambda self: self)
    assert [Path(path).name for path in mitsuba.llvm_libraries()] == [names[2], names[3], names[1]]
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/mine.so")
    assert mitsuba.llvm_libraries() == ("/mine.so",)


def test_bad_input_is_named() -> None:
    with pytest.raises(ParameterError, match="no Scene"):
        judge("box", (4, 4))  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="whole pixels"):
        judge(Scene(), (4, 0))
    with pytest.raises(ParameterError, match="variant: 'cuda' is not one of"):
        judge(Scene(), (4, 4), variant="cuda")


def test_an_empty_scene_is_its_background() -> None:
    camera = Camera()
    found = draw(Scene(camera=camera, background=(0.2, 0.3, 0.4)), (4, 3))
    assert found.radiance == pytest.approx(np.broadcast_to((0.2, 0.3, 0.4), (3, 4, 3)), rel=1e-6)
    assert np.isinf(found.depth).all()
