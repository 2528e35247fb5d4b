"""How far a picture is from the truth.

All errors are taken on linear float32 light before tone mapping, over all pixels and channels alike, so that no
transfer curve hides or exaggerates them. With ``x`` the picture, ``r`` the reference and ``m`` the reference's mean:

- ``rmse = sqrt(mean((x − r)²))``, in the unit of the light.
- ``rel_rmse = rmse / m``: comparable between scenes of any brightness. A technique that gives no light at all scores
  ``sqrt(mean(r²)) / m ≥ 1``.
- ``rel_rmse_corrected = sqrt(max(0, mse − mean(se²))) / m`` where the reference has a known standard error ``se``: the
  expected square of its noise is taken off, so that ``mse − mean(se²)`` is unbiased for the technique's own error.
  ``rel_rmse_limit`` is the error that noise might hide (:func:`hidden`), and ``within_noise`` says that it hides all.
- ``relmse = mean((x − r)² / (r² + ε))``: every pixel relative to itself, so that dark parts count. ε = 0.01·m², which
  is the 0.01 of Rousselle, Knaus and Zwicker (2011, *Adaptive sampling and reconstruction using greedy error
  minimization*) for a picture whose mean is 1.
- ``bias = mean(x − r) / m``: the signed part; −1 means that all of the light is missing. An error that is all noise
  has a bias near 0; always ``rel_rmse ≥ |bias|``, with equality where the error is the same everywhere.
- ``psnr = 20·log10(peak / rmse)`` in dB, with the reference's :func:`peak`.
- ``ssim``: structural similarity of Wang et al. (2004), Gaussian window of σ = 1.5 pixels, data range ``peak``, mean of
  the channels (scikit-image).
- ``flip``: mean HDR-FLIP of Andersson et al. (2021, *Visualizing errors in rendered high dynamic range images*): the
  difference that a person notices who flips between the two, from 0 to 1, at the exposures that the reference's light
  asks for; 67 pixels per degree. It alone tone-maps, inside the metric, as its definition asks (NVIDIA's
  ``flip-evaluator``, BSD-3-Clause).
- ``boundary``: the relative RMSE over the pixels near an edge of a shadow (:func:`shadow_edges`), relative to the same
  ``m``, with the reference's noise taken off.
- ``best_scale``: the factor that, applied to ``x``, brings it nearest to the reference; ``scaled_rel_rmse`` is the
  error that is left then (the reference's noise taken off): the light's shape apart from its strength, of use for a
  model without units.

:func:`picture_psnr` alone works on the final 8-bit picture, as a viewer sees it. Sums run in float64.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Light = NDArray[np.floating[Any]]

LUMINANCE = (0.2126, 0.7152, 0.0722)  # of linear Rec.709 primaries
RELMSE_EPSILON = 0.01
EDGE_CONTRAST = 0.2
SSIM_WINDOW = 11
_FLIP_STOPS = 6.0


class MissingLibrary(ValueError):  # noqa: N818 - one line for the user, who can do without
    """A metric whose library is not installed. The message says which, and how to get it."""


@dataclass(frozen=True, eq=False)
class Target:
    """What pictures are held against.

    Attributes:
        light: (H, W, 3), linear.
        error: its standard error, (H, W, 3); None where it has no noise.
        edges: (H, W) bool, pixels near an edge of a shadow; None where that is not known.
    """

    light: Light
    error: Light | None = None
    edges: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class Scores:
    """A picture against a :class:`Target`: see the module for each figure.

    None stands for a figure that does not exist: relative ones of a black reference, ``boundary`` without edges,
    ``ssim`` of a picture smaller than its window, ``ssim`` and ``flip`` without their library (then ``missing`` says
    so, a line each).

    Attributes:
        within_noise: the reference cannot tell the picture from right: what is left of the mean square error when the
            reference's noise is taken off is less than three times its own standard error.
        rel_rmse_limit: by the same three standard errors, the largest error that the picture may have; None where the
            reference has no noise.
    """

    rmse: float
    rel_rmse: float | None
    rel_rmse_corrected: float | None
    rel_rmse_limit: float | None
    within_noise: bool
    relmse: float | None
    psnr: float | None
    ssim: float | None
    flip: float | None
    bias: float | None
    boundary: float | None
    scaled_rel_rmse: float | None
    best_scale: float
    missing: tuple[str, ...] = ()

    def to_json(self) -> dict[str, float | bool | None]:
        """Every figure but ``missing``; JSON has no infinity, so the PSNR of equal pictures is null."""
        values = {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.name != "missing"}
        return {name: rounded(value) for name, value in values.items()}


def score(image: Light, target: Target) -> Scores:
    """All figures of the module at once.

    Args:
        image: (H, W, 3), linear.

    Raises:
        ValueError: the shapes differ, or a value is not finite.
    """
    r, error = target.light, target.error
    limit = hidden(image, r, error) if error is not None else None
    missing: list[str] = []

    def optional(metric: Any) -> float | None:
        try:
            value: float | None = metric(image, r)
        except MissingLibrary as reason:
            missing.append(str(reason))
            return None
        return value

    return Scores(
        rmse=rmse(image, r),
        rel_rmse=rel_rmse(image, r),
        rel_rmse_corrected=rel_rmse(image, r, error),
        rel_rmse_limit=limit[0] if limit else None,
        within_noise=limit[1] if limit else False,
        relmse=relmse(image, r),
        psnr=psnr(image, r),
        ssim=optional(ssim),
        flip=optional(flip),
        bias=bias(image, r),
        boundary=boundary(image, target),
        scaled_rel_rmse=scaled_rel_rmse(image, r, error),
        best_scale=best_scale(image, r),
        missing=tuple(missing),
    )


# --- error of the light -------------------------------------------------------------------------------------------


def rmse(image: Light, reference: Light) -> float:
    """Root mean square difference, in the unit of the inputs (any equal shapes).

    Raises:
        ValueError: the shapes differ, or a value is not finite.
    """
    x, r = _pair(image, reference)
    return math.sqrt(float(np.mean((x - r) ** 2)))


def rel_rmse(image: Light, reference: Light, error: Light | None = None) -> float | None:
    """:func:`rmse` over the reference's mean; None where that mean is zero, since no relative error exists then.

    With the reference's standard ``error``, of the same shape, the expected square of its noise is taken off; None
    where that is not finite.
    """
    x, r = _pair(image, reference)
    mean = float(r.mean())
    return _finite(_without_noise(x - r, error) / mean) if mean > 0 else None


def hidden(image: Light, reference: Light, error: Light) -> tuple[float, bool] | None:
    """The largest relative RMSE that a picture may have, and whether it may have none: both by three standard errors.

    Each pixel gives one estimate of the mean square error, ``mean((x − r)² − se²)`` over its channels, and the noise of
    pixels is independent. Two things bound the standard error of their mean, and the smaller one is taken: their
    scatter, whatever the noise's distribution, in which a picture's own uneven error counts too; and what noise that is
    normal adds to an error ``δ``, of variance ``4 δ² se² + 2 se⁴``, with the channels taken for one. None where the
    reference is black, has no noise after all, or a noise that is not known (not finite).
    """
    x, r = _pair(image, reference)
    mean, noise = float(r.mean()), np.square(error, dtype=np.float64)
    if mean <= 0 or not noise.any() or not np.isfinite(noise).all():
        return None
    squares = np.mean((x - r) ** 2 - noise, axis=-1)
    left = float(squares.mean())
    scatter = float(squares.std()) / math.sqrt(squares.size)
    normal = np.mean(4 * np.maximum((x - r) ** 2 - noise, 0) * noise + 2 * noise**2, axis=-1)
    uncertain = 3 * min(scatter, math.sqrt(float(normal.sum())) / squares.size)
    return math.sqrt(max(0.0, left) + uncertain) / mean, left < uncertain


def relative_noise(reference: Light, error: Light | None) -> float | None:
    """The reference's own relative standard error, ``sqrt(mean(se²)) / m``; 0 without noise, None without light or
    where the error is not known (not finite).
    """
    mean = float(np.mean(reference, dtype=np.float64))
    if mean <= 0:
        return None
    return 0.0 if error is None else _finite(math.sqrt(float(np.mean(np.square(error, dtype=np.float64)))) / mean)


def relmse(image: Light, reference: Light) -> float | None:
    """``mean((x − r)² / (r² + 0.01·m²))``; None where the reference is black."""
    x, r = _pair(image, reference)
    mean = float(r.mean())
    return float(np.mean((x - r) ** 2 / (r**2 + RELMSE_EPSILON * mean**2))) if mean > 0 else None


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


def scaled_rel_rmse(image: Light, reference: Light, error: Light | None = None) -> float | None:
    """:func:`rel_rmse` after :func:`best_scale`: the error of the light's shape, whatever its strength."""
    return rel_rmse(np.asarray(image, np.float64) * best_scale(image, reference), reference, error)


