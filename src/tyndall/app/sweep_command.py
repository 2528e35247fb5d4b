"""``tyndall sweep``: a specification in a file, or the same in flags.

In flags, a comma separates the values to try: ``--lights 1,2,4``. What has several parts itself is joined by ``x``, as
in ``--sizes 640x360,1280x720`` and ``--froxel.grid 64x36x32,160x90x64``. Without an ``x``, a grid is one value in the
words of the other commands, ``--froxel.grid 64,36,32``. A flag that is given again adds its values to the first's.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from tyndall.app import console
from tyndall.gpu.params import ParameterError, fields_of

if TYPE_CHECKING:
    from tyndall.lab.sweep_spec import Location, Plan

FAULT, MISTAKE = 1, 2


def _values_of(what: str, metavar: str = "NAMES") -> Any:
    return typer.Option(metavar=metavar, help=what, rich_help_panel="What is measured")


def _how(what: str, metavar: str = "N") -> Any:
    return typer.Option(metavar=metavar, help=what, rich_help_panel="How it is measured")


Many = list[str] | None


def sweep(
    context: typer.Context,
    spec: Annotated[
        Path | None, typer.Argument(metavar="[SPEC.json]", help="What is measured, as a file; or flags say it.")
    ] = None,
    *,
    scenes: Annotated[Many, _values_of("Bundled scenes, scene JSONs, mesh files.")] = None,
    lights: Annotated[Many, _values_of("Numbers of lights, for bundled scenes.")] = None,
    sizes: Annotated[Many, _values_of("Sizes in pixels, like 640x360,1280x720.")] = None,
    techniques: Annotated[Many, _values_of("Volumetric techniques; all if not given.")] = None,
    shadow: Annotated[Many, _values_of("Shadow techniques.")] = None,
    occlusion: Annotated[Many, _values_of("Techniques of ambient occlusion.")] = None,
    reflection: Annotated[Many, _values_of("Techniques of reflections and refraction.")] = None,
    volume: Annotated[Many, _values_of("Techniques of clouds inside shapes.")] = None,
    antialiasing: Annotated[Many, _values_of("Antialiasing techniques.")] = None,
    tonemap: Annotated[Many, _values_of("Tone mappings.")] = None,
    truth: Annotated[
        str | None, _values_of("What errors are against: traced, march, mitsuba, or none.", "JUDGE")
    ] = None,
    frames: Annotated[str | None, _how("Frames measured; 0 for errors and memory alone. 64 if not given.")] = None,
    warmup: Annotated[str | None, _how("Frames drawn before that; 16 if not given.")] = None,
    seconds: Annotated[str | None, _how("Most that measuring one point's times takes; 2 if not given.")] = None,
    metrics: Annotated[str | None, _how("all, or light: the relative RMSE and bias of the light alone.")] = None,
    seed: Annotated[str | None, _how("Seed of everything random.")] = None,
    workers: Annotated[
        int, typer.Option(metavar="N", min=0, help="Processes that measure; more than one need Dask. 0: this one.")
    ] = 1,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="A Dask scheduler whose workers measure, like tcp://host:8786."),
    ] = None,
    adapter: Annotated[
        str | None, typer.Option(metavar="NAME", help="Part of an adapter's name; see `tyndall doctor`.")
    ] = None,
    format: Annotated[
        Literal["parquet", "csv"] | None, typer.Option(help="The table's kind; Parquet where pyarrow is installed.")
    ] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Measure again what the folder already has.")] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for the results; out/NAME, or out/sweep, if not given.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON on stdout.")] = False,
) -> None:
    """Measure any product of scenes, techniques, parameters, lights and sizes; goes on where it was stopped.

    A comma separates values: --lights 1,2,4 --sizes 640x360,1280x720 --froxel.grid 64x36x32,160x90x64.
    """
    from tyndall.lab.sweep import SweepError
    from tyndall.lab.sweep import sweep as run

    given = {
        "scenes": _split(scenes),
        "lights": _split(lights),
        "sizes": _split(sizes),
        "techniques": _techniques(techniques),
        "shadow": _techniques(shadow),
        "occlusion": _techniques(occlusion),
        "reflection": _techniques(reflection),
        "volume": _techniques(volume),
        "antialiasing": _techniques(antialiasing),
        "tonemap": _techniques(tonemap),
        "truth": truth,
        "frames": frames,
        "warmup": warmup,
        "seconds": seconds,
        "metrics": metrics,
        "seed": seed,
    }
    fields = {name: value for name, value in given.items() if value is not None}
    flags: Sequence[tuple[str, str, str]] = context.obj.flags
    folder = out or Path("out", "sweep" if spec is None else spec.stem)
    with console.Work("reading", remaining=True) as work:
        try:
            plan = _planned(spec, fields, flags)
        except SweepError as error:
            console.say(str(error), every=True)
            raise typer.Exit(MISTAKE) from error
        found = run(
            plan,
            folder,
            workers=workers,
            scheduler=scheduler,
            adapter=adapter,
            table=format,
            fresh=fresh,
            progress=work.advance,
        )
    if as_json:
        print(json.dumps(found.to_json(), indent=2))
    else:
        console.print_result(found.table())
        print(f"{len(found.rows)} rows are in {found.table_file}")
    if found.failed:
        raise typer.Exit(FAULT)


def _planned(spec: Path | None, fields: dict[str, Any], flags: Sequence[tuple[str, str, str]]) -> Plan:
    from tyndall.lab.sweep_spec import plan, read

    if spec is not None:
        if fields or flags:
            flag = f"--{next(iter(fields))}" if fields else f"--{flags[0][0]}.{flags[0][1]}"
            raise ParameterError(f"{flag}: {spec} says what is measured; write it there")
        return read(spec)
    return plan(spec_of_flags(fields, flags), flag_at)


def spec_of_flags(fields: dict[str, Any], flags: Iterable[tuple[str, str, str]]) -> dict[str, Any]:
    """The specification that flags stand for.

    Args:
        fields: those of the specification that have flags of their own.
        flags: technique, parameter and text of each ``--technique.parameter`` flag, and of ``--truth.setting``.
    """
    spec = dict(fields)
    parameters: dict[str, dict[str, list[str]]] = {}
    settings: dict[str, str] = {}
    for technique, parameter, text in flags:
        if technique == "truth":
            settings[parameter] = text
        else:
            values = parameters.setdefault(technique, {}).setdefault(parameter, [])
            values += _values(technique, parameter, text)
    if parameters:
        spec["parameters"] = parameters
    if settings:
        spec["truth"] = {"judge": spec.get("truth", "traced"), **settings}
    return spec


def flag_at(loc: Location) -> str:
    """The flag that says what is at a place of the specification."""
    if not loc:
        return ""
    nested = loc[0] in ("parameters", "truth")
    names = [str(step) for step in (loc[1:3] if loc[0] == "parameters" else loc) if not isinstance(step, int)]
    return f"--{'.'.join(names)}" if nested else f"--{loc[0]}"


def _values(technique: str, parameter: str, text: str) -> list[str]:
    """The values in a flag's text. One without an ``x`` is one value where the parameter has several parts."""
    from tyndall.lab.sweep_spec import MEMBERS, takes_list

    declared = fields_of(MEMBERS[technique]) if technique in MEMBERS else ()
    wide = any(takes_list(f.type) for f in declared if f.name == parameter)
    return [text] if wide and not set("x×") & set(text) else [part.strip() for part in text.split(",")]


def _split(texts: list[str] | None) -> list[str] | None:
    return None if texts is None else [part.strip() for text in texts for part in text.split(",")]


def _techniques(texts: list[str] | None) -> list[str] | None:
    names = _split(texts)
    return None if names is None else [name.replace("-", "_") for name in names]
