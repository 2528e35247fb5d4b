"""HTML in which text cannot become markup: names of scenes come from files, and a file may hold anything."""

from __future__ import annotations

import html
import json
from typing import Any

_VOID = frozenset({"br", "col", "hr", "img", "input", "meta"})


class Html(str):
    """Text that is markup already."""

    __slots__ = ()


def tag(name: str, /, *children: str | None, **attributes: Any) -> Html:
    """One element.

    Args:
        children: text, which is escaped, or :class:`Html`, which is not; None is left out.
        attributes: ``class_`` is ``class``, other underscores are hyphens (``aria_label``); True is an attribute
            without a value, None and False are left out.

    >>> tag("p", "a < b", class_="note", hidden=True, title=None)
    '<p class="note" hidden>a &lt; b</p>'
    """
    words = [name]
    for key, value in attributes.items():
        attribute = key.rstrip("_").replace("_", "-")
        if value is True:
            words.append(attribute)
        elif value is not None and value is not False:
            words.append(f'{attribute}="{html.escape(str(value))}"')
    start = f"<{' '.join(words)}>"
    return Html(start if name in _VOID else f"{start}{join(*children)}</{name}>")


def join(*children: str | None) -> Html:
    """Several pieces, one after another; plain text is escaped."""
    pieces = (c if isinstance(c, Html) else html.escape(c, quote=False) for c in children if c is not None)
    return Html("".join(pieces))


def data(value: Any, **attributes: Any) -> Html:
    """Plain data as a JSON block that a script reads. No ``<`` is left in it, so nothing can end the block early."""
    text = json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return tag("script", Html(text), type="application/json", **attributes)
