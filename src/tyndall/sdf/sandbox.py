"""What a user's piece of WGSL may be: a few functions, constants and structs, and nothing of the host's.

A snippet comes from a file that nobody has looked at, so it is not trusted. It is taken apart into words here, before
a compiler sees it, and put together again:

- It declares functions, module constants and structs only. Attributes, imports, module variables, entry points,
  textures, atomics, barriers and derivatives are refused; so is every name that is neither WGSL's own nor declared in
  the snippet, which leaves no way to name a binding.
- Its own names are given a prefix that depends on its text, so that two snippets never meet.
- Each loop counts its rounds. A snippet that has turned :data:`ROUNDS` times in one evaluation returns zero, and in
  the same invocation it turns no more. So an endless loop costs a picture some time, and not the device.
- Length, nesting, number of functions, size of arrays and the size after inlining have limits: compilers recurse,
  inline all calls, and a chain of functions that each call the last one ten times is 10ⁿ.

A mistake is a :class:`SnippetError` with the file, line and column where it stands: :class:`Origin` knows where in a
Python or JSON file the snippet's characters are.
"""

from __future__ import annotations

import bisect
import hashlib
import itertools
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NoReturn

from tyndall.gpu.params import nearest
from tyndall.gpu.shader import Linker, ShaderError

BYTES = 16 << 10
NESTING = 32
FUNCTIONS = 64
LESS = 8
ARRAY = 64  # elements
EXPANDED = 1 << 14  # words, all calls inlined; a loop counts as LOOP of them
LOOP = 256
ROUNDS = 1024  # of all loops together, in one evaluation


class SnippetError(ValueError):
    """A snippet that is refused or does not compile; the message is one line that begins ``file:line:column``."""


# --- where a snippet stands ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Origin:
    """Where the characters of a snippet are.

    Attributes:
        file: name of the file, or any other name of the place.
        text: of the file; empty where the snippet itself is all there is.
        start: offset in ``text`` of the snippet's first character.
        escaped: the snippet is a JSON string there.
    """

    file: str
    text: str = ""
    start: int = 0
    escaped: bool = False

    def place(self, snippet: str, offset: int) -> str:
        """``file:line:column`` of the character at ``offset`` of the snippet, counted from 1."""
        text, at = (self.text, self.start) if self.text else (snippet, 0)
        if self.escaped:
            done = 0
            while done < offset and at < len(text):
                step = _ESCAPE.match(text, at)
                at, done = (step.end(), done + 1) if step else (at + 1, done + 1)
        else:
            at += offset
        line = text.count("\n", 0, at) + 1
        return f"{self.file}:{line}:{at - (text.rfind('\n', 0, at) + 1) + 1}"


_ESCAPE = re.compile(r"\\u[dD][89abAB][0-9a-fA-F]{2}\\u[dD][c-fC-F][0-9a-fA-F]{2}|\\u[0-9a-fA-F]{4}|\\.")


# --- words --------------------------------------------------------------------------------------------------------

_WORD = re.compile(
    r"(?P<space>[ \t\r\n]+)|(?P<line>//[^\n]*)|(?P<block>/\*)"
    r"|(?P<number>0[xX][0-9a-fA-F]*(?:\.[0-9a-fA-F]*)?(?:[pP][+-]?\d+)?[iufh]?"
    r"|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?[iufh]?)"
    r"|(?P<name>[A-Za-z_]\w*)"
    r"|(?P<sign>->|::|[-+*/%&|^=!<>]=|&&|\|\||\+\+|--|[-+*/%&|^=!<>~.,:;()\[\]{}@#?\"'\\])",
    re.ASCII,
)
_BLOCK = re.compile(r"/\*|\*/")


@dataclass(frozen=True)
class Word:
    """A word of a snippet and its offset. ``kind``: "name", "number" or "sign"."""

    kind: str
    text: str
    at: int


