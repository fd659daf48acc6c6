"""Mutations of files: what disks, networks, programs and people do to them, and what hostile people do."""

import io
import random
import re
from collections.abc import Sequence

import numpy as np

NUMBERS = (
    b"0",
    b"-1",
    b"1",
    b"4000000000",
    b"-4000000000",
    b"99999999999999999999",
    b"1e308",
    b"-1e-320",
    b"1e999",
    b"nan",
    b"inf",
    b"0.5",
    b"",
    b"x",
    b"9" * 5000,
    b"1e-9",
    b"65536",
    b"255",
)
WORDS = (
    b"<",
    b">",
    b"{",
    b"}",
    b"[",
    b"]",
    b"\0",
    b"\xff",
    b"\n",
    b" ",
    b'"',
    b"/",
    b"&#0;",
    b"<!--",
    b"\xf0\x9f\x92\xa9",
    b"..",
    b"../../../../etc/passwd",
    b"/dev/zero",
    b"file:///dev/zero",
    b"package://x/../..",
)


def mutated(content: bytes, others: list[bytes], generator: random.Random) -> bytes:
    """Change a file in one to four ways; in a text mostly numbers, names, elements and lines."""
    if content[:2] == b"PK" and generator.random() < 0.8:
        return _other_arrays(content, generator)
    ways = [_flip, _cut, _repeat, _insert, _binary_number]
    if b"\0" not in content[:512]:
        ways += [_number] * 5 + [_name, _name, _element, _element, _line, _line]
    for _ in range(generator.choice((1, 1, 2, 4))):
        content = generator.choice(ways)(content, generator)
    if generator.random() < 0.1:  # the beginning of one file and the end of another
        other = generator.choice(others)
        content = content[: _place(content, generator)] + other[_place(other, generator) :]
    return content


def _place(content: bytes, generator: random.Random) -> int:
    return generator.randrange(len(content) + 1)


def _flip(content: bytes, generator: random.Random) -> bytes:
    changed = bytearray(content)
    for _ in range(generator.choice((1, 1, 3, 20)) if changed else 0):
        changed[generator.randrange(len(changed))] = generator.choice(
            (0, 255, 127, 128, generator.randrange(256))
        )
    return bytes(changed)


def _cut(content: bytes, generator: random.Random) -> bytes:
    start = _place(content, generator)
    length = generator.choice((1, 2, 4, 16, 100, 512, len(content)))
    return content[:start] + content[start + length :]


def _repeat(content: bytes, generator: random.Random) -> bytes:
    start = _place(content, generator)
    length = generator.choice((1, 4, 30, 300, 3000))
    return (
        content[:start]
        + content[start : start + length] * generator.choice((1, 5, 50))
        + content[start:]
    )


def _insert(content: bytes, generator: random.Random) -> bytes:
    place = _place(content, generator)
    return (
        content[:place]
        + generator.choice(WORDS) * generator.choice((1, 1, 1, 300))
        + content[place:]
    )


def _binary_number(content: bytes, generator: random.Random) -> bytes:
    width = generator.choice((2, 4))
    place = max(0, _place(content, generator) - width)
    value = generator.choice(
        (0, 1, 2 ** (8 * width) - 1, 2 ** (8 * width - 1), 2 ** (8 * width - 1) - 1)
    )
    return (
        content[:place]
        + value.to_bytes(width, generator.choice(("little", "big")))
        + content[place + width :]
    )


def _line(content: bytes, generator: random.Random) -> bytes:
    lines = content.split(b"\n")
    line = lines.pop(generator.randrange(len(lines)))
    for _ in range(generator.randrange(3)):
        lines.insert(generator.randrange(len(lines) + 1), line)
    return b"\n".join(lines)


def _number(content: bytes, generator: random.Random) -> bytes:
    return _replaced(content, rb"(?<![\w.])-?\d[\d.eE+-]*", NUMBERS, generator)


def _name(content: bytes, generator: random.Random) -> bytes:
    names = rb"[A-Za-z_][\w-]{1,30}"
    return _replaced(content, names, re.findall(names, content[:20_000]), generator)


def _element(content: bytes, generator: random.Random) -> bytes:
    """Replace an opening tag of XML by several of another one."""
    tags = [
        tag * count
        for tag in re.findall(rb"<[a-z][^>]*>", content[:20_000])
        for count in (0, 1, 2, 40)
    ]
    return _replaced(content, rb"<[a-z][^>]*>", tags, generator)


def _replaced(
    content: bytes, pattern: bytes, values: Sequence[bytes], generator: random.Random
) -> bytes:
    found = list(re.finditer(pattern, content[:20_000]))
    if not found:
        return _flip(content, generator)
    old = generator.choice(found)
    return content[: old.start()] + generator.choice(values) + content[old.end() :]


def _other_arrays(content: bytes, generator: random.Random) -> bytes:
    """Return an archive of arrays with one of them changed, missing, renamed or of another kind."""
    with np.load(io.BytesIO(content)) as archive:
        arrays = dict(archive)
    name = generator.choice(sorted(arrays))
    if not isinstance(arrays[name], np.ndarray):  # a file of another kind
        return _flip(content, generator)
    value = arrays.pop(name)
    changes = [
        value[..., :-1] if value.ndim else np.array([value, value]),
        value.reshape(-1),
        value[None],
    ]
    if value.dtype.kind in "fi" and value.size > 0:
        wild = value.astype(np.float64)
        wild.reshape(-1)[generator.randrange(value.size)] = generator.choice(
            (np.nan, np.inf, -1.0, 0.0, 1e308, 1e18)
        )
        kind = generator.choice(("S3", "U3", "c16", "i1", "?", "f2"))
        changes += [wild, wild, wild, -value, value * 1e300, value.astype(kind, casting="unsafe")]
    if value.dtype.kind == "U":
        text = str(value.reshape(-1)[0]).encode()
        changes += [np.array(mutated(text, [text], generator).decode("utf-8", "replace"))] * 3
    if generator.random() < 0.8:
        arrays[generator.choice((name, name, name, *arrays))] = generator.choice(changes)
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()
