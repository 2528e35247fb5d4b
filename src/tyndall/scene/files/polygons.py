"""Polygons to triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]


def fans(sizes: Ints) -> tuple[Ints, Ints]:
    """Split polygons, whose corners stand one after another, into fans around their first corners.

    Args:
        sizes: (F,) corners of each polygon; fewer than 3 give no triangle.

    Returns:
        (T, 3) places in the list of all corners, and (T,) the polygon of each triangle.
    """
    starts = np.cumsum(sizes) - sizes
    count = np.maximum(sizes - 2, 0)
    polygon = np.repeat(np.arange(len(sizes)), count)
    nth = np.arange(len(polygon)) - np.repeat(np.cumsum(count) - count, count)
    first = starts[polygon]
    return np.stack([first, first + nth + 1, first + nth + 2], axis=1), polygon
