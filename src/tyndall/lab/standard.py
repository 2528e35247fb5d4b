"""What the errors of a comparison are against.

A :class:`Standard` is a truth (:class:`tyndall.lab.truth.Truth`) made ready: its light by kind with its standard error,
the pixels near edges of shadows, and its picture. Where the truth comes from:

- ``traced``: the scene traced by rays until its error is small (:mod:`tyndall.lab.truth`). It knows no shadow map, so
  it judges shadows and air alike.
- ``march``: a march whose steps were doubled until its ``L_v`` no longer changes (:mod:`tyndall.lab.reference`), in the
  same shadow map as the techniques. Against it a technique's own error shows, apart from that of the map. It has no
  noise.
- ``mitsuba``: Mitsuba 3, in a process of its own (:mod:`tyndall.lab.mitsuba`): another renderer, of other people.

Kinds of light: "inscattered" is ``L_v``, "surfaces" is ``L_b·T``, "radiance" the sum. All are of still frames: rays go
through the pixels' centres.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tyndall.gpu.params import ParameterError, nearest
from tyndall.lab import metrics
from tyndall.lab.metrics import Target
from tyndall.lab.picture import Picture, write_layers
from tyndall.lab.reference import Reference, find
from tyndall.lab.stage import Stage, Still
from tyndall.lab.truth import Truth, TruthSettings, trace

JUDGES = ("traced", "march", "mitsuba")
KINDS = {"volumetric": ("inscattered", "radiance"), "shadow": ("surfaces", "radiance")}
SYMBOLS = {"inscattered": "L_v", "surfaces": "L_b·T", "radiance": "L"}
LAYERS = {"inscattered": "inscatter", "surfaces": "surfaces", "radiance": ""}  # in EXR files

# Long enough for a percent on a GPU, and short enough for a first look without one; the table says how sure it is.
# Mitsuba has to load the scene and compile its kernels first.
_SECONDS = {"traced": 20.0, "mitsuba": 120.0}
_LIGHT = ("radiance", "inscattered", "radiance_error", "inscattered_error")

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Standard:
    """See the module.

    Attributes:
        truth: the light, and how sure it is.
        targets: what pictures are held against, by kind of light; the first is what the comparison is about.
        picture: the truth as it is shown.
        still: its 8-bit pixels as they are compared with a still frame's, (H, W, 3).
        march: how it converged, where the truth is a march.
    """

    truth: Truth
    targets: Mapping[str, Target]
    picture: Picture
    still: NDArray[np.uint8]
    march: Reference | None = None

    @property
    def noise(self) -> dict[str, float]:
        """The truth's own relative standard error by kind of light; 0 where there is no light."""
        return {kind: metrics.relative_noise(t.light, t.error) or 0.0 for kind, t in self.targets.items()}

    def caption(self) -> str:
        """One line on what it is and how sure it is."""
        if self.march:
            state = "converged" if self.march.within else "NOT converged"
            change = f"doubling changes L_v by {100 * self.march.change:.2f} %"
            return f"truth: march on the same shadow map, {self.march.steps} steps, {state} ({change})"
        noise = ", ".join(f"{_percent(error)} of {SYMBOLS[kind]}" for kind, error in self.noise.items())
        truth = self.truth
        return f"truth: {truth.judge}, {truth.samples} samples a pixel, {truth.seconds:.1f} s; its own error is {noise}"

    def to_json(self, image: str | None) -> dict[str, Any]:
        """How it was made and how sure it is; ``image`` is where its picture was saved."""
        first = next(iter(self.targets.values()))
        exr = image.removesuffix("png") + "exr" if image else None
        truth = self.truth
        return {
            "judge": truth.judge,
            **(self.march.to_json() if self.march else {"technique": truth.judge}),
            "mean": float(np.mean(first.light, dtype=np.float64)),
            "samples": truth.samples,
            "seconds": round(truth.seconds, 3),
            "relative_error": {kind: metrics.rounded(error) for kind, error in self.noise.items()},
            "boundary_share": {
                kind: None if t.edges is None else float(f"{t.edges.mean():.4g}") for kind, t in self.targets.items()
            },
            "settings": dict(truth.settings),
            "image": image,
            "exr": exr,
            "still_exr": exr,
        }

    def save(self, folder: Path) -> None:
        """Write ``reference.png``, and ``reference.exr`` with the light of all kinds and its standard error."""
        self.picture.save(folder / "reference.png")
        layers: dict[str, Floats] = {"": self.truth.radiance}
        layers |= {LAYERS[kind]: light for kind in LAYERS if kind != "radiance" for light in [_light(self.truth, kind)]}
        for kind, target in self.targets.items():
            if target.error is not None:
                layers[f"{LAYERS[kind] or 'radiance'}_error"] = target.error.astype(np.float32)
        write_layers(folder / "reference.exr", layers, self.picture.depth, self.picture.metadata)


