"""What a sweep measures: a specification, checked whole, and the points that it stands for.

A specification is a JSON object (``docs/sweeps.md``), or the same as Python data::

    {"scenes": ["box", "room.json"], "lights": [1, 2, 4], "sizes": "640x360",
     "techniques": ["march", {"technique": "froxel", "grid": [[64, 36, 32], [160, 90, 64]]}],
     "truth": {"judge": "traced", "target": 0.01}}

Wherever one value may stand, a list of values may, and the sweep is their product: scene × lights × size × shadow ×
antialiasing × tonemap × ``marching`` of rays × technique × its parameters, the last of these changing fastest.
``parts`` holds further objects of the same fields; each is a product of its own that starts from the fields around it,
and the sweep is all of them, one after another. A point that is asked for twice is measured once.

Nothing is drawn before the whole is right: every name, value, parameter, scene file and number of lights is tried out,
and :class:`SweepError` has one line for each mistake, with its place.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import pydantic
from pydantic import BaseModel, BeforeValidator, ConfigDict
from pydantic_core import InitErrorDetails, PydanticCustomError

from tyndall.gpu.params import Field, Param, ParameterError, convert, fields_of, nearest, param, replace
from tyndall.lab import bundled, standard
from tyndall.lab.fingerprint import scene_hash
from tyndall.lab.scenes import open_scene
from tyndall.lab.stage import describe, make
from tyndall.lab.truth import TruthSettings
from tyndall.scene.errors import SceneError
from tyndall.scene.files.schema import path_text
from tyndall.scene.model import Scene
from tyndall.sdf.marching import Marching
from tyndall.techniques import FAMILIES
from tyndall.techniques.contract import Technique, Unsupported

Plain = dict[str, Any]
Location = tuple[str | int, ...]

_SIZE = re.compile(r"([+-]?\d{1,9})\s*[x×X*]\s*([+-]?\d{1,9})")
MEMBERS: dict[str, type[Any]] = {name: cls for family in FAMILIES.values() for name, cls in family.members.items()}
MEMBERS[Marching.name] = Marching
_MOST_POINTS = 100_000

OTHERS = tuple(family for family in FAMILIES if family != "volumetric")
"""The families but the volumetric one: one technique of each is drawn with every point."""


class SweepError(ValueError):
    """A specification that cannot be measured. The message has one line for each mistake.

    Attributes:
        mistakes: the lines, ``techniques[1]: no volumetric technique 'froxl' — did you mean 'froxel'? …``.
    """

    def __init__(self, mistakes: Sequence[str]) -> None:
        self.mistakes = tuple(mistakes)
        super().__init__("\n".join(self.mistakes))


@dataclass(frozen=True)
class Measuring:
    """How a point is measured. A slow adapter stops early: see :func:`tyndall.lab.measure.measure`."""

    frames: int = param(64, 0, 100_000, "frames measured; 0 measures no times, only errors and memory")
    warmup: int = param(16, 0, 100_000, "frames drawn before that")
    seconds: float = param(2.0, 0.01, 3600, "most that measuring one point's times takes", unit="s")
    seed: int = param(0, 0, 2**32 - 1, "of everything random")
    metrics: Literal["all", "light"] = param(
        "all", doc="'light' is the relative RMSE and bias of L_v alone: no slow ones"
    )


@dataclass(frozen=True)
class MarchSettings:
    """The judge ``march``: a ray march whose steps are doubled until the light no longer changes. It may have another
    shadow technique than the point, ``shadow``, to show the error of the point's own."""

    seconds: float = param(90.0, 0.01, 3600, "most that one frame of the judge takes", unit="s")


JUDGES = (*standard.JUDGES, "none")


@dataclass(frozen=True)
class Point:
    """One measurement, as plain data: what travels to a worker.

    Attributes:
        description: scene, lights, size, one technique of each family with all of its parameters, how rays are marched
            where the specification says so, truth, measuring.
        scene_hash: of the scene's content (:func:`tyndall.lab.fingerprint.scene_hash`).
        refusal: why its technique cannot draw its scene; such a point is reported, not drawn.
    """

    description: Plain
    scene_hash: str
    refusal: str | None = None
    id: str = field(init=False)

    def __post_init__(self) -> None:
        """The id is a hash of all of it. Of a scene's path only the last part counts: a moved folder keeps its rows."""
        named = {**self.description, "scene": Path(self.description["scene"]).name, "hash": self.scene_hash}
        text = json.dumps(named, sort_keys=True, separators=(",", ":"))
        object.__setattr__(self, "id", hashlib.blake2b(text.encode(), digest_size=8).hexdigest())

    @property
    def stage(self) -> str:
        """What it shares with points that can be drawn one after the other on one stage."""
        names = ("scene", "lights", "size", *OTHERS, Marching.name, "seed")
        return json.dumps([self.description.get(name) for name in names])

    def __str__(self) -> str:
        d = self.description
        lights, (width, height) = d["lights"], d["size"]
        return f"{d['scene']}, {lights} light{'s' * (lights != 1)}, {width}×{height}, {d['technique']['technique']}"


