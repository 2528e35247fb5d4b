"""How rays are marched through implicit surfaces."""

from __future__ import annotations

from dataclasses import dataclass

from tyndall.gpu.params import check, param


@dataclass(frozen=True)
class Marching:
    """Sphere tracing (Hart 1996): when a ray ends."""

    steps: int = param(256, 1, 4096, "most steps of a ray through one object")
    distance: float = param(1e6, 1e-3, 1e9, "farthest that a ray goes", unit="m")
    threshold: float = param(0.35, 0, 8, "how near a surface is met: outlines are wider by as much", unit="pixel")

    def __post_init__(self) -> None:
        check(self)