def peak(reference: Light) -> float:
    """The light that counts as white: what 99.9 % of the values do not exceed, so that a few glints do not decide.

    The greatest value where that is 0.
    """
    values = np.asarray(reference, np.float64)
    return float(np.quantile(values, 0.999)) or float(values.max())


def psnr(image: Light, reference: Light) -> float | None:
    """Peak signal-to-noise ratio of linear light in dB; infinite where equal, None where the reference is black."""
    error, white = rmse(image, reference), peak(reference)
    if white <= 0:
        return None
    return 20 * math.log10(white / error) if error > 0 else math.inf


def picture_psnr(image: NDArray[np.uint8], reference: NDArray[np.uint8]) -> float:
    """Peak signal-to-noise ratio of two 8-bit pictures in dB, ``20·log10(255 / rmse)``; infinite where equal."""
    if image.dtype != np.uint8 or reference.dtype != np.uint8:
        raise ValueError(f"picture_psnr compares 8-bit pictures, not {image.dtype} and {reference.dtype}")
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


# --- what people see ----------------------------------------------------------------------------------------------


def ssim(image: Light, reference: Light) -> float | None:
    """Mean structural similarity of (H, W, 3) linear light; 1 where equal.

    None where a side is shorter than the window of 11 pixels, or the reference is black.

    Raises:
        MissingLibrary: scikit-image is not installed.
    """
    try:
        from skimage.metrics import structural_similarity
    except ImportError as error:
        raise MissingLibrary(_missing("SSIM", "scikit-image")) from error
    x, r = _pair(image, reference)
    white = peak(r)
    if min(r.shape[:2]) < SSIM_WINDOW or white <= 0:
        return None
    # The paper's own window and normalisation; scikit-image's defaults differ.
    settings = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
    similarity: Any = structural_similarity
    return float(similarity(r, x, data_range=white, channel_axis=-1, **settings))


