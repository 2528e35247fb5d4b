"""The ``tyndall`` command.

Results go to stdout, progress and notes to stderr; with ``--json``, stdout holds one JSON document and nothing else.
Exit codes: 0 done, 1 a fault of Tyndall itself, 2 a mistake in what was asked for (one line on stderr says which, and
nothing is written), 130 interrupted.
"""

from __future__ import annotations

import errno
import io
import json
import math
import os
import shlex
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from typer.exceptions import TyperException

from tyndall import __version__
from tyndall.app import arguments, console, report_command, sweep_command
from tyndall.app.arguments import Overrides
from tyndall.gpu.params import ParameterError, fields_of, nearest, replace

if TYPE_CHECKING:
    from tyndall.lab.truth import TruthSettings
from tyndall.lab.scenes import open_scene

DONE, FAULT, MISTAKE, INTERRUPTED = 0, 1, 2, 130

app = typer.Typer(
    name="tyndall",
    help="Volumetric light, shadows and implicit surfaces: techniques side by side, with honest numbers.",
    epilog="Every parameter of every technique is a flag: --froxel.grid 190,90,128. `tyndall techniques` lists them.",
    rich_markup_mode="rich",
    add_completion=False,
    pretty_exceptions_enable=False,
    suggest_commands=True,
)
bench = typer.Typer(help="Measure the techniques against this project's figures.")
app.add_typer(bench, name="bench")
app.command()(report_command.report)
app.command()(sweep_command.sweep)

SceneName = Annotated[
    str,
    typer.Argument(
        metavar="SCENE",
        help="A bundled scene (shadows:1000 has 1,000 triangles, swarm:99 99 drops), a scene JSON, or a mesh file.",
    ),
]
Size = Annotated[str, typer.Option(metavar="WxH", help="Width and height of the picture in pixels.")]
Shadow = Annotated[str | None, typer.Option(metavar="NAME", help="Shadow technique.")]
Occlusion = Annotated[str | None, typer.Option(metavar="NAME", help="Technique of ambient occlusion.")]
Reflection = Annotated[str | None, typer.Option(metavar="NAME", help="Technique of reflections and refraction.")]
VolumeName = Annotated[str | None, typer.Option("--volume", metavar="NAME", help="Technique of clouds inside shapes.")]
Antialiasing = Annotated[str | None, typer.Option(metavar="NAME", help="Antialiasing technique.")]
Tonemap = Annotated[str | None, typer.Option(metavar="NAME", help="Tone mapping.")]
Model = Annotated[
    Literal["paper", "physical"] | None,
    typer.Option(help="The equations of the techniques' papers, or single scattering in the scene's medium."),
]
Lights = Annotated[int | None, typer.Option(metavar="N", help="Number of lights, 1 to 32, for a bundled scene.")]
AdapterName = Annotated[
    str | None, typer.Option("--adapter", metavar="NAME", help="Part of an adapter's name; see `tyndall doctor`.")
]
Seed = Annotated[int, typer.Option(metavar="N", min=0, max=2**32 - 1, help="Seed of everything random.")]
Out = Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for the results; out/SCENE if not given.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout, and nothing else there.")]


_DRAWING = ("render", "compare", "sweep")  # commands that take parameters of techniques


@dataclass(frozen=True)
class Given:
    """What a command finds in its context: ``--technique.parameter`` flags, and the whole command line as one line."""

    flags: list[tuple[str, str, str]]
    command: str


@app.callback(invoke_without_command=True)
def _global(
    context: typer.Context,
    *,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show where an error came from.")] = False,
) -> None:
    if version:
        print(f"tyndall {__version__}")
        raise typer.Exit
    given: Given = context.obj
    if given.flags and context.invoked_subcommand not in _DRAWING:
        technique, parameter, _ = given.flags[0]
        raise ParameterError(f"--{technique}.{parameter}: {context.invoked_subcommand} draws nothing with it")


