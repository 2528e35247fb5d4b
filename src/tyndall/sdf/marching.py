"""How rays are marched through implicit surfaces.

What :class:`Marching` declares is a scene's ``looks["marching"]``, and on the command line ``--marching.steps 64``, as
techniques' parameters are. What traces the truth marches with the defaults, whatever is asked of the frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from tyndall.gpu.params import check, param, replace


@dataclass(frozen=True)
class Marching:
    """Sphere tracing: when a ray through implicit surfaces ends."""

    name: ClassVar[str] = "marching"
    paper: ClassVar[str] = "Hart 1996, Sphere tracing"
    advice: ClassVar[str] = "Fewer steps or a larger threshold are faster; outlines grow, and what is grazed is lost."
    receivers: ClassVar[Literal["all", "planes"]] = "all"

    steps: int = param(256, 1, 4096, "most steps of a ray through one object")
    distance: float = param(1e6, 1e-3, 1e9, "farthest that a ray goes", unit="m")
    threshold: float = param(0.35, 0, 8, "how near a surface is met: outlines are wider by as much", unit="pixel")

    def __post_init__(self) -> None:
        check(self)

    @classmethod
    def of(cls, looks: Mapping[str, Mapping[str, Any]], changes: Mapping[str, Any] | None = None) -> Marching:
        """As a scene's looks have it, with some parameters changed; values as texts or of their type.

        Raises:
            ParameterError: no such parameter, or a value outside its range.
        """
        return replace(cls(), {**looks.get(cls.name, {}), **(changes or {})})