def flip(image: Light, reference: Light) -> float | None:
    """Mean HDR-FLIP of (H, W, 3) linear light, 0 … 1; None where the reference is black, for it has no exposure.

    Raises:
        MissingLibrary: flip-evaluator is not installed.
    """
    try:
        from flip_evaluator import evaluate
    except ImportError as error:
        raise MissingLibrary(_missing("FLIP", "flip-evaluator")) from error
    x, r = _pair(image, reference)
    exposures = flip_exposures(r)
    if exposures is None:
        return None
    # FLIP is defined for light, which is not negative; a technique's rounding may be.
    pictures = [np.ascontiguousarray(np.maximum(p, 0), np.float32) for p in (r, x)]
    _, mean, _ = evaluate(*pictures, "HDR", applyMagma=False, parameters=exposures)
    return float(mean)


def flip_exposures(reference: Light) -> dict[str, float] | None:
    """The range of exposures of HDR-FLIP, in the names of its library; None for a black reference.

    As in its paper: from that which brings the brightest pixel's luminance to where the tone curve (ACES) reaches 0.85,
    to that which does so for the median, a step a stop. The median is that of the pixels with any light, and no more
    than 6 stops below the brightest: a black background would else ask for endless exposures.
    """
    luminance = np.maximum(np.asarray(reference, np.float64), 0) @ LUMINANCE
    brightest = float(luminance.max())
    if brightest <= 0:
        return None
    median = max(float(np.median(luminance[luminance > 0])), brightest * 2**-_FLIP_STOPS)
    # Narkowicz's fit of ACES with 0.6 of the light: (a x² + b x) / (c x² + d x + e) = 0.85 at x = white.
    a, b, c, d, e, level = 0.36 * 2.51, 0.6 * 0.03, 0.36 * 2.43, 0.6 * 0.59, 0.14, 0.85
    square, half, last = a - level * c, -0.5 * (b - level * d), -level * e
    white = half / square + math.sqrt((half / square) ** 2 - last / square)
    start, stop = math.log2(white / brightest), math.log2(white / median)
    return {"startExposure": start, "stopExposure": stop, "numExposures": max(2, math.ceil(stop - start))}


# --- edges of shadows ---------------------------------------------------------------------------------------------


def boundary(image: Light, target: Target) -> float | None:
    """The relative RMSE over the pixels near an edge of a shadow; None where there are none, or the target is black.

    With ``f`` the share of these pixels and ``e`` the same error over all others, ``rel_rmse² = f·boundary² +
    (1 − f)·e²``.
    """
    x, r = _pair(image, target.light)
    mean = float(r.mean())
    if target.edges is None or not target.edges.any() or mean <= 0:
        return None
    error = None if target.error is None else target.error[target.edges]
    return _finite(_without_noise((x - r)[target.edges], error) / mean)