@app.command()
def render(
    context: typer.Context,
    scene: SceneName,
    *,
    size: Size = "1280x720",
    technique: Annotated[str, typer.Option(metavar="NAME", help="Volumetric technique.")] = "froxel",
    shadow: Shadow = None,
    occlusion: Occlusion = None,
    reflection: Reflection = None,
    volume: VolumeName = None,
    antialiasing: Antialiasing = None,
    tonemap: Tonemap = None,
    model: Model = None,
    lights: Lights = None,
    frames: Annotated[int, typer.Option(metavar="N", min=1, help="Frames to draw; the last is kept.")] = 16,
    adapter: AdapterName = None,
    seed: Seed = 0,
    time: Annotated[
        float | None, typer.Option(metavar="S", help="Seconds into the motion of a scene that has one.")
    ] = None,
    view: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="Not the picture but steps, normals, depth, ids, albedo, roughness or slice."
        ),
    ] = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Draw one picture: a PNG, and an EXR with linear light and depth; or a PNG of what it is made of."""
    pixels = arguments.parse_size(size)
    _check_finite("--time", time)
    names = arguments.split_list([technique])
    if len(names) != 1:
        raise ParameterError(f"--technique: '{technique}' is not one technique; compare draws several")
    technique = names[0]
    looks = {"occlusion": occlusion, "reflection": reflection, "volume": volume}
    looks |= {"antialiasing": antialiasing, "tonemap": tonemap}
    families = {"volumetric": technique, **_others(shadow=shadow, **looks)}
    parameters = _parameters(context.obj.flags, "volumetric", [technique], families, model)
    with console.Work("loading") as work:
        described = open_scene(scene, lights)
        _check_marched(scene, described.implicits, parameters)
        if time is not None:
            if described.motion is None:
                raise ParameterError(f"--time: nothing moves in {scene}")
            described = described.at_time(time)
        folder = out or Path("out", Path(scene.replace(":", "-")).stem)  # not the name in a file, which may be a path
        from tyndall.lab.picture import check_folder
        from tyndall.lab.render import render as draw
        from tyndall.lab.views import render_view

        check_folder(folder)
        work.advance(0.3, "drawing")
        if view is not None:
            picture = render_view(described, view, pixels, marching=parameters.get("marching"), adapter=adapter)
        else:
            picture = draw(
                described, size=pixels, parameters=parameters, frames=frames, adapter=adapter, seed=seed, **families
            )
        work.advance(0.9, "saving")
        folder.mkdir(parents=True, exist_ok=True)
        suffixes = (".png",) if view else (".png", ".exr")
        files = [picture.save(folder / f"{view or technique}{suffix}") for suffix in suffixes]
    if as_json:
        document = {
            "adapter": picture.metadata["adapter"],
            "scene": described.name,
            "triangles": described.triangle_count,
            "implicits": len(described.implicits),
            "size": list(picture.size),
            **({"view": view} if view else {"technique": technique}),
            **{key: str(file) for key, file in zip(("image", "exr"), files, strict=False)},
        }
        print(json.dumps(document, indent=2))
    else:
        width, height = picture.size
        name = "".join(c if c.isprintable() else "\ufffd" for c in described.name)  # a file's, for a terminal
        print(f"{files[0]}  ({name}, {view or technique}, {width}×{height}, {picture.metadata['adapter']})")
        for file in files[1:]:
            print(file)


@app.command()
def compare(
    context: typer.Context,
    scene: SceneName,
    *,
    size: Size = "1280x720",
    family: Annotated[
        Literal["volumetric", "shadow"],
        typer.Option(help="Whose techniques are compared; shadows without the air, unless --volumetric asks for it."),
    ] = "volumetric",
    technique: Annotated[
        list[str] | None,
        typer.Option(metavar="NAMES", help="Techniques of the family, separated by commas; all if not given."),
    ] = None,
    volumetric: Annotated[
        str | None, typer.Option(metavar="NAME", help="Volumetric technique, where shadows are compared.")
    ] = None,
    shadow: Annotated[
        str | None, typer.Option(metavar="NAME", help="Shadow technique, where volumetric light is compared.")
    ] = None,
    occlusion: Occlusion = None,
    reflection: Reflection = None,
    volume: VolumeName = None,
    antialiasing: Antialiasing = None,
    tonemap: Tonemap = None,
    model: Annotated[
        Literal["paper", "physical", "both"] | None,
        typer.Option(help="As the techniques' papers have it, or single scattering in the scene's medium, or both."),
    ] = None,
    truth: Annotated[
        Literal["traced", "march", "mitsuba", "none"],
        typer.Option(
            help="What errors are against: traced rays; a converged march in the same shadow map; Mitsuba 3; nothing. "
            "--truth.target 0.01 (1 % standard error), --truth.seconds 20, --truth.samples and --truth.depth say when "
            "it is good enough, and what it holds."
        ),
    ] = "traced",
    lights: Lights = None,
    frames: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Frames to measure; 64, or fewer on a slow adapter.")
    ] = None,
    warmup: Annotated[
        int | None, typer.Option(metavar="N", min=0, help="Frames to draw before measuring; 16, or fewer likewise.")
    ] = None,
    adapter: AdapterName = None,
    seed: Seed = 0,
    out: Out = None,
    report: Annotated[
        bool, typer.Option("--report", help="Write report.html there too: all of it on one page.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Light the same view by several techniques: time, memory, and error against a truth."""
    from tyndall.techniques import FAMILIES

    pixels = arguments.parse_size(size)
    chosen = arguments.split_list(technique) if technique else None
    if chosen == []:
        raise ParameterError("--technique: no name is given")
    looks = {"occlusion": occlusion, "reflection": reflection, "volume": volume}
    looks |= {"antialiasing": antialiasing, "tonemap": tonemap}
    others = _others(volumetric=volumetric, shadow=shadow, **looks)
    if family in others:
        raise ParameterError(f"--{family}: it is {family} techniques that are compared; --technique names them")
    if model is not None and family != "volumetric":
        raise ParameterError("--model: only volumetric techniques have models")
    settings, flags = _truth_settings(context, truth)
    parameters = _parameters(flags, family, chosen or list(FAMILIES[family].members), others)
    techniques: dict[str, Any] = {**others, family: chosen}
    with console.Work("loading") as work:
        described = open_scene(scene, lights)
        _check_marched(scene, described.implicits, parameters)
        folder = out or Path("out", Path(scene.replace(":", "-")).stem)  # not the name in a file, which may be a path
        from tyndall.lab.compare import compare as measure

        comparison = measure(
            described,
            size=pixels,
            family=family,
            model=model,
            parameters=parameters,
            truth=truth,
            truth_settings=settings,
            frames=frames,
            warmup=warmup,
            out=folder,
            adapter=adapter,
            seed=seed,
            progress=work.advance,
            command=context.obj.command,
            **techniques,
        )
        page = comparison.report(folder) if report else None
    if as_json:
        print(json.dumps(comparison.to_json(), indent=2))
    else:
        console.print_result(comparison.table())
        print(f"pictures and results.json are in {folder}")
        if page:
            print(f"the report is {page}")


