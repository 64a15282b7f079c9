"""Damages bytes, text and trees of JSON and TOML, from a seed."""

from __future__ import annotations

import copy
import json
import random
import re
from collections.abc import Sequence
from typing import Any

ODD_NUMBERS = (
    "0", "-0.0", "-1", "1e308", "-1e308", "1e999", "nan", "-nan", "inf", "NaN", "Infinity", "9223372036854775808",
    "1_000", "0x7fffffff", "1e-320", "٣", "9" * 30, "9" * 5000, "1.", ".5", "1e", "+-1", "99999999999.5", "180.0001",
)  # fmt: skip
ODD_TEXTS = (
    "", " ", "\x00", "\n", "\r\n", "\x1b[2J", "é" * 200, "\U0001f6a3", "a" * 5000, "../../../../etc/passwd", "%s%n",
    "\ud800", "\u202e", "$HOME", "true", "null", "-", "/dev/zero", "/", ".", "2026-01-01", "1979-05-27T07:32:00Z",
)  # fmt: skip
ODD_VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2**31, 2**63, -(2**63), 2**64, 10**30, 0.5, 1e308, float("nan"), float("inf"), "",
    "text", "\ud800", [], {}, [[]], [None], {"": None}, "a" * 3000, [0] * 300,
)  # fmt: skip
SPLICES = (
    b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"[" * 2000, b"{" * 2000, b"\xed\xa0\x80", b"\r\n", b"#", b'"""', b"'''",
    b"\\u0000", b"<!DOCTYPE x>", b"<!--", b"]]>", b"&lt;", b"&x;", b"<x>" * 300, b" xmlns:a='b'",
)  # fmt: skip
FEW_PLACES = 100
DEEP = (20, 200, 1500, 40_000)
INTERESTING = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 2**63, 2**64 - 1)
NUMBER = re.compile(r"-?\d[\d.e+-]*")


def damaged_bytes(data: bytes, rng: random.Random, others: Sequence[bytes] = ()) -> bytes:
    """One to four edits: other bits, bytes, lengths, pieces twice, missing or from elsewhere."""
    out = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(out) + 1)
        size = min(len(out) - at, rng.choice((1, 1, 2, 4, 8, 32, 300)))
        match rng.randrange(8):
            case 0 if at < len(out):
                out[at] ^= 1 << rng.randrange(8)
            case 1:
                out[at : at + size] = rng.randbytes(size)
            case 2:
                out[at:at] = rng.randbytes(rng.choice((1, 2, 8, 100)))
            case 3:
                del out[at : at + size]
            case 4:
                out[at:at] = out[at : at + size] * rng.choice((1, 2, 50))
            case 5:
                del out[at:]
            case 6:
                width = rng.choice((1, 2, 4, 8))
                value = rng.choice(INTERESTING) % 256**width
                out[at : at + width] = value.to_bytes(width, rng.choice(("little", "big")))
            case _:
                other = rng.choice([*others, bytes(out)])
                begin = rng.randrange(len(other) + 1)
                out[at:at] = other[begin : begin + rng.randrange(200)]
    return bytes(out)