@dataclass(frozen=True)
class Plan:
    """A specification that is right.

    Attributes:
        spec: as it was given.
        points: in order, each once.
        parts: the points of each of its parts, those among them that another part has too; all where it has no parts.
    """

    spec: Plain
    points: tuple[Point, ...]
    parts: tuple[tuple[Point, ...], ...]


def read(source: str | os.PathLike[str] | Mapping[str, Any]) -> Plan:
    """The plan of a specification: the path of a JSON file, or its contents as Python data.

    Raises:
        SweepError: naming every mistake.
    """
    if isinstance(source, Mapping):
        return plan(source)
    path = Path(source)
    try:
        spec = json.loads(path.read_text(encoding="utf-8"), object_pairs_hook=_once)
    except OSError as error:
        raise SweepError([f"{path}: cannot be read: {error.strerror or error}"]) from error
    except json.JSONDecodeError as error:
        raise SweepError([f"{path}: not JSON: line {error.lineno}, column {error.colno}: {error.msg}"]) from error
    except UnicodeDecodeError as error:
        raise SweepError([f"{path}: not JSON: not text in UTF-8"]) from error
    except RecursionError as error:
        raise SweepError([f"{path}: not JSON: nested too deeply"]) from error
    except ParameterError as error:
        raise SweepError([f"{path}: {error}"]) from error
    return plan(spec, lambda loc: f"{path}: {path_text(loc)}" if loc else str(path), folder=path.parent)


def plan(
    spec: Any, where: Callable[[Location], str] = path_text, *, folder: str | os.PathLike[str] | None = None
) -> Plan:
    """The plan of a specification.

    Args:
        spec: as the module describes it.
        where: words for a place in it.
        folder: what the paths of scene files are relative to; the working directory if None.

    Raises:
        SweepError: naming every mistake.
    """
    wrong: dict[Location, list[str]] = {}
    record = None
    try:
        record = _Record.model_validate(spec)
    except pydantic.ValidationError as error:
        for e in error.errors(include_url=False):
            wrong.setdefault(tuple(e["loc"]), []).append(_message(e))
    scenes = _Scenes(None if folder is None else Path(folder))
    if isinstance(spec, Mapping):
        for loc, given, raw in _raw_parts(spec):
            for place, message in scenes.mistakes(raw):
                inherited = place[0] in raw and place[0] not in given
                wrong.setdefault(place if inherited else (*loc, *place), []).append(message)
    if record is not None:
        for loc, message in _undrawn(record):
            wrong.setdefault(loc, []).append(message)
    if wrong or record is None:
        lines = [f"{where(loc)}: {m}" if where(loc) else m for loc, ms in wrong.items() for m in dict.fromkeys(ms)]
        raise SweepError(lines)
    points: dict[str, Point] = {}
    parts = []
    for part in record.products():
        own: dict[str, Point] = {}
        for point in _expand(part, scenes):
            own.setdefault(point.id, points.setdefault(point.id, point))
            if len(points) > _MOST_POINTS:
                raise SweepError([f"more than {_MOST_POINTS} points; measure them in several sweeps"])
        parts.append(tuple(own.values()))
    return Plan(json.loads(json.dumps(spec)), tuple(points.values()), tuple(parts))


# --- the fields ---------------------------------------------------------------------------------------------------


class _InsideError(ParameterError):
    """Mistakes at places inside a value."""

    def __init__(self, mistakes: Sequence[tuple[Location, str]]) -> None:
        self.mistakes = mistakes
        super().__init__(mistakes[0][1])