def shadow_edges(lit: Light, unshadowed: Light, error: Light | None = None) -> NDArray[np.bool_]:
    """Pixels near a visibility edge of a picture, (H, W).

    The light ratio is the picture's luminance over that of the same view in which nothing casts a shadow: 1 where every
    light reaches, whatever the surface's colour and the medium; 0 in full shadow; in the air, how much of what the eye
    looks through is lit. A pixel is near an edge where this ratio, as a mean of 3×3 pixels, varies by a fifth of its
    :func:`peak` or more among the pixels within :func:`edge_reach` of it, and by six times its standard error, so that
    noise makes no edges. A penumbra counts where it is about as narrow as that; a silhouette between a lit and a shaded
    surface counts too.

    Args:
        lit: the picture, (H, W, 3) linear, without what is ambient or shines by itself.
        unshadowed: the same without shadows. Where its light is below a thousandth of its mean, as on a surface that
            faces away from it, there is neither light nor shadow.
        error: standard error of ``lit``.
    """
    picture, full = (np.asarray(p, np.float64) @ LUMINANCE for p in (lit, unshadowed))
    seen = full > 1e-3 * max(float(full.mean()), 1e-300)
    ratio = np.divide(picture, full, out=np.zeros_like(full), where=seen)
    white = min(peak(ratio[seen]), 2.0) if seen.any() else 0.0  # scattered many times, light may exceed the unshadowed
    if white <= 0:
        return np.zeros(full.shape, bool)
    reach, count = edge_reach(ratio.shape[0]), _sum3(seen.astype(np.float64))
    smooth = np.divide(_sum3(np.clip(ratio, 0, white)), count, out=np.zeros_like(full), where=seen)
    greatest = _extreme(np.where(seen, smooth, -np.inf), reach, np.max)
    least = _extreme(np.where(seen, smooth, np.inf), reach, np.min)
    enough = np.full_like(full, EDGE_CONTRAST * white)
    if error is not None:
        noise = np.asarray(error, np.float64) @ LUMINANCE  # of channels that err alike, which is the worst
        noise = np.divide(noise, full, out=np.zeros_like(full), where=seen)
        noise = np.divide(np.sqrt(_sum3(noise**2)), count, out=np.zeros_like(full), where=seen)
        enough = np.maximum(enough, 6 * _extreme(noise, reach, np.max))
    return np.asarray(greatest - least >= enough)


def edge_reach(height: int) -> int:
    """How near an edge is near, in pixels: 1/180 of the picture's height, at least 1; the same part of any picture."""
    return max(1, round(height / 180))


def _sum3(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The sum of each pixel and its eight neighbours; 0 beyond the picture."""
    padded = np.pad(values, 1)
    rows = padded[:-2] + padded[1:-1] + padded[2:]
    return np.asarray(rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:])


def _extreme(values: NDArray[np.float64], reach: int, which: Any) -> NDArray[np.float64]:
    """The greatest or the least value within a square around each pixel."""
    for axis in (0, 1):
        width = [(reach, reach) if a == axis else (0, 0) for a in (0, 1)]
        padded = np.pad(values, width, mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis=axis)
        values = which(windows, axis=-1)
    return values


# --- shared -------------------------------------------------------------------------------------------------------


def _without_noise(difference: NDArray[np.float64], error: Light | None) -> float:
    """Root of the mean square, less the expected square of the reference's noise; NaN where that is not finite."""
    square = float(np.mean(difference**2))
    if error is not None:
        square -= float(np.mean(np.square(error, dtype=np.float64)))
    return math.sqrt(max(0.0, square)) if math.isfinite(square) else math.nan


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _pair(image: NDArray[Any], reference: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if image.shape != reference.shape:
        raise ValueError(f"a picture of shape {image.shape} cannot be compared with one of {reference.shape}")
    x, r = np.asarray(image, np.float64), np.asarray(reference, np.float64)
    if not (np.isfinite(x).all() and np.isfinite(r).all()):
        raise ValueError("a picture with values that are not finite cannot be compared")
    return x, r


def _missing(metric: str, package: str) -> str:
    return f"{metric} is left out, as {package} is not installed: pip install 'tyndall[truth]'"


def rounded(value: float | bool | None) -> float | bool | None:
    """A figure for JSON, of six digits: None where it is not finite."""
    if value is None or isinstance(value, bool):
        return value
    return float(f"{value:.6g}") if math.isfinite(value) else None
