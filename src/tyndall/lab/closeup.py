"""Where a technique goes wrong, as one picture: the whole view, then crops of the places of largest error.

Each row shows the reference, the technique, and the error of its light (``L_v``, say) as heat; the first row is
the whole view with the places framed, the rows below magnify them without smoothing. The heat's scale is rounded up to
1, 2 or 5 times a power of ten, so that it can be read off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[np.uint8]

_PANEL = 480
_GAP = 8
_LABEL = 26
_INK, _PAPER, _FRAME = (225, 225, 225), (18, 18, 20), (255, 255, 255)

# Black, violet, red, orange, yellow, white: luminance rises steadily, so that it also reads in grey.
_HEAT = np.array(
    [(0, 0, 0), (60, 15, 110), (150, 30, 100), (225, 75, 45), (250, 160, 30), (250, 235, 110), (255, 255, 250)],
    np.float64,
)


@dataclass(frozen=True)
class Place:
    """A crop: its upper left pixel and its size, in pixels."""

    x: int
    y: int
    width: int
    height: int

    def crop[T: np.generic](self, image: NDArray[T]) -> NDArray[T]:
        """The part of (H, W, …) that this place covers."""
        return image[self.y : self.y + self.height, self.x : self.x + self.width]


def worst_places(error: NDArray[np.float32], count: int = 3) -> list[Place]:
    """The places with the largest mean square error, worst first, none overlapping another.

    Args:
        error: (H, W), of any unit.
        count: how many at most. There are fewer where no error is left.
    """
    height, width = error.shape
    w, h = min(width, max(16, width // 8)), min(height, max(12, 3 * width // 32))
    sums = np.zeros((height + 1, width + 1))
    np.cumsum(np.cumsum(error.astype(np.float64) ** 2, axis=0), axis=1, out=sums[1:, 1:])
    windows = sums[h:, w:] - sums[:-h, w:] - sums[h:, :-w] + sums[:-h, :-w]  # the window at each upper left pixel
    floor = 1e-12 * max(float(sums[-1, -1]), 1e-300)  # what rounding of the running sums leaves
    places: list[Place] = []
    while len(places) < count:
        y, x = (int(i) for i in np.unravel_index(int(windows.argmax()), windows.shape))
        if windows[y, x] <= floor:
            break
        places.append(Place(x, y, w, h))
        windows[max(0, y - h + 1) : y + h, max(0, x - w + 1) : x + w] = 0
    return places


def nice_ceiling(value: float) -> float:
    """The least of 1, 2 or 5 times a power of ten that is not below ``value``; 1e-6 at least."""
    value = max(value, 1e-6)
    power: float = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in (1, 2, 5, 10) if step * power >= value * (1 - 1e-9))


def heat(error: NDArray[np.float32], scale: float) -> Pixels:
    """(H, W) as colours, (H, W, 3) uint8: black at 0, white at ``scale`` and beyond."""
    position = np.clip(np.nan_to_num(error / scale), 0, 1) * (len(_HEAT) - 1)
    stops = np.arange(len(_HEAT))
    channels = [np.interp(position, stops, _HEAT[:, i]) for i in range(3)]
    return np.stack(channels, axis=-1).round().astype(np.uint8)


def strip(reference: Pixels, technique: Pixels, error: NDArray[np.float32], names: tuple[str, str, str]) -> Pixels:
    """One picture of it all, (…, 3) uint8.

    Args:
        reference, technique: final pictures of one size, (H, W, 3).
        error: (H, W), relative to the mean of the reference's light (:func:`tyndall.lab.metrics.error_map`).
        names: titles of the first two columns, and the symbol of the light whose error it is.
    """
    from PIL import Image, ImageDraw, ImageFont

    scale = nice_ceiling(float(np.quantile(error, 0.995)))
    columns = (reference, technique, heat(error, scale))
    titles = (*names[:2], f"error of {names[2]}: black 0, white {100 * scale:g} % of the mean")
    places = worst_places(error)
    rows: list[tuple[Pixels, ...]] = [columns]
    rows += [tuple(place.crop(column) for column in columns) for place in places]

    def fitted(height: int, width: int) -> int:
        return max(1, round(_PANEL * height / width))

    heights = [fitted(*row[0].shape[:2]) for row in rows]
    canvas_size = (
        len(columns) * (_PANEL + _GAP) + _GAP,
        _LABEL + sum(heights) + _GAP * (len(heights) + 1),
    )
    canvas = Image.new("RGB", canvas_size, _PAPER)
    draw = ImageDraw.Draw(canvas)
    font = ImageFont.load_default(15)
    top = _LABEL + _GAP
    for index, (row, height) in enumerate(zip(rows, heights, strict=True)):
        filter = Image.Resampling.LANCZOS if index == 0 else Image.Resampling.NEAREST
        for column, panel in enumerate(row):
            left = _GAP + column * (_PANEL + _GAP)
            canvas.paste(Image.fromarray(np.ascontiguousarray(panel)).resize((_PANEL, height), filter), (left, top))
            if index:
                draw.text((left + 6, top + 4), str(index), _FRAME, font, stroke_width=2, stroke_fill=_PAPER)
                continue
            draw.text((left, _LABEL // 2), titles[column], _INK, font, anchor="lm")
            ratio = _PANEL / error.shape[1]
            for number, place in enumerate(places, 1):
                x, y = left + place.x * ratio, top + place.y * ratio
                far_x, far_y = x + place.width * ratio - 1, y + place.height * ratio - 1
                draw.rectangle((x - 1, y - 1, far_x + 1, far_y + 1), outline=_PAPER, width=3)  # seen on white
                draw.rectangle((x, y, far_x, far_y), outline=_FRAME)
                draw.text((x + 4, y + 2), str(number), _FRAME, font, stroke_width=2, stroke_fill=_PAPER)
        top += height + _GAP
    return np.asarray(canvas)