class _Gathered:
    """Mistakes at several places of a value, raised together."""

    def __init__(self) -> None:
        self._found: list[tuple[Location, str]] = []

    def at[T](self, place: str | int, check: Callable[[Any], T], value: Any) -> T | None:
        """``check(value)``, or None where that is a mistake."""
        try:
            return check(value)
        except _InsideError as error:
            self._found += [((place, *loc), text) for loc, text in error.mistakes]
        except ParameterError as error:
            self._found.append(((place,), str(error)))
        return None

    def over[T](self, check: Callable[[Any], T], value: Any) -> T | None:
        """As :meth:`at`, of the value itself."""
        try:
            return check(value)
        except _InsideError as error:
            self._found += error.mistakes
        except ParameterError as error:
            self._found.append(((), str(error)))
        return None

    def note(self, place: str | int, text: str) -> None:
        """One more mistake."""
        self._found.append(((place,), text))

    def raise_any(self) -> None:
        if self._found:
            raise _InsideError(self._found)


def _checked(check: Callable[[Any], Any]) -> BeforeValidator:
    """A validator that gives the mistakes that ``check`` raises to pydantic, each with its place."""

    def validate(value: Any) -> Any:
        try:
            return check(value)
        except ParameterError as error:
            found = error.mistakes if isinstance(error, _InsideError) else [((), str(error))]
            kinds = [(loc, PydanticCustomError("mistake", "{message}", {"message": text})) for loc, text in found]
            details = [InitErrorDetails(type=kind, loc=loc, input=None) for loc, kind in kinds]
            raise pydantic.ValidationError.from_exception_data("sweep", details) from error

    return BeforeValidator(validate)


def _each(check: Callable[[Any], Any], is_one: Callable[[Any], bool] | None = None) -> Callable[[Any], tuple[Any, ...]]:
    """``check`` of one value, or of every value of a list."""

    def all_of(value: Any) -> tuple[Any, ...]:
        if not isinstance(value, (list, tuple)) or (is_one is not None and is_one(value)):
            return (check(value),)
        if not value:
            raise ParameterError("is an empty list")
        wrong = _Gathered()
        made = tuple(wrong.at(i, check, item) for i, item in enumerate(value))
        wrong.raise_any()
        return made

    return all_of


def _object(value: Any) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ParameterError(f"{value!r} is not an object")
    return value


def _converted(f: Field, value: Any) -> Any:
    """As :func:`convert` has it, without the field's name in the message: the place says it."""
    try:
        return convert(f, value)
    except ParameterError as error:
        raise ParameterError(str(error).removeprefix(f"{f.name}: ")) from error


def _scene(value: Any) -> str:
    if not isinstance(value, str) or not value:
        raise ParameterError(f"{value!r} is neither the name of a scene nor the path of a file")
    return value


def _lights(value: Any) -> int | None:
    # The range is the scene's own to say.
    plain = Field("lights", int, None, Param(None, None, "", "", False))
    return None if value is None else int(_converted(plain, value))


def _size(value: Any) -> tuple[int, int]:
    match = _SIZE.fullmatch(value.strip()) if isinstance(value, str) else None
    sides = match.groups() if match else value
    plain = Field("size", tuple[int, int], None, Param(None, None, "", "", False))
    try:
        width, height = _converted(plain, sides)
    except ParameterError as error:
        raise ParameterError(f'{value!r} is not a size, like "1280x720" or [1280, 720]') from error
    if min(width, height) < 1:
        raise ParameterError(f"a picture of {width}×{height} has no pixels")
    return int(width), int(height)


def _is_size(value: Any) -> bool:
    return isinstance(value, (list, tuple)) and len(value) == 2 and all(isinstance(side, int) for side in value)


def takes_list(tp: Any) -> bool:
    return get_origin(tp) is tuple or (get_origin(tp) in (Union, UnionType) and any(map(takes_list, get_args(tp))))


def _values(f: Field) -> Callable[[Any], tuple[Any, ...]]:
    """One value of a parameter, or a list of values; a grid of ``[64, 36, 32]`` or ``"64x36x32"`` is one value."""
    wide = takes_list(f.type)

    def one(value: Any) -> Any:
        if not (wide and isinstance(value, str) and re.search("[x×]", value)):
            return _converted(f, value)
        parts = re.split("[x×]", value)
        try:
            return _converted(f, parts)
        except ParameterError as error:
            raise ParameterError(str(error).replace(repr(parts), repr(value))) from error

    return _each(one, lambda items: wide and bool(items) and not any(isinstance(i, (list, tuple, str)) for i in items))


