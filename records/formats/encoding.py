"""The encoding of a text, decided from all of it.

UTF-8 where all of it is UTF-8, UTF-16 where its mark or its zero bytes say so, Windows-1252 where nothing
beyond ASCII is UTF-8.  A text that is UTF-8 in some places and not in others is damaged: it is refused.
"""

import codecs
import re
from collections.abc import Iterable

BOMS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
SURROGATES = "\ud800-\udfff"  # what a byte that is no UTF-8 is decoded to
NO_UTF8 = re.compile(f"[{SURROGATES}]")
IN_UTF8 = re.compile(rf"[^\x00-\x7f{SURROGATES}]")


class Damaged(ValueError):
    """Says where a text is not what the rest of it is."""


def marked(head: bytes) -> str:
    """The encoding that the first bytes of a text show; "" where they show none."""
    return next((name for bom, name in BOMS if head.startswith(bom)), "") or _zero_sides(head)


def _zero_sides(head: bytes) -> str:
    """utf-16-le or utf-16-be where every second byte of the head is zero, else nothing."""
    some = head[: len(head) // 2 * 2]
    if len(some) < 8:
        return ""
    even, odd = some[0::2].count(0) * 2 / len(some), some[1::2].count(0) * 2 / len(some)
    return "utf-16-le" if odd > 0.7 and even < 0.1 else "utf-16-be" if even > 0.7 and odd < 0.1 else ""


def single_byte(chunks: Iterable[bytes]) -> str:
    """The encoding of a text that is not all UTF-8; raises Damaged where some of it is."""
    decoder = codecs.getincrementaldecoder("utf-8")(errors="surrogateescape")
    line, wrong, right = 1, "", ""
    for data in chunks:
        text = decoder.decode(data)
        wrong = wrong or _place(NO_UTF8, text, line)
        right = right or _place(IN_UTF8, text, line)
        if wrong and right:
            raise Damaged(f"{wrong} is not UTF-8, as {right} is")
        line += text.count("\n")
    return "cp1252"


def _place(pattern: re.Pattern[str], text: str, line: int) -> str:
    match = pattern.search(text)
    return f"line {line + text.count(chr(10), 0, match.start())}" if match else ""


def decoded(data: bytes) -> str:
    """A whole text without its mark; raises Damaged where it is none."""
    name = marked(data[:4096])
    try:
        return data.decode(name or "utf-8")
    except UnicodeDecodeError as error:
        if name:
            raise Damaged(f"it is not {name} ({error.reason})") from None
        return data.decode(single_byte([data]), "replace")
