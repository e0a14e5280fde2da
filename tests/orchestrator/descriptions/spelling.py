"""Every value in one of the ways that XML Schema allows, by chance."""

import random
from collections.abc import Mapping
from typing import Any
from xml.sax.saxutils import escape


class Spelling:
    """One way of writing each thing, by chance."""

    def __init__(self, r: random.Random) -> None:
        self.r = r

    def padded(self, text: str) -> str:
        return self.r.choice(("", "", " ", "\n")) + text + self.r.choice(("", "", " "))

    def real(self, x: float) -> str:
        ways = [repr(x), f"{x:.17e}", f"{x:.17E}", ("+" if x >= 0 else "") + repr(x)]
        if x == int(x) and abs(x) < 1e6:
            ways += [str(int(x)), f"{int(x)}."]
        return self.padded(self.r.choice(ways))

    def whole(self, n: int) -> str:
        ways = [str(n), ("+" if n >= 0 else "-") + "00" + str(abs(n))]
        return self.padded(self.r.choice(ways))

    def boolean(self, on: bool) -> str:
        return self.padded(self.r.choice(("true", "1") if on else ("false", "0")))

    def value(self, value: Any, kind: str) -> str:
        if kind in ("Real", "Float64", "Float32"):
            return self.real(value)
        if kind == "Boolean":
            return self.boolean(value)
        return value.hex() if isinstance(value, bytes) else value if kind == "String" else self.whole(value)

    def attributes(self, given: Mapping[str, str | None]) -> str:
        items = [(name, text) for name, text in given.items() if text is not None]
        self.r.shuffle(items)
        return "".join(self.attribute(name, text) for name, text in items)

    def attribute(self, name: str, text: str) -> str:
        quote, gap = self.r.choice("\"'"), self.r.choice((" ", "\n  "))
        inner = escape(text, {'"': "&quot;"} if quote == '"' else {"'": "&apos;"})
        if self.r.random() < 0.1 and inner == text:  # characters may be written by number
            inner = "".join(f"&#x{ord(c):x};" if c.isalpha() else c for c in text)
        return f"{gap}{name}={quote}{inner}{quote}"

    def element(self, tag: str, given: Mapping[str, str | None], inner: str = "") -> str:
        comment = "<!-- -->" if self.r.random() < 0.05 else ""
        start = f"{comment}<{tag}{self.attributes(given)}"
        return f"{start}/>" if not inner and self.r.random() < 0.8 else f"{start}>{inner}</{tag}>"