def words(text: str) -> list[Word]:
    """The words of WGSL, without comments (block comments nest) and white space.

    Raises:
        _RefusedError: a character that WGSL does not have, or a comment without end.
    """
    found, at = [], 0
    while at < len(text):
        match = _WORD.match(text, at)
        if match is None:
            raise _RefusedError(at, f"{text[at]!r} is no character of WGSL")
        kind, end = str(match.lastgroup), match.end()
        if kind == "block":
            depth = 1
            while depth:
                mark = _BLOCK.search(text, end)
                if mark is None:
                    raise _RefusedError(at, "this comment has no end")
                depth, end = depth + (1 if mark.group() == "/*" else -1), mark.end()
        elif kind not in ("space", "line"):
            found.append(Word(kind, match.group(), at))
        at = end
    return found


class _RefusedError(Exception):
    def __init__(self, at: int, message: str) -> None:
        self.at, self.message = at, message


# --- what WGSL has ------------------------------------------------------------------------------------------------

_KEYWORD_TEXT = (
    "let var const if else loop while for switch case default break continue continuing return true false fn struct "
    "bitcast _"
)
_MODULE_TEXT = "alias const_assert diagnostic discard enable import override package requires super"
_TYPES = frozenset(
    ["bool", "f32", "i32", "u32", "array", "ptr", "function"]
    + [f"vec{n}{s}" for n in "234" for s in ("", "f", "i", "u")]
    + [f"mat{c}x{r}{s}" for c in "234" for r in "234" for s in ("", "f")]
)
_FUNCTION_TEXT = (
    "all any select abs acos acosh asin asinh atan atanh atan2 ceil clamp cos cosh countLeadingZeros countOneBits "
    "countTrailingZeros cross degrees determinant distance dot dot4U8Packed dot4I8Packed exp exp2 extractBits "
    "faceForward firstLeadingBit firstTrailingBit floor fma fract frexp insertBits inverseSqrt ldexp length log log2 "
    "max min mix modf normalize pow quantizeToF16 radians reflect refract reverseBits round saturate sign sin sinh "
    "smoothstep sqrt step tan tanh transpose trunc pack4x8snorm pack4x8unorm pack2x16snorm pack2x16unorm "
    "pack2x16float unpack4x8snorm unpack4x8unorm unpack2x16snorm unpack2x16unorm unpack2x16float"
)
_KEYWORDS, _FUNCTIONS = frozenset(_KEYWORD_TEXT.split()), frozenset(_FUNCTION_TEXT.split())
_RESERVED = frozenset(_MODULE_TEXT.split())
_OWN = _KEYWORDS | _TYPES | _FUNCTIONS
_FORBIDDEN = re.compile(
    r"texture\w*|sampler\w*|atomic\w*|\w*Barrier|dpd[xy]\w*|fwidth\w*|subgroup\w*|quad\w*|arrayLength|"
    r"workgroupUniformLoad|storage|uniform|workgroup|private|discard"
)
_NOT_HERE = {
    "var": "a snippet has no variables outside its functions",
    "import": "a snippet imports nothing",
    "enable": "a snippet enables nothing",
    "requires": "a snippet requires nothing",
    "diagnostic": "a snippet sets no diagnostics",
    "override": "a snippet has no overrides",
    "alias": "a snippet has no aliases",
}

# --- other languages ----------------------------------------------------------------------------------------------

_HLSL = re.compile(
    r"(?:float|half|int|uint|bool|double)[1-4](?:x[1-4])?|lerp|frac|rsqrt|mul|ddx|ddy|atan2f|cbuffer|tbuffer|SV_\w+"
)
_GLSL = re.compile(r"gl_\w+|mod|inversesqrt|dFd[xy]|[iub]vec[234]|mat[234]|precision|highp|mediump|lowp|varying")
_C_TYPES = re.compile(
    r"void|float|double|half|int|uint|bool|[iubd]?vec[234]|mat[234](?:x[234])?|(?:float|half|int|uint|bool)[1-4]\w*"
)


