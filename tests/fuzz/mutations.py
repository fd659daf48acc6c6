"""Mutations of files: what disks, networks, programs and people do to them, and what hostile people do."""

import io
import random
import re
import zipfile

import numpy as np

NUMBERS = (b"0", b"-1", b"1", b"4000000000", b"-4000000000", b"99999999999999999999", b"1e308", b"-1e-320", b"1e999",
           b"nan", b"inf", b"0.5", b"", b"x", b"9" * 5000, b"1e-9", b"65536", b"255")  # fmt: skip
WORDS = (b"<", b">", b"{", b"}", b"[", b"]", b"\0", b"\xff", b"\n", b" ", b'"', b"/", b"&#0;", b"<!--",
         b"\xf0\x9f\x92\xa9",
         b"..", b"../../../../etc/passwd", b"/dev/zero", b"file:///dev/zero", b"package://x/../..")  # fmt: skip


def mutated(content: bytes, others: list[bytes], generator: random.Random) -> bytes:
    """Change a file in one to four ways; in a text mostly numbers, names, elements and lines."""
    if content[:2] == b"PK" and generator.random() < 0.8:
        return _other_arrays(content, generator)
    text = b"\0" not in content[:512]
    ways = WAYS + ([_number] * 4 + [_name, _name, _element, _line] if text else [])
    for _ in range(generator.choice((1, 1, 2, 4))):
        content = generator.choice(ways)(content, others, generator)
    return content


def _place(content: bytes, generator: random.Random) -> int:
    return generator.randrange(len(content) + 1)


def _flip(content: bytes, others: list[bytes], generator: random.Random) -> bytes:
    changed = bytearray(content)
    for _ in range(generator.choice((1, 1, 3, 20)) if changed else 0):
        changed[generator.randrange(len(changed))] = generator.choice((0, 255, 127, 128, generator.randrange(256)))
    return bytes(changed)


def _cut(content: bytes, others: list[bytes], generator: random.Random) -> bytes:
    start, length = _place(content, generator), generator.choice((1, 2, 4, 16, 100, 512, len(content)))
    return content[:start] + content[start + length :]


def _twice(content: bytes, others: list[bytes], generator: random.Random) -> bytes:
    start, length = _place(content, generator), generator.choice((1, 4, 30, 300, 3000))
    place = generator.choice((start, _place(content, generator)))
    return content[:place] + content[start : start + length] * generator.choice((1, 1, 5, 50)) + content[place:]


def _word(content: bytes, others: list[bytes], generator: random.Random) -> bytes:
    place = _place(content, generator)
    return content[:place] + generator.choice(WORDS) * generator.choice((1, 1, 1, 300)) + content[place:]


def _number(content: bytes, others: list[bytes], generator: random.Random) -> bytes:
    found = list(re.finditer(rb"(?<![\w.])-?\d[\d.eE+-]*", content[:20_000]))
    if not found:
        return _flip(content, others, generator)
    old = generator.choice(found)
    return content[: old.start()] + generator.choice(NUMBERS) + content[old.end() :]


def _line(content: bytes, others: list[bytes], generator: random.Random) -> bytes:
    lines = content.split(b"\n")
    first, second = generator.randrange(len(lines)), generator.randrange(len(lines))
    way = generator.randrange(3)
    if way == 0:
        lines[first], lines[second] = lines[second], lines[first]
    elif way == 1:
        lines.insert(second, lines[first])
    else:
        del lines[first]
    return b"\n".join(lines)


def _name(content: bytes, others: list[bytes], generator: random.Random) -> bytes:
    """Put one name of the file in the place of another."""
    names = list(re.finditer(rb"[A-Za-z_][\w-]{1,30}", content[:20_000]))
    if not names:
        return _flip(content, others, generator)
    old, new = generator.choice(names), generator.choice(names)
    return content[: old.start()] + new[0] + content[old.end() :]


def _element(content: bytes, others: list[bytes], generator: random.Random) -> bytes:
    """Put an element of XML somewhere else, or several times."""
    starts = [match.start() for match in re.finditer(rb"<[a-z]", content[:50_000])]
    if not starts:
        return _line(content, others, generator)
    start, place = generator.choice(starts), generator.choice(starts)
    piece = content[start : content.find(b">", start) + 1]
    return content[:place] + piece * generator.choice((1, 2, 40)) + content[place:]


def _splice(content: bytes, others: list[bytes], generator: random.Random) -> bytes:
    other = generator.choice(others)
    return content[: _place(content, generator)] + other[_place(other, generator) :]


def _binary_number(content: bytes, others: list[bytes], generator: random.Random) -> bytes:
    width = generator.choice((2, 4))
    place = max(0, _place(content, generator) - width)
    value = generator.choice((0, 1, 2 ** (8 * width) - 1, 2 ** (8 * width - 1), 2 ** (8 * width - 1) - 1))
    return content[:place] + value.to_bytes(width, generator.choice(("little", "big"))) + content[place + width :]


WAYS = [_flip, _cut, _twice, _word, _number, _line, _name, _element, _splice, _binary_number]


def _other_arrays(content: bytes, generator: random.Random) -> bytes:
    """Return an archive of arrays with one of them changed, missing, renamed or of another kind."""
    with np.load(io.BytesIO(content)) as archive:
        arrays = dict(archive)
    name = generator.choice(sorted(arrays))
    value = arrays[name]
    numbers, way = value.dtype.kind in "fi" and value.size > 0, generator.randrange(8)
    if way == 0:
        del arrays[name]
    elif way == 1:
        arrays[name] = value[..., :-1] if value.ndim else np.array([value, value])
    elif way == 2:
        arrays[generator.choice(sorted(arrays))] = value
    elif way == 3 and numbers:
        kind = generator.choice(("S3", "U3", "c16", "i1", "?", "f2"))
        arrays[name] = value.astype(kind, casting="unsafe", copy=True)
    elif way == 4 and numbers:
        arrays[name] = value.astype(np.float64)
        wild = generator.choice((np.nan, np.inf, -1.0, 0.0, 1e308, 1e-320, 1e18))
        arrays[name].reshape(-1)[generator.randrange(value.size)] = wild
    elif way == 5 and numbers:
        arrays[name] = generator.choice((-value, value * 1e300, value[None]))
    elif way == 6 and value.dtype.kind == "U":
        text = str(value.reshape(-1)[0]).encode()
        arrays[name] = np.array(mutated(text, [text], generator).decode("utf-8", "replace"))
    else:
        arrays[name] = value.reshape(-1)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for key, array in arrays.items():
            with archive.open(f"{key}.npy", "w") as entry:
                np.lib.format.write_array(entry, np.asarray(array), allow_pickle=False)
    return stream.getvalue()
