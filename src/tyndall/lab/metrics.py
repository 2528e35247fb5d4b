"""How far a picture is from the truth.

Errors of light are taken on linear float32 radiance before tone mapping, over all pixels and channels alike, so that no
transfer curve hides or exaggerates them. They are relative to the reference's mean ``m``, which makes them comparable
between scenes of any brightness:

- ``rel_rmse = sqrt(mean((x − r)²)) / m``. A technique that gives no light at all scores ``sqrt(mean(r²)) / m ≥ 1``.
- ``bias = mean(x − r) / m``: the signed part; −1 means that all of the light is missing. An error that is all noise
  has a bias near 0; always ``rel_rmse ≥ |bias|``, with equality where the error is the same everywhere.
- ``best_scale``: the factor that, applied to ``x``, brings it nearest to the reference. With it,
  :func:`scaled_rel_rmse` tells the shape of the light apart from its strength: of use for a model without units.

:func:`psnr` alone works on the final 8-bit picture, as a viewer sees it. Sums run in float64.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Light = NDArray[np.floating[Any]]


def rmse(image: Light, reference: Light) -> float:
    """Root mean square difference, in the unit of the inputs (any equal shapes).

    Raises:
        ValueError: the shapes differ, or a value is not finite.
    """
    x, r = _pair(image, reference)
    return math.sqrt(float(np.mean((x - r) ** 2)))


def rel_rmse(image: Light, reference: Light) -> float | None:
    """:func:`rmse` over the reference's mean; None where that mean is zero, since no relative error exists then."""
    x, r = _pair(image, reference)
    mean = float(r.mean())
    return math.sqrt(float(np.mean((x - r) ** 2))) / mean if mean > 0 else None


def bias(image: Light, reference: Light) -> float | None:
    """Mean signed difference over the reference's mean; positive where ``image`` is too bright; None as above."""
    x, r = _pair(image, reference)
    mean = float(r.mean())
    return float(np.mean(x - r)) / mean if mean > 0 else None


def best_scale(image: Light, reference: Light) -> float:
    """The factor ``s`` with the least ``‖s·image − reference‖``: ``⟨x, r⟩ / ⟨x, x⟩``; 0 for a black image."""
    x, r = _pair(image, reference)
    square = float(np.vdot(x, x))
    return float(np.vdot(x, r)) / square if square > 0 else 0.0


def scaled_rel_rmse(image: Light, reference: Light) -> float | None:
    """:func:`rel_rmse` after :func:`best_scale`: the error of the light's shape, whatever its strength."""
    return rel_rmse(np.asarray(image, np.float64) * best_scale(image, reference), reference)


def psnr(image: NDArray[np.uint8], reference: NDArray[np.uint8]) -> float:
    """Peak signal-to-noise ratio of two 8-bit pictures in dB, ``20·log10(255 / rmse)``; infinite where equal."""
    if image.dtype != np.uint8 or reference.dtype != np.uint8:
        raise ValueError(f"psnr compares 8-bit pictures, not {image.dtype} and {reference.dtype}")
    x, r = _pair(image, reference)
    error = math.sqrt(float(np.mean((x - r) ** 2)))
    return 20 * math.log10(255 / error) if error > 0 else math.inf


def error_map(image: Light, reference: Light) -> NDArray[np.float32]:
    """Where the error is: (H, W) float32, the root mean square over the channels over the reference's mean.

    ``rel_rmse² = mean(error_map²)``. All zero where the reference's mean is zero.
    """
    x, r = _pair(image, reference)
    mean = float(r.mean())
    difference = np.sqrt(np.mean((x - r) ** 2, axis=-1))
    return (difference / mean if mean > 0 else np.zeros_like(difference)).astype(np.float32)


def _pair(image: NDArray[Any], reference: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if image.shape != reference.shape:
        raise ValueError(f"a picture of shape {image.shape} cannot be compared with one of {reference.shape}")
    x, r = np.asarray(image, np.float64), np.asarray(reference, np.float64)
    if not (np.isfinite(x).all() and np.isfinite(r).all()):
        raise ValueError("a picture with values that are not finite cannot be compared")
    return x, r
