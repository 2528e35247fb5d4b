"""What the ``paper`` models have in common: S1's equations are those of parallel light."""

from __future__ import annotations

from tyndall.scene.model import DirectionalLight, Scene
from tyndall.techniques.contract import Technique, Unsupported


def refuse_near_lights(technique: Technique, scene: Scene) -> None:
    """Raise :class:`Unsupported`, naming the first light that is not directional."""
    for index, light in enumerate(scene.lights):
        if not isinstance(light, DirectionalLight):
            raise Unsupported(
                f"{technique.name}'s paper model knows directional lights only, and lights[{index}] is a {light.kind} "
                "light: use model physical"
            )
