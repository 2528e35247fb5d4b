"""Procedural 8-bit textures: plaster, wood, stone, terracotta, leaves, slate.

All are tileable: their noise is synthesised in the frequency domain with a power spectrum 1/f^β and random phase, which
is periodic by construction and costs one inverse FFT. Colours are sRGB in 0..1, as an artist picks them.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.scene.model import Image, Texture

Floats = NDArray[np.floating[Any]]
Color = tuple[float, float, float]
Generator = np.random.Generator


def noise(rng: Generator, size: int, beta: float = 2.0, stretch: float = 1.0, coarse: float = 1.0) -> Floats:
    """Tileable (size, size) noise with zero mean and unit deviation.

    Args:
        beta: power falls as 1/f^beta; 0 is white, 2 like clouds, 3 smooth.
        stretch: > 1 draws the pattern out along v.
        coarse: frequencies below this many periods a tile are left out, so that the repetition does not show.
    """
    fy = np.fft.fftfreq(size, 1 / size)[:, None] * stretch
    fx = np.fft.rfftfreq(size, 1 / size)[None, :]
    f = np.hypot(fx, fy)
    amplitude = np.where(f >= coarse, np.maximum(f, 1e-6) ** (-beta / 2), 0)
    phase = rng.random(amplitude.shape) * 2 * math.pi
    field = np.fft.irfft2(amplitude * np.exp(1j * phase), (size, size))
    return np.asarray((field - field.mean()) / field.std())


def image(rgb: Floats, name: str, alpha: Floats | None = None) -> Image:
    """sRGB (H, W, 3) and alpha (H, W) in 0..1 as texels."""
    pixels = np.full((*rgb.shape[:2], 4), 255, np.uint8)
    pixels[..., :3] = (np.clip(rgb, 0, 1) * 255 + 0.5).astype(np.uint8)
    if alpha is not None:
        pixels[..., 3] = (np.clip(alpha, 0, 1) * 255 + 0.5).astype(np.uint8)
    return Image(pixels, name)


def mix(a: Floats | Color, b: Floats | Color, t: Floats) -> Floats:
    """a + (b − a)·t, with t in 0..1 spread over the colour channels."""
    first, second = np.asarray(a, np.float64), np.asarray(b, np.float64)
    return np.asarray(first + (second - first) * np.clip(t, 0, 1)[..., None])


def mottled(
    rng: Generator, name: str, low: Color, high: Color, *, beta: float = 1.8, size: int = 256, metres: float = 1.0
) -> Texture:
    """Two colours blended by cloudy noise: plaster, terracotta, slate, cloth. One tile covers ``metres``."""
    clouds = noise(rng, size, beta, coarse=2)
    grain = noise(rng, size, 0.6)
    return Texture(image(mix(low, high, 0.5 + 0.22 * clouds + 0.07 * grain), name), scale=(1 / metres, 1 / metres))


def wood(
    rng: Generator, name: str, low: Color, high: Color, *, planks: int = 1, size: int = 512, metres: float = 1.0
) -> Texture:
    """Grain along v; ``planks`` boards side by side along u, each with its own tint, parted by dark joints."""
    warp = noise(rng, size, 2.6, stretch=6.0)
    fibre = noise(rng, size, 0.8, stretch=24.0)
    u = np.arange(size) / size
    board = np.minimum((u * planks).astype(int), planks - 1)
    shift = rng.random(planks)[board] * 7
    rings = np.sin(2 * math.pi * (u * 5 + shift)[None, :] + 2.2 * warp)
    tint = (rng.random(planks)[board] - 0.5) * (0.5 if planks > 1 else 0)
    rgb = mix(low, high, 0.5 + 0.16 * rings + 0.12 * fibre + tint[None, :])
    if planks > 1:
        ends = rng.random(planks)[board]
        v = (np.arange(size) / size)[:, None]
        joint = np.minimum(np.abs((u * planks) % 1 - 0.5)[None, :] < 0.485, np.abs((v - ends) % 1 - 0.5) < 0.497)
        rgb = rgb * np.where(joint, 1.0, 0.35)[..., None]
    return Texture(image(rgb, name), scale=(1 / metres, 1 / metres))


def paving(
    rng: Generator, name: str, low: Color, high: Color, joint: Color, *, across: int, metres: float, size: int = 512
) -> Texture:
    """Square tiles with joints, ``across`` to the texture, each with its own tint; one texture covers ``metres``."""
    position = (np.arange(size) + 0.5) / size * across
    column = position.astype(int)
    tint = rng.random((across, across))[column[:, None], column[None, :]]
    veins = noise(rng, size, 2.2, coarse=2)
    rgb = mix(low, high, 0.2 + 0.6 * tint + 0.16 * veins)
    edge = np.abs(position % 1 - 0.5)
    wear = 0.47 + 0.006 * noise(rng, size, 1.5)
    gap = np.maximum(edge[:, None], edge[None, :]) > wear
    rgb = np.where(gap[..., None], np.asarray(joint) * (1 + 0.08 * veins[..., None]), rgb)
    return Texture(image(rgb, name), scale=(1 / metres, 1 / metres))


def swatches(rng: Generator, name: str, colors: list[Color], *, shades: int = 4, spread: float = 0.12) -> Texture:
    """Strips of colour side by side along u, ``shades`` of each; a part picks one by its u and fades along v."""
    base = np.repeat(np.asarray(colors), shades, axis=0)
    base = base * (1 + spread * rng.uniform(-1, 1, (len(base), 1))) + 0.25 * spread * rng.uniform(-1, 1, base.shape)
    strip = np.repeat(base, 8, axis=0)
    fade = np.linspace(0.82, 1.08, 32)[:, None, None]
    return Texture(image(strip[None] * fade, name), wrap_v="clamp", filter="nearest")


def leaf_spray(rng: Generator, name: str, low: Color, high: Color, *, leaves: int = 9, size: int = 256) -> Texture:
    """A twig with pointed leaves on both sides, cut out by alpha; the stem runs up the middle from v = 1 to v = 0."""
    y, x = np.mgrid[0:size, 0:size] / size
    y = 1 - y
    rgb = np.tile(np.asarray(low), (size, size, 1))
    alpha = np.zeros((size, size))
    stem = (np.abs(x - 0.5) < 0.012) & (y < 0.86)
    alpha[stem] = 1
    rgb[stem] = (0.33, 0.25, 0.15)
    for k in range(leaves):
        side = 1 if k % 2 else -1
        root = np.array([0.5, 0.06 + 0.74 * k / max(1, leaves - 1)])
        if k == leaves - 1:
            side, heading = 0, math.pi / 2
        else:
            heading = math.pi / 2 - side * (0.95 + 0.25 * rng.random() - 0.35 * k / leaves)
        length = (0.34 - 0.12 * k / leaves) * (0.9 + 0.2 * rng.random())
        along = ((x - root[0]) * math.cos(heading) + (y - root[1]) * math.sin(heading)) / length
        across = (-(x - root[0]) * math.sin(heading) + (y - root[1]) * math.cos(heading)) / length
        half = 0.30 * np.sqrt(np.clip(along, 0, 1)) * (1 - np.clip(along, 0, 1)) ** 0.8 * 1.6
        inside = (along > 0) & (along < 1) & (np.abs(across) < half)
        vein = np.clip(1 - np.abs(across) * 60, 0, 1) + 0.4 * np.clip(np.sin(40 * (along - np.abs(across))) - 0.6, 0, 1)
        shade = 0.35 + 0.3 * rng.random() + 0.25 * along
        leaf = mix(low, high, shade + 0.35 * vein)
        alpha[inside] = 1
        rgb[inside] = leaf[inside]
    return Texture(image(rgb, name, alpha), wrap_u="clamp", wrap_v="clamp")


def chalkboard(rng: Generator, name: str, strokes: list[Floats], aspect: float, *, size: int = 512) -> Texture:
    """A wiped slate with chalk ``strokes``: polylines (N, 2) in units of the board's height, origin at the lower left.

    The texture covers the board once; ``aspect`` is its width over its height.
    """
    wiped = 0.5 * noise(rng, size, 2.4, stretch=0.35) + 0.25 * noise(rng, size, 1.0)
    chalk = np.zeros((size, size))
    for stroke in strokes:
        step = np.hypot(*np.diff(stroke, axis=0).T)
        travelled = np.concatenate([[0], np.cumsum(step)])
        count = int(travelled[-1] * size * 9)
        at = np.linspace(0, travelled[-1], count)
        line = np.stack(
            [np.interp(at, travelled, stroke[:, 0]) / aspect, 1 - np.interp(at, travelled, stroke[:, 1])], 1
        )
        line = line * size + rng.normal(0, size / 600, (count, 2)) * (1 / aspect, 1)
        x, y = (np.clip(line[:, i].astype(int), 0, size - 1) for i in (0, 1))
        np.add.at(chalk, (y, x), 0.55 * rng.random(count))
    slate = mix((0.13, 0.19, 0.17), (0.31, 0.37, 0.35), 0.35 + 0.2 * wiped)
    return Texture(image(mix(slate, (0.9, 0.9, 0.84), np.clip(chalk, 0, 0.9)), name), wrap_u="clamp", wrap_v="clamp")


def globe(rng: Generator, name: str, *, size: int = 512) -> Texture:
    """Land, sea and meridians of no particular planet, once around in u; v is up."""
    height = noise(rng, size, 3.0)
    land = mix((0.62, 0.55, 0.33), (0.75, 0.66, 0.47), 0.5 + 0.4 * height)
    sea = mix((0.13, 0.30, 0.38), (0.29, 0.50, 0.55), 0.6 + 0.5 * height)
    rgb = np.where((height > 0.35)[..., None], land, sea)
    turn = np.arange(size) / size
    line = (np.abs((turn * 24) % 1 - 0.5) > 0.48)[None, :] | (np.abs((turn * 12) % 1 - 0.5) > 0.485)[:, None]
    return Texture(image(rgb * np.where(line, 0.7, 1.0)[..., None], name), wrap_v="clamp")
