"""Volume techniques: media that fill the inside of implicit surfaces."""

from tyndall.techniques.contract import Technique
from tyndall.techniques.volume.none import NoVolumes
from tyndall.techniques.volume.uniform_march import Filled, UniformMarch

MEMBERS: tuple[type[Technique], ...] = (NoVolumes, UniformMarch)

__all__ = ["MEMBERS", "Filled"]