def _parameters_of(cls: type, name: str, values: Mapping[str, Any]) -> dict[str, tuple[Any, ...]]:
    """The values to try of each parameter of a technique."""
    declared = {f.name: f for f in fields_of(cls)}
    wrong = _Gathered()

    def check(parameter: str, value: Any) -> tuple[Any, ...]:
        if parameter not in declared:
            hint = nearest(parameter, declared) or (f"; it has {', '.join(declared)}" if declared else "; it has none")
            raise ParameterError(f"'{name}' has no parameter '{parameter}'{hint}")
        return _values(declared[parameter])(value)

    made = {p: wrong.at(p, partial(check, p), value) for p, value in values.items()}
    wrong.raise_any()
    return {p: v for p, v in made.items() if v is not None}


@dataclass(frozen=True)
class Choice:
    """A technique with the values to try of those of its parameters that were given with it."""

    name: str
    values: Mapping[str, tuple[Any, ...]]


def _choice(family: str) -> Callable[[Any], Choice]:
    def check(value: Any) -> Choice:
        if isinstance(value, str):
            FAMILIES[family].find(value)
            return Choice(value, {})
        if not isinstance(value, Mapping):
            raise ParameterError(f"{value!r} is neither the name of a technique nor an object")
        wrong = _Gathered()
        name = value.get("technique")
        if not isinstance(name, str):
            raise ParameterError("technique: is missing" if name is None else f"technique: {name!r} is not a text")
        wrong.at("technique", FAMILIES[family].find, name)
        wrong.raise_any()
        own = {p: v for p, v in value.items() if p != "technique"}
        return Choice(name, _parameters_of(MEMBERS[name], name, own))

    return check


def _parameters(value: Any) -> dict[str, dict[str, tuple[Any, ...]]]:
    wrong = _Gathered()

    def check(name: str, values: Any) -> dict[str, tuple[Any, ...]]:
        if name not in MEMBERS:
            raise ParameterError(f"no technique '{name}'{nearest(name, MEMBERS)}")
        return _parameters_of(MEMBERS[name], name, _object(values))

    made = {n: wrong.at(n, partial(check, n), values) for n, values in _object(value).items()}
    wrong.raise_any()
    return {n: v for n, v in made.items() if v is not None}


def _settings(judge: str, values: Mapping[str, Any]) -> Plain:
    """All declared settings of a judge, those of ``values`` changed. Where no time limit is given, it is that of a
    comparison: a thousand points must not wait for the first's truth without end."""
    wrong = _Gathered()
    defaults = MarchSettings() if judge == "march" else standard.default_settings(judge)
    known = {f.name: f for f in fields_of(type(defaults))}

    def check(name: str, value: Any) -> Any:
        if name not in known:
            raise ParameterError(f"no such setting{nearest(name, known)} (there are {', '.join(known)})")
        return _converted(known[name], value)

    changed = {name: wrong.at(name, partial(check, name), value) for name, value in values.items()}
    wrong.raise_any()
    return {name: changed.get(name, getattr(defaults, name)) for name in known}


def _truth(value: Any) -> Plain | None:
    """The judge with all of its settings; None for no errors."""
    given = {"judge": value} if value is None or isinstance(value, str) else dict(_object(value))
    judge = given.pop("judge", None) or "none"
    if judge not in JUDGES:
        raise ParameterError(f"no judge '{judge}'{nearest(str(judge), JUDGES)} (there are {', '.join(JUDGES)})")
    wrong = _Gathered()
    if judge == "none":
        for name in given:
            wrong.note(name, "is a setting of a judge, and the judge is 'none'")
        wrong.raise_any()
        return None
    made: Plain = {"judge": judge}
    if judge == "march" and "shadow" in given:
        chosen = wrong.at("shadow", _choice("shadow"), given.pop("shadow"))
        if chosen is not None and any(len(values) > 1 for values in chosen.values.values()):
            wrong.note("shadow", "a judge has one shadow technique")
        elif chosen is not None:
            one = {name: values[0] for name, values in chosen.values.items()}
            made["shadow"] = _plain(replace(MEMBERS[chosen.name](), one))
    made |= wrong.over(partial(_settings, judge), given) or {}
    wrong.raise_any()
    if judge != "march":
        standard.check("volumetric", judge, TruthSettings(**{f.name: made[f.name] for f in fields_of(TruthSettings)}))
    return made


def _single(name: str) -> Callable[[Any], Any]:
    (f,) = (f for f in fields_of(Measuring) if f.name == name)
    return partial(_converted, f)