def _language(tokens: list[Word]) -> tuple[Word, str] | None:
    """The word that shows that a snippet is in another language, and that language's name."""
    declared = {b.text for a, b in itertools.pairwise(tokens) if a.text in ("fn", "let", "var", "const")}
    slang: Word | None = None
    other: Word | None = None
    for i, word in enumerate(tokens):
        before = tokens[i - 1].text if i else ""
        after = tokens[i + 1] if i + 1 < len(tokens) else None
        if word.text == "#" or (word.text in ("def", "lambda") and after and after.kind == "name"):
            return word, "GLSL" if word.text == "#" else "Python"
        if word.kind != "name" or before == "." or word.text in declared:
            continue
        called = after is not None and after.text == "("
        c_style = after is not None and after.kind == "name" and bool(_C_TYPES.fullmatch(word.text))
        if _HLSL.fullmatch(word.text) and (called or c_style or word.text[-1].isdigit()):
            slang = slang or word
        elif c_style or (_GLSL.fullmatch(word.text) and (called or c_style)):
            other = other or word
        elif word.text in ("Primitive3D", "FragmentProperties") and after is not None and after.kind == "name":
            slang = slang or word
    found = [word for word in (slang, other) if word is not None]
    if not found:
        return None
    return min(found, key=lambda word: word.at), "GLSL" if slang is None else "Slang or HLSL"


# --- taking apart and putting together ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Function:
    """A function of a snippet: its parameters' names and types, and the type it gives ("" where none), in WGSL."""

    name: str
    parameters: tuple[tuple[str, str], ...]
    result: str
    at: int = field(compare=False, default=0)


@dataclass(frozen=True)
class Admitted:
    """A snippet that may run.

    Attributes:
        wesl: its functions with prefixed names and counted loops; lines are those of the snippet.
        prefix: of all names.
        functions: what it declares, in its own names and order.
    """

    text: str
    origin: Origin
    wesl: str
    prefix: str
    functions: tuple[Function, ...]
    marks: tuple[tuple[int, int], ...]

    def error(self, at: int, message: str) -> SnippetError:
        """A mistake at an offset of the snippet."""
        return SnippetError(f"{self.origin.place(self.text, at)}: {message}")

    @property
    def rounds(self) -> str:
        """The private variable that holds how many rounds its loops may still turn; the host declares it."""
        return f"{self.prefix}0rounds"

    @property
    def entry(self) -> str:
        """The name of the function that the host puts before the snippet's own."""
        return f"{self.prefix}0"

    @cached_property
    def _line_starts(self) -> list[int]:
        return [0, *(i + 1 for i, c in enumerate(self.wesl) if c == "\n")]

    def source(self, line: int, column: int) -> int:
        """The offset in the snippet of a line and column (from 1) of :attr:`wesl`."""
        line = min(max(line, 1), len(self._line_starts))
        at = self._line_starts[line - 1] + column - 1
        index = bisect.bisect_right(self.marks, (at, 1 << 62)) - 1
        return self.marks[max(index, 0)][1] if self.marks else 0

    def clean(self, message: str) -> str:
        """A compiler's message in the snippet's own names, on one line."""
        return " ".join(re.sub(rf"(?:package_\w*?)?{self.prefix}", "", message).split())


def refuse(text: str, origin: Origin, at: int, message: str) -> NoReturn:
    """Raise the :class:`SnippetError` of an offset."""
    raise SnippetError(f"{origin.place(text, at)}: {message}")