@app.command()
def scenes(as_json: Json = False) -> None:
    """List the bundled scenes."""
    from tyndall.app import catalogue

    listed = catalogue.scenes_json()
    if as_json:
        print(json.dumps(listed, indent=2))
    else:
        console.print_result(catalogue.scenes_table(listed))


@app.command()
def techniques(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="A technique or a family; all if none.")] = None,
    as_json: Json = False,
) -> None:
    """List the techniques: what each is for, its paper, and every parameter."""
    from tyndall.app import catalogue

    found = catalogue.find_techniques(name)
    if as_json:
        print(json.dumps([catalogue.technique_json(*pair) for pair in found], indent=2))
    else:
        console.print_result(catalogue.techniques_table(found))


@app.command()
def doctor(adapter: AdapterName = None, as_json: Json = False) -> None:
    """Say what this machine draws with, what is missing, and how to get it."""
    from tyndall.app.doctor import diagnose

    report = diagnose(adapter)
    if as_json:
        print(json.dumps(report.to_json(), indent=2))
    else:
        console.print_result(report.table())
    if not report.can_render:
        raise typer.Exit(MISTAKE)


@bench.command()
def volumetric(
    *,
    quick: Annotated[bool, typer.Option("--quick", help="The same in small, for a software adapter.")] = False,
    fresh: Annotated[bool, typer.Option("--fresh", help="Measure again what the folder already has.")] = False,
    adapter: AdapterName = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the rows, the tables and the plots.")] = (
        Path("out/bench")
    ),
    as_json: Json = False,
) -> None:
    """Time, memory and error of the volumetric techniques against scenes, lights and resolution.

    A sweep: stopped and started again, it goes on where it was.
    """
    from tyndall.lab import bench as figures

    with console.Work("reading", remaining=True) as work:
        result = figures.volumetric(adapter, out, quick=quick, fresh=fresh, progress=work.advance)
        for line in result.notes:
            work.note(line)
    if as_json:
        print(json.dumps(result.to_json(), indent=2))
    else:
        print(result.markdown())