class _Fields(BaseModel):
    """The fields of a product, but for a field of each family but the volumetric one."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    scenes: Annotated[Any, _checked(_each(_scene))] = ()
    lights: Annotated[Any, _checked(_each(_lights))] = (None,)
    sizes: Annotated[Any, _checked(_each(_size, _is_size))] = ((1280, 720),)
    techniques: Annotated[Any, _checked(_each(_choice("volumetric")))] = tuple(
        Choice(name, {}) for name in FAMILIES["volumetric"].members
    )
    parameters: Annotated[Any, _checked(_parameters)] = {}
    truth: Annotated[Any, _checked(_truth)] = None
    frames: Annotated[Any, _checked(_single("frames"))] = Measuring.frames
    warmup: Annotated[Any, _checked(_single("warmup"))] = Measuring.warmup
    seconds: Annotated[Any, _checked(_single("seconds"))] = Measuring.seconds
    seed: Annotated[Any, _checked(_single("seed"))] = Measuring.seed
    metrics: Annotated[Any, _checked(_single("metrics"))] = Measuring.metrics


_choices: dict[str, Any] = {
    family: (Annotated[Any, _checked(_each(_choice(family)))], (Choice(FAMILIES[family].default, {}),))
    for family in OTHERS
}
_Choices = pydantic.create_model("_Choices", __base__=_Fields, **_choices)


class _Part(_Choices):  # type: ignore[misc, valid-type]
    """One product. A field that is not given is that of the object around it, or has its default."""

    def inside(self, outer: _Part) -> _Part:
        """With what is not given here taken from ``outer``; parameters are joined technique by technique."""
        names = [name for name in _Part.model_fields if name in outer.model_fields_set | self.model_fields_set]
        values = {n: getattr(self if n in self.model_fields_set else outer, n) for n in names}
        joined = {**outer.parameters}
        for technique, own in self.parameters.items():
            joined[technique] = {**joined.get(technique, {}), **own}
        made: _Part = _Part.model_construct(set(names), **{**values, "parameters": joined})
        return made


class _Record(_Part):
    """The whole specification."""

    parts: tuple[_Part, ...] = ()

    def products(self) -> list[_Part]:
        """Its parts, each complete; itself where there are none."""
        return [part.inside(self) for part in self.parts] if self.parts else [self]


def _message(error: Any) -> str:
    """What pydantic found, in words."""
    kind, loc = error["type"], error["loc"]
    if kind == "extra_forbidden":
        known = _Part.model_fields if loc[0] == "parts" else _Record.model_fields
        return f"no such field{nearest(str(loc[-1]), known)}"
    if kind == "mistake":
        return str(error["ctx"]["message"])
    words = {"model_type": "is not an object", "tuple_type": "is not a list"}
    return words.get(kind, str(error["msg"]))


# --- what takes more than one field to see ------------------------------------------------------------------------


class _Scenes:
    """Scenes by name and number of lights, opened once."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._made: dict[tuple[str, int | None], tuple[Scene, str]] = {}

    def resolve(self, name: str) -> str:
        """The scene's name as a worker can use it: a path that does not depend on the working directory."""
        if bundled.named(name) is not None:
            return name
        return str(((self._folder or Path()) / name).absolute())

    def get(self, name: str, lights: int | None) -> tuple[Scene, str]:
        """The scene and its hash.

        Raises:
            ParameterError: no such scene, or not with so many lights.
            SceneError: its file is wrong.
        """
        key = (name, lights)
        if key not in self._made:
            resolved = self.resolve(name)
            scene = open_scene(resolved if Path(resolved).exists() else name, lights)
            self._made[key] = (scene, scene_hash(scene))
        return self._made[key]

    def mistakes(self, part: Mapping[str, Any]) -> Iterator[tuple[Location, str]]:
        """What is wrong with the scenes of a part as it was written; fields of another kind are passed over."""
        names, counts = _listed(part.get("scenes")), _listed(part.get("lights"))
        if part.get("scenes") is None:
            yield ("scenes",), "is missing"
        for i, name in names:
            if not isinstance(name, str) or not name:
                continue
            if counts and bundled.named(name) is None:  # a file that is wrong says more than that it has its own lights
                found = list(self._tried(name, None, ("scenes", *i), ("lights",)))
                yield from found
                if found:
                    continue
            for j, count in counts or [((), None)]:
                if isinstance(count, str) and count.isdecimal():
                    count = int(count)
                if count is not None and (isinstance(count, bool) or not isinstance(count, int)):
                    continue
                yield from self._tried(name, count, ("scenes", *i), ("lights", *j))

    def _tried(self, name: str, count: int | None, scene: Location, lights: Location) -> Iterator[tuple[Location, str]]:
        try:
            self.get(name, count)
        except SceneError as error:
            yield from ((scene, f"{name}: {line}") for line in error.mistakes)
        except ParameterError as error:
            text = str(error)
            yield lights if text.startswith("lights: ") else scene, text.removeprefix("lights: ")


