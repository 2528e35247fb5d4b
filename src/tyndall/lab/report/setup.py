"""What a comparison was made with, how to make it again, and what its words mean."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from tyndall.lab.report import verdict
from tyndall.lab.report.markup import Html, join, tag
from tyndall.lab.report.results import Reference, Study

_LONG = 44  # characters; a longer fact has two columns


def setup(study: Study, prefix: str) -> Html:
    """The command, scene, device, versions, truth and parameters."""
    width, height = study.size
    facts: list[tuple[str, str | Html]] = [("Scene", study.scene), ("Picture", f"{width}×{height} pixels")]
    if study.triangles is not None:
        facts.append(("Triangles", f"{study.triangles:,}"))
    if study.scene_hash:
        facts.append(("Scene’s hash (SHA-256)", tag("code", study.scene_hash)))
    facts.append(("Adapter", study.adapter))
    if study.driver:
        facts.append(("Driver", study.driver))
    if study.versions:
        facts.append(("Versions", ", ".join(f"{name} {version}" for name, version in study.versions.items())))
    truth = None
    if study.reference:
        known = study.reference
        pairs: list[tuple[str, str | Html]] = [("Judge", known.judge)]
        pairs += [("Effort", text) for text in effort(known)]
        if known.seconds is not None:
            pairs.append(("Time", f"{verdict.significant(known.seconds, 3)} s"))
        pairs += [
            (f"Standard error, {verdict.kind_name(kind)}", verdict.percent(noise))
            for kind, noise in known.relative_error.items()
            if noise
        ]
        pairs += [(key.replace("_", " "), _value(value)) for key, value in known.other.items()]
        truth = join(tag("h3", "Truth"), facts_list(pairs, "facts"))
    chosen = study.parameters.get(study.family)
    techniques = chosen if isinstance(chosen, dict) else {}
    shared = {k: v for k, v in study.parameters.items() if k != study.family}
    command = None
    if study.command:
        command = tag(
            "div",
            tag("pre", tag("code", study.command)),
            tag("button", "Copy", type="button", class_="copy script", aria_label="Copy the command"),
            class_="command",
        )
    return tag(
        "section",
        tag("h2", "Setup"),
        tag("h3", "Reproduce"),
        command or tag("p", "The command was not recorded.", class_="note"),
        facts_list(facts, "facts"),
        truth,
        tag("h3", "Parameters"),
        *(_parameters(name, value) for name, value in techniques.items()),
        *(_parameters(name, value) for name, value in shared.items()),
        *(
            join(tag("h3", title), facts_list(list(reasons.items()), "glossary"))
            for title, reasons in (("Left out", study.skipped), ("Without errors", study.missing))
            if reasons
        ),
        id=f"{prefix}-setup",
        class_="setup",
    )


def effort(truth: Reference) -> list[str]:
    """How much work a truth is, in words: a march has steps, everything else samples."""
    if "steps" in truth.other:
        return [f"{truth.other['steps']} steps a pixel"]
    return [f"{truth.samples:,} samples a pixel"] if truth.samples else []


def _parameters(name: str, value: Any) -> Html:
    if not isinstance(value, Mapping):
        return tag("details", tag("summary", name.replace("_", " "), " ", tag("small", _value(value))))
    words = ", ".join(f"{k} {_value(v)}" for k, v in value.items() if k != "technique")
    chosen = value.get("technique")
    head = name if chosen in (None, name) else f"{name}: {chosen}"
    return tag(
        "details",
        tag("summary", head, " ", tag("small", words)),
        facts_list([(str(k), _value(v)) for k, v in value.items()], "facts"),
    )


def glossary() -> Html:
    """A line for each word that a reader may not know."""
    pairs = [(verdict.kind_name(kind), text) for kind, text in verdict.KIND_MEANINGS.items()]
    pairs += [(m.name, m.meaning) for m in verdict.METRICS]
    pairs += [
        (
            "GPU ms",
            "Time of the technique’s own passes by timestamp queries, so without the host: median of the frames.",
        ),
        ("host ms", "Time to encode and submit a frame on the CPU."),
        ("memory", "Bytes that the technique itself holds on the device, from the ledger of all resources."),
        ("truth’s standard error", "Root mean square of the standard error of its pixels over its mean."),
        ("Pareto front", "The techniques that no other beats in time without losing in error."),
        ("error map", "Per pixel: root mean square over the channels of the difference, over the truth’s mean."),
    ]
    return tag("section", tag("h2", "Glossary"), facts_list(pairs, "glossary"), id="glossary")


def _value(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list):
        return ", ".join(_value(v) for v in value)
    if isinstance(value, dict):
        return ", ".join(f"{key} {_value(v)}" for key, v in value.items())
    return json.dumps(value)


def facts_list(pairs: Sequence[tuple[str, str | Html]], kind: str) -> Html:
    """Pairs of a name and a value; ``kind`` is their look."""
    rows = (
        tag("div", tag("dt", name), tag("dd", value), class_="long" if len(value) > _LONG else None)
        for name, value in pairs
    )
    return tag("dl", *rows, class_=kind)