def admit(text: str, origin: Origin, *, given: Mapping[str, str] | None = None, example: str) -> Admitted:
    """Check a snippet and rewrite it; see the module.

    Args:
        text: WGSL.
        origin: where it stands.
        given: names that the host declares for it, and what they are in words; they get the prefix as well.
        example: a signature to show to whoever wrote it in another language.

    Raises:
        SnippetError: it is refused, or its grammar is wrong.
    """
    given = given or {}
    size = len(text.encode("utf-8", "surrogatepass"))
    if size > BYTES:
        refuse(text, origin, 0, f"{size} bytes; a snippet has at most {BYTES}")
    try:
        tokens = words(text)
        if found := _language(tokens):
            word, language = found
            raise _RefusedError(word.at, f"this looks like {language} ('{word.text}'); snippets are in WGSL: {example}")
        digest = hashlib.blake2b(
            "\0".join([text, *given, *given.values()]).encode("utf-8", "surrogatepass"), digest_size=8
        ).hexdigest()
        reader = _Reader(tokens, f"s{digest}x", given)
        reader.module()
    except _RefusedError as refused:
        refuse(text, origin, refused.at, refused.message)
    wesl, marks = _assemble(text, tokens, reader)
    admitted = Admitted(text, origin, wesl, reader.prefix, tuple(reader.functions), marks)
    _check_grammar(admitted, given)
    return admitted


def _assemble(text: str, tokens: list[Word], reader: _Reader) -> tuple[str, tuple[tuple[int, int], ...]]:
    """The text with renamed words and what is inserted after some; comments are gone, and lines stay."""
    parts: list[str] = []
    marks: list[tuple[int, int]] = []
    size = end = 0
    for i, word in enumerate(tokens):
        gap = text[end : word.at]
        space = "\n" * gap.count("\n") or (" " if gap else "")
        shown = reader.renamed.get(i, word.text) + reader.inserted.get(i, "")
        marks.append((size + len(space), word.at))
        parts += [space, shown]
        size += len(space) + len(shown)
        end = word.at + len(word.text)
    return "".join([*parts, "\n"]), tuple(marks)


def _check_grammar(admitted: Admitted, given: Mapping[str, str]) -> None:
    """The linker's parser reads it, which needs no device; types are the driver's to check."""
    module = "package::snippet"
    names = "".join(f"const {admitted.prefix}{name} = 0;\n" for name in given)
    text = f"{admitted.wesl}{names}var<private> {admitted.rounds}: u32;\n"
    try:
        Linker({module: text}, {module: "snippet"}).link(
            module, tuple(admitted.prefix + f.name for f in admitted.functions), "", {}, {}
        )
    except ShaderError as error:
        where, _, message = str(error).splitlines()[0].partition(": ")
        line, column = (int(n) for n in where.rsplit(":", 2)[1:])
        message = admitted.clean(message.partition(", expected")[0])
        raise admitted.error(admitted.source(line, column), message) from None