def prepare(
    stage: Stage,
    family: str,
    truth: str | Truth,
    settings: TruthSettings | None = None,
    *,
    progress: Callable[[float], object] | None = None,
) -> Standard:
    """Find the truth of a stage's view, and make it ready to judge techniques of a family.

    Args:
        truth: one of :data:`JUDGES`, or one that is there already.
        settings: when a traced one is good enough; None is :func:`default_settings`.

    Raises:
        ParameterError: a truth of another size, or one that is not finite.
        MitsubaError: it is asked for, and missing or broken.
    """
    march = None
    found: Truth
    if isinstance(truth, Truth):
        found = truth
    elif truth == "march":
        march = find(stage, progress=progress)
        found = _of_march(march)
    elif truth == "mitsuba":
        from tyndall.lab.mitsuba import judge

        found = judge(stage.scene, stage.size, settings or default_settings(truth), progress=progress)
    else:
        settings = settings or default_settings(truth)
        found = trace(stage.scene, stage.size, settings, gpu=stage.gpu, progress=progress)
    if found.radiance.shape[1::-1] != tuple(stage.size):
        raise ParameterError(
            "truth: is {}×{} pixels, and the comparison {}×{}".format(*found.radiance.shape[1::-1], *stage.size)
        )
    if not all(np.isfinite(getattr(found, name)).all() for name in _LIGHT):
        raise ParameterError(
            f"truth: the light of {found.judge}, or its error, is not finite; scale the scene's lights"
        )
    full = stage.unshadowed()
    edges = _edges(stage, found, full)
    targets = {kind: Target(_light(found, kind), _error(found, kind), edges[kind]) for kind in KINDS[family]}
    if march:
        still = march.still.picture.pixels
        return Standard(found, targets, portrait(stage, march), still, march)
    pixels = stage.develop(found.radiance)
    depth = full.picture.depth if found.depth is None else found.depth
    made = {**full.picture.metadata, "technique": f"truth: {found.judge}"}
    return Standard(found, targets, Picture(pixels, found.radiance, depth, made), pixels)


def default_settings(judge: str) -> TruthSettings:
    """A relative standard error of 1 %, or what 20 s give of a traced truth, 120 s of Mitsuba's."""
    return TruthSettings(seconds=_SECONDS.get(judge, 0.0), filter="centre")


def check(family: str, truth: str | Truth | None, settings: TruthSettings | None = None) -> None:
    """Whether there is such a truth for a family: before any work is done.

    Raises:
        ParameterError: there is none, or it does not go by these settings.
    """
    if settings and truth not in ("traced", "mitsuba"):
        raise ParameterError("truth: only one that is traced, here or by Mitsuba, has settings")
    if settings and settings.filter != "centre":
        raise ParameterError("filter: the rays of still frames go through the pixels' centres, so the truth's must too")
    if truth is None or isinstance(truth, Truth):
        return
    if truth not in JUDGES:
        known = ", ".join(f"'{name}'" for name in JUDGES)
        raise ParameterError(f"truth: '{truth}' is not one of {known}{nearest(str(truth), JUDGES)}")
    if truth == "march" and family != "volumetric":
        raise ParameterError(
            "truth: 'march' sees what the shadow technique tells it, so it cannot judge it; use 'traced'"
        )


def portrait(stage: Stage, march: Reference, seconds: float = 8.0) -> Picture:
    """A march as it is shown: antialiased like the techniques where that takes no longer than ``seconds``."""
    if 16 * march.seconds > seconds:
        return march.still.picture
    renderer = stage.use(march.made)
    for _ in range(16):
        renderer.draw()
    return stage.picture(march.technique)


def _edges(stage: Stage, truth: Truth, full: Still) -> dict[str, NDArray[np.bool_]]:
    """Where edges of shadows are seen, by kind of light (:func:`tyndall.lab.metrics.shadow_edges`).

    On surfaces they are the truth's own. In the air noise would hide them, so that they are those of a march through a
    fine shadow map, whose place differs by a texel at most. In the picture there are both.
    """
    ambient = stage.unlit().surfaces
    direct, most = _light(truth, "surfaces") - ambient, full.surfaces - ambient
    surfaces = metrics.shadow_edges(direct, most, _error(truth, "surfaces"))
    air = metrics.shadow_edges(stage.shafts().light, full.light)
    return {"surfaces": surfaces, "inscattered": air, "radiance": surfaces | air}


def _of_march(march: Reference) -> Truth:
    still = march.still
    none = np.zeros_like(still.light)
    return Truth(
        judge=march.technique,
        radiance=still.picture.radiance,
        inscattered=still.light,
        surfaces=still.surfaces,
        depth=still.picture.depth,
        radiance_error=none,
        inscattered_error=none,
        samples=march.steps,
        seconds=march.seconds,
        size=still.picture.size,
        settings={"steps": march.steps},
    )


def _light(truth: Truth, kind: str) -> Floats:
    if kind == "surfaces" and truth.surfaces is None:
        return truth.radiance - truth.inscattered
    light: Floats = getattr(truth, kind)
    return light


def _error(truth: Truth, kind: str) -> Floats | None:
    """The standard error of a kind of light; that of the surfaces is what is left of the sum's, as if independent."""
    if kind == "surfaces":
        # Squares of dim and of bright light are beyond float32.
        square = np.square(truth.radiance_error, dtype=np.float64) - np.square(
            truth.inscattered_error, dtype=np.float64
        )
        error = np.sqrt(np.maximum(0, square)).astype(np.float32)
    else:
        error = getattr(truth, f"{kind}_error")
    return error if error.any() else None


def _percent(fraction: float) -> str:
    """Two digits; whole numbers from a hundred on."""
    percent = 100 * fraction
    return f"{percent:.0f} %" if percent >= 100 else f"{percent:.2g} %"
