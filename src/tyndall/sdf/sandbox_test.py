"""What a snippet may not be is refused where it stands, and what it may be means the same afterwards."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from tyndall.sdf import sandbox
from tyndall.sdf.sandbox import Origin, SnippetError, admit

GOOD = """
// A comment with loop { and @attributes
const K = 0.5; /* one /* in another */ */
struct Pair { length: f32, sides: array<f32, 2> }
fn helper(p: vec3f, pair: ptr<function, Pair>) -> f32 {
    (*pair).sides[1] += length(p);
    return (*pair).sides[1];
}
fn shape(p: vec3f, radius: f32) -> f32 {
    var pair = Pair(radius, array<f32, 2>(0.0, 1.0));
    for (var i = 0; i < 3; i++) {
        if p.x < 0.0 && (p.y < 1.0 || p.z < 2.0) { continue; }
        pair.length += K;
    }
    let _unused = helper(p, &pair);
    return pair.length;
}
"""


def refused(text: str, given: dict[str, str] | None = None) -> str:
    with pytest.raises(SnippetError) as error:
        admit(text, Origin("x"), given=given, example="fn f()")
    assert "\n" not in str(error.value)
    return str(error.value)


def test_a_good_one_keeps_its_lines_and_gets_a_prefix() -> None:
    admitted = admit(GOOD, Origin("x"), example="")
    assert [f.name for f in admitted.functions] == ["helper", "shape"]
    assert admitted.functions[1].parameters == (("p", "vec3f"), ("radius", "f32"))
    assert admitted.wesl.count("\n") == GOOD.count("\n")
    assert "comment" not in admitted.wesl
    assert "@" not in admitted.wesl
    own = "helper|shape|Pair|K|radius|pair|_unused|p|i"
    assert not re.search(rf"(?<![\w.])(?:{own})\b", admitted.wesl)
    assert ".length" in admitted.wesl  # members keep their names


def test_two_never_meet() -> None:
    a, b = (admit(f"fn f(p: vec3f) -> f32 {{ return {x}; }}", Origin("x"), example="") for x in (1.0, 2.0))
    assert a.prefix != b.prefix
    assert admit(a.text, Origin("y"), example="").wesl == a.wesl


@pytest.mark.parametrize(
    ("text", "where", "message"),
    [
        ("@compute @workgroup_size(1) fn main() {}", "1:1", "no attributes"),
        ("fn f(@builtin(x) a: u32) {}", "1:6", "no attributes"),
        ("var<private> a: f32;", "1:1", "no variables outside"),
        ("@group(0) @binding(0) var<storage> a: array<f32>;", "1:1", "no attributes"),
        ("import package::bindings::a;", "1:15", "of other modules"),
        ("import a;", "1:1", "imports nothing"),
        ("enable f16;", "1:1", "enables nothing"),
        ("requires a;", "1:1", "requires nothing"),
        ("override a: f32;", "1:1", "no overrides"),
        ("alias F = f32;", "1:1", "no aliases"),
        ("diagnostic(off, derivative_uniformity);", "1:1", "no diagnostics"),
        ("fn f() {\n  let a = package::bindings::x;\n}", "2:18", "of other modules"),
        ("fn f() {\n  let a = implicit_cells[0];\n}", "2:11", "no such name: 'implicit_cells'"),
        ("fn f() {\n  let a = lenght(1.0);\n}", "2:11", "did you mean 'length'"),
        ("fn f(p: vec3f) { { let implicit_cells = 1; } let a = implicit_cells; }", "1:54", "cannot find"),
        ("fn f() { storageBarrier(); }", "1:10", "may not be used"),
        ("fn f() { let a = textureLoad(x, vec2u(0), 0); }", "1:18", "may not be used"),
        ("fn f() -> f32 { return dpdx(1.0); }", "1:24", "may not be used"),
        ("fn f(a: ptr<storage, f32>) {}", "1:13", "may not be used"),
        ("fn f() { var<private> a = 1.0; }", "1:10", "no address space"),
        ("fn f() { discard; }", "1:10", "may not be used"),
        ("fn f() { let length = 1.0; }", "1:14", "WGSL's own"),
        ("fn vec3f() {}", "1:4", "WGSL's own"),
        ("fn f() {} fn f() {}", "1:14", "declared twice"),
        ("fn f() { let a = length; }", "1:18", "is not called"),
        ("fn f() { fn g() {} }", "1:10", "inside a function"),
        ("fn f() { return f(); }", "1:1", "calls itself"),
        ("fn f() -> f32 { return 1.0 }", "1:28", "unexpected token"),
        ("fn f( { }", "1:10", "')' is missing"),
        ("fn f(1) { }", "1:6", "name of a parameter"),
        ("fn f() {", "1:9", "'}' is missing"),
        ("fn f() { ) }", "1:10", "closes nothing"),
        ("fn f() {} /* a", "1:11", "no end"),
        ("fn f() { let ä = 1; }", "1:14", "no character of WGSL"),
        ("", "1:1", "at least one function"),
        ("const a = 1;", "1:13", "at least one function"),
        ("fn f() { var a: array<f32, 65>; }", "1:28", "at most 64 elements"),
        ("const N = 9; fn f() { var a: array<f32, N>; }", "1:30", "a number"),
        ("fn f() { var a: array<array<f32, 9>, 9>; }", "1:17", "holds numbers"),
        ("struct A { a: array<f32, 9> } struct B { a: A }", "1:45", "own types"),
        ("fn f() { loop { continuing { loop {} } } }", "1:30", "inside 'continuing'"),
        ("fn f() -> f32 { return " + "(" * 40 + "1.0" + ")" * 40 + "; }", "1:55", "nested more than 32"),
        ("fn f() -> f32 { return " + "- " * 40 + "1.0; }", "1:88", "nested more than 32"),
        ("fn f(p: vec3f) { let a = p.x" + " < p.x" * 9 + "; }", "1:78", "more than 8 times '<'"),
        ("fn f() { return; }" + " " * sandbox.BYTES, "1:1", "at most 16384"),
        ("\n".join(f"fn a{i}() {{}}" for i in range(65)), "65:1", "at most 64 functions"),
    ],
)
def test_refused_where_it_stands(text: str, where: str, message: str) -> None:
    told = refused(text)
    assert message in told
    assert told.startswith(f"x:{where}: "), told


def test_calls_that_grow_tenfold_are_counted() -> None:
    """What no loop does, a chain of calls can: compilers inline them all."""
    bomb = "fn g0(x: f32) -> f32 { return x; }\n" + "\n".join(
        f"fn g{i}(x: f32) -> f32 {{ return {'+'.join([f'g{i - 1}(x)'] * 10)}; }}" for i in range(1, 30)
    )
    assert "words once its calls are inlined" in refused(bomb)


def test_a_name_of_the_host() -> None:
    assert "'Data' is the host's already" in refused("struct Data { a: f32 }", {"Data": "the host's"})
    admitted = admit("fn f(a: Data) -> f32 { return a.x; }", Origin("x"), given={"Data": "the host's"}, example="")
    assert f"{admitted.prefix}Data" in admitted.wesl


@pytest.mark.parametrize(
    ("text", "language"),
    [
        # Algorithm 11 of the document, and what others write.
        ("float sdHexPrism(vec3 p, Primitive3D primitive) {\n float2 h = float2(primitive.data[0], 1.0); }", "Slang"),
        ("float3 shade(FragmentProperties properties) { return lerp(_Color1, _Color2, _Blend); }", "Slang"),
        ("fn f(p: vec3f) -> f32 { return lerp(1.0, 2.0, 0.5); }", "Slang"),
        ("float sdf(vec3 p) { return length(p) - 1.0; }", "GLSL"),
        ("#version 450\nvoid main() {}", "GLSL"),
        ("fn f(p: vec3f) -> f32 { mat3 m = mat3(1.0); return 1.0; }", "GLSL"),
        ("def f(p):\n    return 1", "Python"),
    ],
)
def test_another_language_is_named(text: str, language: str) -> None:
    told = refused(text)
    assert f"looks like {language}" in told
    assert "WGSL" in told


def test_place_in_a_json_string() -> None:
    r"""Escapes are several characters of the file and one of the snippet; \u and pairs of it too."""
    code = 'fn f() { // "ä𝄞"\n\tlet a = banana;\n}'
    file = '{\n  "name": "x",\n  "code": ' + json.dumps(code) + "\n}"
    start = file.index('"fn') + 1
    with pytest.raises(SnippetError) as error:
        admit(code, Origin("x.json", file, start, escaped=True), example="")
    column = file.splitlines()[2].index("banana") + 1
    assert str(error.value).startswith(f"x.json:3:{column}: no such name: 'banana'")


_PIECES = (
    "fn let var const struct loop { } ( ) [ ] < > ; , : . -> :: @ @compute var<storage> implicit_cells package import "
    "/* */ // p x vec3f array<f32,4> 1.0 2u = + - * & && return if for while continuing break switch case default"
)
BITS = _PIECES.split()


def test_whatever_is_written_the_host_is_not_named() -> None:
    """Texts made of pieces of a good one and of what may not be in one: refused, or all its names are its own."""
    random = np.random.default_rng(1)
    pieces = re.findall(r"\w+|\s+|[^\w\s]", GOOD)
    admitted_count, told = 0, []
    for _ in range(500):
        text = list(pieces)
        for _ in range(random.integers(1, 4)):
            at = int(random.integers(len(text)))
            kind = random.integers(3)
            if kind == 0:
                del text[at]
            elif kind == 1:
                text.insert(at, f" {BITS[random.integers(len(BITS))]} ")
            else:
                text[at] = text[int(random.integers(len(text)))]
        try:
            admitted = admit("".join(text), Origin("x"), example="")
        except SnippetError as error:
            told.append(str(error))
            continue
        admitted_count += 1
        names = re.findall(r"(?<![\w.])[A-Za-z_]\w*", re.sub(r"\.\s+", ".", admitted.wesl))
        members = {"length", "sides"}
        assert all(n in sandbox._OWN | members or n.startswith(admitted.prefix) for n in names), admitted.wesl
        loops = len(re.findall(r"\b(?:loop|while|for)\b", admitted.wesl))
        assert admitted.wesl.count("-= 1u;") == loops
    assert all(re.fullmatch(r"x:\d+:\d+: [^\n]+", line) for line in told)
    assert admitted_count > 20