def damaged_text(data: bytes, rng: random.Random, others: Sequence[bytes] = ()) -> bytes:
    """Numbers, texts and lines of a text become odd, go missing or come again; sometimes its bytes are damaged."""
    choice = rng.randrange(10)
    text = data.decode("utf-8", "surrogateescape")
    if choice < 4:
        for _ in range(rng.randint(1, 2)):
            numbers = list(NUMBER.finditer(text))
            if numbers:
                found = rng.choice(numbers)
                text = text[: found.start()] + rng.choice(ODD_NUMBERS) + text[found.end() :]
    elif choice < 6:
        quoted = list(re.finditer(r"([\"'>])([^\"'<>\n]*)([\"'<])", text))
        if quoted:
            found = rng.choice(quoted)
            text = text[: found.start(2)] + rng.choice(ODD_TEXTS) + text[found.end(2) :]
    elif choice < 8:
        lines = text.splitlines(keepends=True) or [""]
        at = rng.randrange(len(lines))
        match rng.randrange(4):
            case 0:
                del lines[at]
            case 1:
                lines.insert(at, rng.choice(lines))
            case 2:
                lines[at] = lines[at] * rng.choice((2, 100))
            case _:
                rng.shuffle(lines)
        text = "".join(lines)
    elif choice == 8:
        at = rng.randrange(len(text) + 1)
        raw = text.encode("utf-8", "surrogatepass" if "\ud800" in text else "surrogateescape")
        return raw[:at] + rng.choice(SPLICES) + raw[at:]
    else:
        return damaged_bytes(data, rng, others)
    return text.encode("utf-8", "surrogatepass" if "\ud800" in text else "surrogateescape")


def damaged_tree(tree: Any, rng: random.Random) -> Any:
    """A copy with one to three places that are odd, missing, nested, or far more than one."""
    root = [copy.deepcopy(tree)]
    for _ in range(rng.randint(1, 3)):
        places = list(_places(root))
        holder, at = rng.choice(places)
        match rng.randrange(6):
            case 0 if holder is not root:
                del holder[at]
            case 1:
                many = 400 if len(places) < FEW_PLACES else 2  # so that three such edits stay small
                holder[at] = [holder[at]] * rng.choice((1, 2, many))
            case 2:
                holder[at] = {"x": holder[at]}
            case 3 if isinstance(holder[at], dict):
                holder[at][rng.choice(ODD_TEXTS)] = copy.deepcopy(rng.choice(ODD_VALUES))
            case 4:
                donor, key = rng.choice(places)
                holder[at] = copy.deepcopy(donor[key])
            case _:
                holder[at] = copy.deepcopy(rng.choice(ODD_VALUES))
    return root[0]


def _places(root: list[Any]) -> list[tuple[Any, Any]]:
    found: list[tuple[Any, Any]] = []
    waiting: list[Any] = [root]
    while waiting:
        holder = waiting.pop()
        keys = list(holder) if isinstance(holder, dict) else range(min(len(holder), 50))
        for key in keys:
            found.append((holder, key))
            if isinstance(holder[key], dict | list):
                waiting.append(holder[key])
    return found


def json_bytes(tree: Any, rng: random.Random) -> bytes:
    """JSON, sometimes far too deep."""
    text = json.dumps(tree, ensure_ascii=rng.random() < 0.5)
    return _deepened(text, ("[", "]"), rng).encode("utf-8", "surrogatepass")


def toml_bytes(tree: Any, rng: random.Random) -> bytes:
    """TOML with inline tables, sometimes far too deep; what has no form in TOML is written as it is in Python."""
    if not isinstance(tree, dict):
        tree = {"x": tree}
    text = "".join(f"{json.dumps(str(key))} = {_inline(value)}\n" for key, value in tree.items())
    return _deepened(text, ("[", "]"), rng).encode("utf-8", "surrogatepass")


def _inline(value: Any) -> str:
    match value:
        case bool():
            return str(value).lower()
        case dict():
            return "{" + ", ".join(f"{json.dumps(str(key))} = {_inline(each)}" for key, each in value.items()) + "}"
        case list() | tuple():
            return "[" + ", ".join(_inline(each) for each in value) + "]"
        case str():
            return json.dumps(value, ensure_ascii=False)
    return str(value)


def _deepened(text: str, brackets: tuple[str, str], rng: random.Random) -> str:
    numbers = list(NUMBER.finditer(text))
    if not numbers or rng.random() > 0.05:
        return text
    found, depth = rng.choice(numbers), rng.choice(DEEP)
    return text[: found.start()] + brackets[0] * depth + found[0] + brackets[1] * depth + text[found.end() :]