class _Reader:
    """One walk over the words of a snippet: what is declared, named, called, nested, and where its loops begin."""

    def __init__(self, tokens: list[Word], prefix: str, given: Mapping[str, str]) -> None:
        self.tokens, self.prefix, self.given = tokens, prefix, given
        self.functions: list[Function] = []
        self.renamed: dict[int, str] = {}
        self.inserted: dict[int, str] = {}
        self._at = 0
        self._structs: set[str] = set()
        self._module_names: set[str] = set()
        self._members: set[int] = set()
        self._calls: dict[str, list[str]] = {}
        self._sizes: dict[str, int] = {}
        self._declared = self._declarations()

    # words

    def _peek(self, ahead: int = 0) -> str:
        i = self._at + ahead
        return self.tokens[i].text if i < len(self.tokens) else ""

    def _stop(self, message: str, index: int | None = None) -> NoReturn:
        i = self._at if index is None else index
        word = self.tokens[min(i, len(self.tokens) - 1)] if self.tokens else Word("sign", "", 0)
        at = word.at if i < len(self.tokens) else word.at + len(word.text)
        raise _RefusedError(at, message)

    def _expect(self, text: str) -> None:
        if self._peek() != text:
            self._stop(f"'{text}' is expected" + (f", not '{self._peek()}'" if self._peek() else " before the end"))
        self._at += 1

    def _name(self, what: str) -> str:
        if self._at >= len(self.tokens) or self.tokens[self._at].kind != "name":
            self._stop(f"the name of {what} is expected")
        self._at += 1
        return self.tokens[self._at - 1].text

    # names

    def _declarations(self) -> set[str]:
        """All names that are declared anywhere in the snippet: each gets the prefix, wherever it is used."""
        names: set[str] = set(self.given)
        for i, word in enumerate(self.tokens[:-1]):
            following = self.tokens[i + 1]
            if word.text in ("fn", "let", "var", "const", "struct") and following.kind == "name":
                names.add(following.text)
            # A parameter: a name before a colon, other than `case x:` and `default:`.
            before = self.tokens[i - 1].text if i else ""
            if word.kind == "name" and following.text == ":" and before in ("(", ","):
                names.add(word.text)
        return names - {"_"}

    def _check_declared(self, index: int) -> None:
        name = self.tokens[index].text
        if name in _OWN or name in _RESERVED:
            self._stop(f"'{name}' is WGSL's own; another name is needed", index)
        if _FORBIDDEN.fullmatch(name):
            self._stop(f"'{name}' is no name for a snippet's own", index)
        if name in self.given:
            self._stop(f"'{name}' is {self.given[name]} already", index)

    def _rename(self, index: int) -> None:
        """A word that is used: the snippet's own gets the prefix; what is neither that nor WGSL's is refused."""
        word = self.tokens[index]
        if word.kind != "name" or index in self._members:
            return
        name = word.text
        after = self.tokens[index + 1].text if index + 1 < len(self.tokens) else ""
        if name in self._declared:
            self.renamed[index] = self.prefix + name
        elif _FORBIDDEN.fullmatch(name):
            self._stop(f"'{name}' may not be used in a snippet", index)
        elif name in ("fn", "struct"):
            self._stop(f"'{name}' stands inside a function", index)
        elif name in _FUNCTIONS and after != "(":
            self._stop(f"'{name}' is a function, and is not called here", index)
        elif name not in _OWN:
            self._stop(f"no such name: '{name}'{nearest(name, [*self._declared, *_FUNCTIONS, *_TYPES])}", index)

    # grammar

    def module(self) -> None:
        """The whole snippet."""
        self._check_signs()
        while self._at < len(self.tokens):
            start, word = self._at, self._peek()
            if word == ";":
                self._at += 1
            elif word == "fn":
                self._function()
            elif word == "const":
                self._declare("a constant")
                self._span(";")
            elif word == "struct":
                self._struct()
            elif word in _NOT_HERE:
                self._stop(_NOT_HERE[word])
            else:
                self._stop(f"'fn', 'const' or 'struct' is expected, not '{word}'", start)
        if not self.functions:
            self._stop("a snippet has at least one function")
        self._check_size()

    def _check_signs(self) -> None:
        """What no place of a snippet may have, and how deep brackets are."""
        closing = {"(": ")", "[": "]", "{": "}"}
        open_: list[str] = []
        less = [0]  # how many < are open in each bracket: parsers try them as templates, and again inside of each
        unary = 0
        for i, word in enumerate(self.tokens):
            if word.text == "@":
                self._stop("a snippet has no attributes", i)
            if word.text == "::":
                self._stop("a snippet names nothing of other modules", i)
            if word.text in ('"', "'", "#", "?", "\\"):
                self._stop(f"{word.text} is no sign of WGSL", i)
            if word.text in closing:
                open_.append(closing[word.text])
            elif word.text in closing.values() and (not open_ or open_.pop() != word.text):
                self._stop(f"'{word.text}' closes nothing", i)
            unary = unary + 1 if word.text in "-!~&*" or word.text in ("&&", "--") else 0
            if len(open_) > NESTING or unary > NESTING:
                self._stop(f"nested more than {NESTING} deep", i)
            if word.text in "([{":
                less.append(0)
            elif word.text in ")]}" and len(less) > 1:
                less.pop()
            if word.text in (";", "{", "}", "&&", "||"):
                less[-1] = 0
            elif word.text in ("<", "<=", "<<="):
                less[-1] += 1
            elif word.text == ">" and less[-1]:
                less[-1] -= 1
            if sum(less) > LESS:
                self._stop(f"more than {LESS} times '<' before a '>', in one expression", i)
        if open_:
            self._stop(f"'{open_[-1]}' is missing at the end", len(self.tokens))

    def _declare(self, what: str) -> str:
        """``keyword name``, at the keyword, in the module's scope."""
        self._at += 1
        index = self._at
        name = self._name(what)
        self._check_declared(index)
        if name in self._module_names:
            self._stop(f"'{name}' is declared twice", index)
        self._module_names.add(name)
        self._rename(index)
        return name

    def _span(self, end: str) -> list[str]:
        """Words until ``end`` outside of brackets, which is passed; they are names, types and expressions."""
        start, depth = self._at, 0
        while self._at < len(self.tokens):
            word = self._peek()
            if word == end and depth == 0:
                break
            depth += (word in "([{") - (word in ")]}")
            self._use(self._at)
            self._at += 1
        self._expect(end)
        return [self.renamed.get(i, self.tokens[i].text) for i in range(start, self._at - 1)]

    def _use(self, index: int) -> None:
        """A word of an expression, statement or type."""
        word = self.tokens[index]
        if index and self.tokens[index - 1].text == ".":
            return
        self._rename(index)
        if word.text == "array" and self.tokens[index + 1 : index + 2] and self.tokens[index + 1].text == "<":
            self._array(index)

    def _array(self, index: int) -> None:
        """``array<T, N>``: N a number, T no array and no struct, or a few words would be gigabytes."""
        i, depth = index + 2, 1
        inner: list[int] = []
        while i < len(self.tokens) and depth:
            text = self.tokens[i].text
            depth += (text == "<") - (text == ">") - 2 * (text == ">>")
            if text in (">=",):
                self._stop("a space is needed between '>' and '='", i)
            inner.append(i)
            i += 1
        inner = inner[:-1]
        texts = [self.tokens[k].text for k in inner]
        if "array" in texts or any(t in self._declared for t in texts):
            self._stop("an array of a snippet holds numbers, vectors or matrices, and its size is a number", index)
        sizes = [k for k in inner if self.tokens[k].kind == "number"]
        if len(sizes) != 1 or not re.fullmatch(r"\d+[ui]?", self.tokens[sizes[0]].text):
            self._stop("the size of an array is a whole number", index)
        if int(self.tokens[sizes[0]].text.rstrip("ui")[:9]) > ARRAY:
            self._stop(f"an array of a snippet has at most {ARRAY} elements", sizes[0])

    def _struct(self) -> None:
        name = self._declare("a struct")
        self._expect("{")
        while self._peek() != "}":
            self._members.add(self._at)
            self._name("a member")
            self._expect(":")
            depth = 0
            while depth or self._peek() not in (",", "}"):
                if self._at >= len(self.tokens):
                    self._stop("'}' is missing at the end")
                if self._peek() in self._declared:
                    self._stop("members of a snippet's struct are of WGSL's own types")
                depth += (self._peek() == "<") - (self._peek() == ">") - 2 * (self._peek() == ">>")
                self._use(self._at)
                self._at += 1
            if self._peek() == ",":
                self._at += 1
        self._expect("}")
        self._structs.add(name)

    def _function(self) -> None:
        start = self._at
        name = self._declare("a function")
        if len(self.functions) >= FUNCTIONS:
            self._stop(f"a snippet has at most {FUNCTIONS} functions", start)
        self._expect("(")
        parameters = []
        while self._peek() != ")":
            index = self._at
            parameter = self._name("a parameter")
            self._check_declared(index)
            self._rename(index)
            self._expect(":")
            begin, depth = self._at, 0
            while depth or self._peek() not in (",", ")"):
                if self._at >= len(self.tokens):
                    self._stop("')' is missing")
                depth += (self._peek() == "<") - (self._peek() == ">") - 2 * (self._peek() == ">>")
                self._use(self._at)
                self._at += 1
            parameters.append((parameter, "".join(w.text for w in self.tokens[begin : self._at])))
            if self._peek() == ",":
                self._at += 1
        self._expect(")")
        result, shown = "", ""
        if self._peek() == "->":
            self._at += 1
            begin = self._at
            while self._peek() not in ("{", ""):
                self._use(self._at)
                self._at += 1
            result = "".join(w.text for w in self.tokens[begin : self._at])
            shown = "".join(self.renamed.get(i, self.tokens[i].text) for i in range(begin, self._at))
        self._body(name, f"return {shown}();" if shown else "return;")
        loops = sum(start <= i < self._at for i in self.inserted)
        self._sizes[name] = self._at - start + LOOP * loops
        self.functions.append(Function(name, tuple(parameters), result, self.tokens[start].at))

    def _body(self, function: str, leave: str) -> None:
        """A function's block, its loops counted."""
        rounds = f"{self.prefix}0rounds"
        count = f" if {rounds} == 0u {{ {leave} }} {rounds} -= 1u;"
        calls = self._calls.setdefault(function, [])
        if self._peek() != "{":
            self._expect("{")
        depth = 0
        loop: int | None = None  # brackets open at the keyword of the loop whose block has not begun
        brackets = 0
        continuing: list[int] = []
        while self._at < len(self.tokens):
            index, text = self._at, self._peek()
            previous = self.tokens[index - 1].text
            if text in ("let", "var", "const") and previous != ".":
                if text == "var" and self._peek(1) == "<":
                    self._stop("a variable of a snippet has no address space")
                if self._peek(1) != "_" and self.tokens[index + 1 : index + 2]:
                    self._check_declared(index + 1)
            if text in ("loop", "while", "for") and previous != ".":
                if continuing:
                    self._stop("a loop inside 'continuing'")
                loop = brackets
            elif text == "continuing":
                continuing.append(depth)
            self._use(index)
            if self._peek(1) == "(" and text in self._declared and previous != ".":
                calls.append(text)
            brackets += (text in "([") - (text in ")]")
            if text == "{":
                depth += 1
                if loop is not None and brackets == loop:
                    self.inserted[index] = count
                    loop = None
            elif text == "}":
                depth -= 1
                while continuing and continuing[-1] >= depth:
                    continuing.pop()
            self._at += 1
            if depth == 0:
                return

    def _check_size(self) -> None:
        """How large the last function is once all calls are inlined; a function that calls itself is refused."""
        names = {f.name for f in self.functions}
        at = {f.name: f.at for f in self.functions}
        sizes: dict[str, int] = {}

        def size(name: str, path: tuple[str, ...]) -> int:
            if name in path:
                raise _RefusedError(at[name], f"'{name}' calls itself, which WGSL does not allow")
            if name not in sizes:
                inner = sum(size(call, (*path, name)) for call in self._calls[name] if call in names)
                sizes[name] = min(self._sizes[name] + inner, 2 * EXPANDED)
            return sizes[name]

        for name in at:
            if size(name, ()) > EXPANDED:
                raise _RefusedError(at[name], f"'{name}' has more than {EXPANDED} words once its calls are inlined")


def is_free(name: str) -> bool:
    """Whether a snippet may give something this name."""
    return bool(re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII)) and not (
        name in _OWN or name in _RESERVED or _FORBIDDEN.fullmatch(name)
    )