def _listed(value: Any) -> list[tuple[Location, Any]]:
    """The items of a value or list of values, each with its place."""
    if value is None:
        return []
    return [((i,), item) for i, item in enumerate(value)] if isinstance(value, (list, tuple)) else [((), value)]


def _raw_parts(spec: Mapping[str, Any]) -> list[tuple[Location, Mapping[str, Any], Mapping[str, Any]]]:
    """The parts of a specification as it was written: each one's place, its own fields, and all of its fields."""
    outer = {name: value for name, value in spec.items() if name != "parts"}
    parts = spec.get("parts")
    if not isinstance(parts, (list, tuple)) or not parts:
        return [((), outer, outer)]
    return [(("parts", i), part, {**outer, **part}) for i, part in enumerate(parts) if isinstance(part, Mapping)]


def _undrawn(record: _Record) -> Iterator[tuple[Location, str]]:
    """Parameters of techniques that no product draws."""
    fields = ("techniques", *OTHERS)
    drawn = {choice.name for part in record.products() for field in fields for choice in getattr(part, field)}
    drawn.add(Marching.name)
    for loc, part in [((), record), *((("parts", i), part) for i, part in enumerate(record.parts))]:
        for name in part.parameters:
            if name not in drawn:
                yield (*loc, "parameters", name), f"'{name}' is not drawn here"


# --- the product --------------------------------------------------------------------------------------------------


def _expand(part: _Part, scenes: _Scenes) -> Iterator[Point]:
    """The points of one product, in order."""
    for name, lights in itertools.product(part.scenes, part.lights):
        scene, digest = scenes.get(name, lights)
        others = [list(_made(family, getattr(part, family), part.parameters, scene)) for family in OTHERS]
        volumetric = list(_made("volumetric", part.techniques, part.parameters, scene))
        rays = list(_marched(part.parameters.get(Marching.name, {}), scene))
        for size, *stage, marching, technique in itertools.product(part.sizes, *others, rays, volumetric):
            description = {
                "scene": scenes.resolve(name),
                "lights": len(scene.lights),
                "size": list(size),
                **{family: _plain(made) for family, made in zip(OTHERS, stage, strict=True)},
                **({Marching.name: marching} if marching else {}),
                "technique": _plain(technique),
                "truth": part.truth,
                **{f.name: getattr(part, f.name) for f in fields_of(Measuring)},
            }
            yield Point(description, digest, _refusal([*stage, technique], scene))


def _made(
    family: str, choices: Sequence[Choice], parameters: Mapping[str, Mapping[str, tuple[Any, ...]]], scene: Scene
) -> Iterator[Technique]:
    """The techniques of a family: every choice with every combination of its parameters' values."""
    for choice in choices:
        values = {**parameters.get(choice.name, {}), **choice.values}
        for combination in itertools.product(*values.values()):
            yield make(family, choice.name, scene, {choice.name: dict(zip(values, combination, strict=True))})


def _marched(values: Mapping[str, tuple[Any, ...]], scene: Scene) -> Iterator[Plain]:
    """How rays are marched: every combination of the parameters that are given; nothing where none is, or where there
    is nothing to march through."""
    if not values or not scene.implicits:
        yield {}
        return
    for combination in itertools.product(*values.values()):
        marching = Marching.of(scene.looks, dict(zip(values, combination, strict=True)))
        yield {f.name: getattr(marching, f.name) for f in fields_of(Marching)}


def _refusal(techniques: Sequence[Technique], scene: Scene) -> str | None:
    for technique in techniques:
        try:
            technique.supports(scene)
        except Unsupported as error:
            return str(error)
    return None


def _plain(technique: Technique) -> Plain:
    """A technique as JSON has it: tuples are lists."""
    plain: Plain = json.loads(json.dumps(describe(technique)))
    return plain


def _once(pairs: list[tuple[str, Any]]) -> Plain:
    """A JSON object whose fields are given once: of two, one would be lost in silence."""
    made = dict(pairs)
    if len(made) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ParameterError(f"the field '{twice}' is given twice in one object")
    return made
