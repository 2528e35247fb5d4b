"""The stage for bare meshes: framed, lit, and the same at every scale."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import tyndall.scene
from tyndall.gpu.params import ParameterError
from tyndall.scene.files import load
from tyndall.scene.model import Camera, DirectionalLight, Instance, Medium, Mesh, PointLight, Scene, SpotLight
from tyndall.scene.stage import FILL, OPTICAL_DEPTH, RADIANCE, WIDEST, stage

DATA = Path(tyndall.scene.__file__).parents[4] / "shared" / "data"


def ellipsoid(x: float, y: float, z: float, scale: float = 1.0, centre: Any = (0.0, 0.0, 0.0)) -> Scene:
    """Half axes x, y, z times a scale."""
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 2 * np.pi, 41), np.linspace(0, np.pi, 21)))
    points = np.stack([x * np.sin(v) * np.cos(u), y * np.cos(v), z * np.sin(v) * np.sin(u)], axis=1) * scale + centre
    corners = np.arange(len(points) // 3 * 3, dtype=np.uint32).reshape(-1, 3)
    return Scene((Instance(Mesh(points.astype(np.float32), corners)),))


def project(camera: Camera, points: NDArray[Any]) -> NDArray[np.float64]:
    """(N, 2) picture coordinates, ±1 at the upper and lower edge, and the depth."""
    position = np.array(camera.position)
    forward = np.array(camera.target) - position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    local = (points - position) @ np.stack([right, np.cross(right, forward), forward], axis=1)
    return np.column_stack([local[:, :2] / (local[:, 2:] * math.tan(camera.fov / 2)), local[:, 2]])


SHAPES = [(1, 1, 1), (1, 3, 1), (0.2, 1, 0.7), (4, 0.3, 4), (9, 1, 0.5)]


@pytest.mark.parametrize("shape", SHAPES)
def test_the_object_fills_the_picture_as_promised(shape: tuple[float, float, float]) -> None:
    scene = ellipsoid(*shape)
    staged = stage(scene)
    picture = project(staged.camera, scene.instances[0].mesh.positions)
    low, high = picture.min(axis=0), picture.max(axis=0)
    height, width = (high[1] - low[1]) / 2, (high[0] - low[0]) / 2 / (4 / 3)
    assert height == pytest.approx(FILL, rel=0.03) or (height < FILL and width == pytest.approx(WIDEST, rel=0.03))
    assert abs(high + low)[:2].max() < 0.05  # in the middle
    assert low[2] > staged.camera.near


@pytest.mark.parametrize("scale", [1e-3, 1, 1000])
def test_the_picture_does_not_depend_on_the_unit(scale: float) -> None:
    one, other = stage(ellipsoid(1, 2, 1)), stage(ellipsoid(1, 2, 1, scale))
    assert np.allclose(np.array(other.camera.position) / scale, one.camera.position, rtol=1e-4)
    (a,), (b,) = one.lights, other.lights
    assert isinstance(a, SpotLight)
    assert isinstance(b, SpotLight)
    assert np.allclose(np.array(b.position) / scale, a.position, rtol=1e-4)
    assert b.intensity / scale**2 == pytest.approx(a.intensity, rel=1e-4)
    assert other.medium.extinction[0] * scale == pytest.approx(one.medium.extinction[0], rel=1e-4)


def test_it_stands_on_ground_that_faces_up() -> None:
    scene = ellipsoid(1, 2, 1, centre=(10, 20, 30))
    staged = stage(scene)
    assert staged.instances[0] is scene.instances[0]
    ground = staged.instances[-1]
    matrix = np.array(ground.transform)
    corners = ground.mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]
    assert np.allclose(corners[:, 1], 18)
    assert np.allclose(corners.mean(axis=0), (10, 18, 30))
    a, b, c = (corners[ground.mesh.indices[:, i]] for i in range(3))
    assert (np.cross(b - a, c - a)[:, 1] > 0).all()


def test_the_light_gives_the_radiance_that_it_promises() -> None:
    scene = ellipsoid(1, 1, 1)
    staged = stage(scene)
    (light,) = staged.lights
    assert isinstance(light, SpotLight)
    distance = np.linalg.norm(light.position)  # the object's middle is the origin
    air = math.exp(-staged.medium.extinction[0] * distance)
    assert light.intensity * air / distance**2 / math.pi == pytest.approx(RADIANCE)
    # The whole object is in the cone, and the light is outside the object, above, and not in front of the camera.
    axis = np.array(light.direction) / np.linalg.norm(light.direction)
    rays = scene.instances[0].mesh.positions - np.array(light.position)
    cosine = rays @ axis / np.linalg.norm(rays, axis=1)
    assert cosine.min() > math.cos(light.outer_angle)
    assert light.position[1] > 1
    assert abs(project(staged.camera, np.array([light.position]))[0, :2]).max() > 1


def test_the_air_has_the_optical_depth_that_it_promises() -> None:
    staged = stage(ellipsoid(1, 1, 1))
    assert staged.medium.bounds is not None
    low, high = map(np.array, staged.medium.bounds)
    origin = np.array(staged.camera.position)
    direction = np.array(staged.camera.target) - origin
    direction /= np.linalg.norm(direction)
    along = np.linspace(0, 100, 200_001)[:, None]
    inside = ((origin + along * direction > low) & (origin + along * direction < high)).all(axis=1)
    assert inside.sum() * 100 / 200_000 * staged.medium.extinction[0] == pytest.approx(OPTICAL_DEPTH, rel=1e-3)
    assert 0.3 <= OPTICAL_DEPTH <= 0.6


def test_what_a_file_has_is_kept() -> None:
    camera = Camera((3, 3, 3))
    bare = ellipsoid(1, 1, 1)
    with_camera = stage(bare.with_(camera=camera))
    assert with_camera.camera is camera
    assert len(with_camera.instances) == 1  # a composed picture gets no ground
    assert len(with_camera.lights) == 1
    lights = (PointLight(), DirectionalLight())
    with_lights = stage(bare.with_(lights=lights))
    assert with_lights.lights == lights
    assert with_lights.ambient == bare.ambient
    assert with_lights.camera != Camera()
    medium = Medium((1, 1, 1))
    assert stage(bare.with_(medium=medium)).medium is medium


def test_a_camera_that_looks_past_the_stage_still_has_air() -> None:
    away = Camera((0, 0, 1000), (0, 0, 2000))
    assert 0 < stage(ellipsoid(1, 1, 1).with_(camera=away)).medium.extinction[0] < 1


def test_a_point_and_a_plane_are_staged() -> None:
    for points in (np.zeros((3, 3)), [(0, 0, 0), (1, 0, 0), (0, 0, 1)], [(0, 0, 0), (0, 1, 0), (0, 2, 0)]):
        staged = stage(Scene((Instance(Mesh(np.array(points, np.float32), np.array([(0, 1, 2)], np.uint32))),)))
        assert np.isfinite(staged.camera.position).all()
        assert staged.medium.extinction[0] > 0


@pytest.mark.parametrize("name", ["stanford-bunny", "spot", "teapot"])
def test_real_files_are_framed(name: str) -> None:
    path = DATA / f"{name}.obj"
    if not path.exists():
        pytest.skip(f"{name}.obj is not beside this checkout, in ../shared/data")
    scene = load(path)
    picture = project(stage(scene).camera, scene.instances[0].mesh.positions)
    assert (picture[:, 1].max() - picture[:, 1].min()) / 2 == pytest.approx(FILL, abs=0.06)


def test_a_mesh_or_a_shape_alone_stands_on_a_stage_too() -> None:
    (instance,) = ellipsoid(1, 2, 1).instances
    assert stage(instance.mesh).instances[0].mesh is instance.mesh
    scene = stage(Ball())
    assert scene.implicits[0].shape == Ball()
    assert len(scene.lights) == len(scene.instances) == 1
    with pytest.raises(ParameterError, match="str is no solid shape"):
        stage("box")  # type: ignore[arg-type]


class Ball:
    """As much as a scene must know of a shape."""

    dimension = 3
    box = (np.full(3, -1.0), np.full(3, 1.0))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Ball)

    def __hash__(self) -> int:
        return 0

    def moved(self, moves: Any) -> Ball:
        return self
