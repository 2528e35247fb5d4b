"""Rays from arrays, for who wants to ask the scene something: what is hit first, what is in the way.

>>> import tyndall as ty
>>> from tyndall.gpu.device import Gpu
>>> with Gpu() as gpu, World(gpu, ty.scenes.box()) as world:
...     hit = cast(gpu, world, [[0, 3, 0]], [[0, -1, 0]])
...     bool(hit["t"][0] < 3.5)
True
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tyndall.gpu.device import Gpu
from tyndall.gpu.params import ParameterError
from tyndall.tracing.bvh import OWNER
from tyndall.tracing.world import World

_MODULE = "package::tracing::cast"
_FAR = 1e9  # as wesl/camera.wesl


def cast(
    gpu: Gpu,
    world: World,
    origins: ArrayLike,
    directions: ArrayLike,
    *,
    near: ArrayLike = 0.0,
    far: ArrayLike = _FAR,
    cull: bool = False,
) -> NDArray[Any]:
    """The nearest hit of each ray.

    Args:
        origins, directions: (N, 3); directions of any length but zero.
        near, far: of each ray or all; what lies at near < t < far is hit, t in lengths of the direction.
        cull: pass the back faces of single-sided materials.

    Returns:
        (N,) records of ``t`` (1e9 where nothing is hit), ``barycentric`` (weights of the second and third vertex),
        ``primitive`` and ``instance``, the instance's index in the scene.

    Raises:
        ParameterError: shapes that do not fit.
    """
    rays = pack_rays(gpu, origins, directions, near, far)
    hits = gpu.dtype("package::tracing::rays::RayHit")
    with (
        gpu.buffer("tracing.count", np.array([len(rays), 0, 0, 0], np.uint32), owner=OWNER, usage="uniform") as count,
        gpu.buffer("tracing.rays", rays, owner=OWNER, element=f"{_MODULE}::CastRay") as rays_in,
        gpu.buffer(
            "tracing.hits", max(1, len(rays)) * hits.itemsize, owner=OWNER, element="package::tracing::rays::RayHit"
        ) as out,
    ):
        gpu.compute("tracing.cast", _MODULE, "cast_closest").bind(
            world.bindings,
            rays=rays_in,
            hits=out.read_write(),
            ray_count=count.uniform(),
            cull=gpu.constant(int(cull)),
        ).dispatch_line(len(rays))
        found = gpu.read_buffer(out)[: len(rays)].copy()
    gpu.forget_groups()
    return found


def blocked(
    gpu: Gpu, world: World, origins: ArrayLike, directions: ArrayLike, *, near: ArrayLike = 0.0, far: ArrayLike = _FAR
) -> NDArray[np.bool_]:
    """(N,) whether anything lies in each ray's way; arguments and errors as :func:`cast`."""
    rays = pack_rays(gpu, origins, directions, near, far)
    with (
        gpu.buffer("tracing.count", np.array([len(rays), 0, 0, 0], np.uint32), owner=OWNER, usage="uniform") as count,
        gpu.buffer("tracing.rays", rays, owner=OWNER, element=f"{_MODULE}::CastRay") as rays_in,
        gpu.buffer("tracing.answers", 4 * max(1, len(rays)), owner=OWNER) as out,
    ):
        gpu.compute("tracing.cast", _MODULE, "cast_occluded").bind(
            world.bindings, rays=rays_in, answers=out.read_write(), ray_count=count.uniform()
        ).dispatch_line(len(rays))
        found: NDArray[np.bool_] = gpu.read_buffer(out)[: len(rays)] != 0
    gpu.forget_groups()
    return found


def pack_rays(gpu: Gpu, origins: ArrayLike, directions: ArrayLike, near: ArrayLike, far: ArrayLike) -> NDArray[Any]:
    """``CastRay`` rows.

    Raises:
        ParameterError: origins or directions that are not (N, 3), or a direction that is zero or not finite.
    """
    start, way = np.atleast_2d(np.asarray(origins, np.float32)), np.atleast_2d(np.asarray(directions, np.float32))
    if start.ndim != 2 or start.shape[1] != 3 or start.shape != way.shape:
        raise ParameterError(f"origins: {start.shape} and directions: {way.shape} are not (N, 3) both")
    if not (np.isfinite(start).all() and np.isfinite(way).all() and (way != 0).any(axis=1).all()):
        raise ParameterError("directions: a ray's direction is zero or not finite")
    rows = np.zeros(len(start), gpu.dtype(f"{_MODULE}::CastRay"))
    rows["origin"], rows["direction"], rows["near"], rows["far"] = start, way, near, far
    return rows