@bench.command()
def shadows(
    *,
    quick: Annotated[bool, typer.Option("--quick", help="The same in small, for a software adapter.")] = False,
    fresh: Annotated[bool, typer.Option("--fresh", help="Measure again what the folder already has.")] = False,
    adapter: AdapterName = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the figures and the tables.")] = (
        Path("out/shadows")
    ),
    as_json: Json = False,
) -> None:
    """Time, memory and error of every shadow technique, against triangles, lights and truth.

    Stopped and started again, it goes on where it was.
    """
    from tyndall.lab import bench_shadows as figures

    with console.Work("reading", remaining=True) as work:
        result = figures.shadows(adapter, out, quick=quick, fresh=fresh, progress=work.advance)
        for line in result.notes:
            work.note(line)
    if as_json:
        print(json.dumps(result.to_json(), indent=2))
    else:
        print(result.markdown())


@bench.command()
def sdf(
    *,
    quick: Annotated[bool, typer.Option("--quick", help="The same in small, for a software adapter.")] = False,
    seconds: Annotated[
        float | None,
        typer.Option(metavar="S", min=0.01, help="How long each of our frames is measured; 30, or 1 with --quick."),
    ] = None,
    adapter: AdapterName = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the figures and the tables.")] = Path("out/sdf"),
    as_json: Json = False,
) -> None:
    """Implicit surfaces against a plain shader loop: time, edits, first picture, and whether pruning is right."""
    from tyndall.lab import bench_sdf as figures

    _check_finite("--seconds", seconds)
    with console.Work("reading", remaining=True) as work:
        result = figures.sdf(adapter, out, quick=quick, seconds=seconds, progress=work.advance)
    if as_json:
        print(json.dumps(result.to_json(), indent=2))
    else:
        print(result.markdown())


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Args:
        words: the arguments after the program's name; ``sys.argv`` if None.
    """
    # A stream that was closed before the start is None. /dev/null takes its number, or the next file would.
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: SIM115
    sys.stderr = sys.stderr or open(os.devnull, "w")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without "×" still gets its result
    words = list(sys.argv[1:] if words is None else words)
    debug = "--debug" in words
    words = [word for word in words if word != "--debug"]
    try:
        rest, flags = arguments.split_flags(words)
        given = Given(flags, shlex.join(["tyndall", *words]))
        code = app(rest or ["--help"], prog_name="tyndall", standalone_mode=False, obj=given)
        sys.stdout.flush()
    except KeyboardInterrupt:
        return INTERRUPTED
    except Exception as error:
        if isinstance(error, OSError) and error.errno == errno.EPIPE:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return FAULT
        if debug:
            raise
        line, code = _explain(error)
        console.say(line)
    return code if isinstance(code, int) else DONE


def _explain(error: Exception) -> tuple[str, int]:
    """What to tell a person about an error, and the exit code."""
    if isinstance(error, TyperException):
        option, known = getattr(error, "option_name", None), getattr(error, "possibilities", None)
        if option is not None and hasattr(error, "possibilities"):
            return f"no such option {option}{nearest(option, known or ())}", MISTAKE
        return error.format_message().replace("Value error, ", ""), MISTAKE  # pydantic's words for its own
    # What the project raises on purpose is written for the user; but its shaders are its own.
    kind = type(error)
    if kind.__module__.startswith("tyndall.") and kind.__name__ != "ShaderError":
        return str(error), MISTAKE
    if isinstance(error, MemoryError) or kind.__name__ == "GPUOutOfMemoryError":
        return "not enough memory for what was asked", MISTAKE
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror, MISTAKE
    return f"this is a fault in Tyndall: {kind.__name__}: {error} (--debug shows where)", FAULT


def _flag_of(technique: str) -> str:
    """The flag that chooses a technique."""
    from tyndall.techniques import FAMILIES

    family = next(name for name, family in FAMILIES.items() if technique in family.members)
    return "--technique" if family == "volumetric" else f"--{family}"


def _others(**chosen: str | None) -> dict[str, str]:
    """The technique of each family, for the families where one was chosen."""
    return {family: name.replace("-", "_") for family, name in chosen.items() if name is not None}


def _truth_settings(context: typer.Context, judge: str) -> tuple[TruthSettings | None, list[tuple[str, str, str]]]:
    """The settings of the truth from ``--truth.name value`` flags, None without any; and the other flags."""
    from tyndall.lab.standard import default_settings
    from tyndall.lab.truth import TruthSettings

    given: Given = context.obj
    wanted = [flag for flag in given.flags if flag[0] == "truth"]
    others = [flag for flag in given.flags if flag[0] != "truth"]
    changes = arguments.convert_flags(wanted, {"truth": TruthSettings})
    return (replace(default_settings(judge), changes["truth"]) if changes else None), others


def _check_finite(flag: str, number: float | None) -> None:
    if number is not None and not math.isfinite(number):
        raise ParameterError(f"{flag}: {number} is not a finite number")


def _check_marched(scene: str, implicits: Sequence[object], parameters: Overrides) -> None:
    """Refuse parameters of rays where there is nothing that they march through."""
    if not implicits and (given := parameters.get("marching")):
        raise ParameterError(f"--marching.{next(iter(given))}: {scene} has no implicit surfaces")


def _parameters(
    flags: Iterable[tuple[str, str, str]],
    family: str,
    compared: list[str],
    others: Mapping[str, str],
    model: str | None = None,
) -> Overrides:
    """Parameter values by technique name, from ``--technique.parameter`` flags and, where it is given, ``--model``.

    ``compared`` are the names of a family, ``others`` one of other families each. All names and values are tried out
    here, before a scene is loaded or a device is woken.
    """
    from tyndall.sdf.marching import Marching
    from tyndall.techniques import FAMILIES

    members: dict[str, type] = {name: cls for family in FAMILIES.values() for name, cls in family.members.items()}
    members[Marching.name] = Marching
    chosen = [(family, name) for name in compared]
    chosen += [(f, others.get(f, known.default)) for f, known in FAMILIES.items() if f != family]
    for where, name in chosen:
        FAMILIES[where].find(name)
    parameters = arguments.convert_flags(flags, members)
    for name, values in parameters.items():
        if name not in {Marching.name, *(used for _, used in chosen)}:
            raise ParameterError(
                f"--{name}.{next(iter(values))}: '{name}' is not drawn here; choose it with {_flag_of(name)} {name}"
            )
    if model is not None:
        switched = [name for name in compared if any(f.name == "model" for f in fields_of(members[name]))]
        if not switched:
            raise ParameterError(f"--model: '{compared[0]}' has one model only")
        for name in switched:
            parameters.setdefault(name, {}).setdefault("model", model)
    return parameters
