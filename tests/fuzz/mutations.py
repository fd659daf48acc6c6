"""What is done to files: what disks, networks, programs and people do to them, and what those do who mean harm."""

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


def mutated(content: bytes, others: list[bytes], random_: random.Random) -> bytes:
    """Change a file in one to four ways."""
    if content[:2] == b"PK" and random_.random() < 0.8:
        return _other_arrays(content, random_)
    ways = WAYS if b"\0" in content[:512] else WAYS + OF_TEXT
    for _ in range(random_.choice((1, 1, 2, 4))):
        content = random_.choice(ways)(content, others, random_)
    return content


def _place(content: bytes, random_: random.Random) -> int:
    return random_.randrange(len(content) + 1)


def _flip(content: bytes, others: list[bytes], random_: random.Random) -> bytes:
    changed = bytearray(content)
    for _ in range(random_.choice((1, 1, 3, 20))):
        if changed:
            changed[random_.randrange(len(changed))] = random_.choice((0, 255, 127, 128, random_.randrange(256)))
    return bytes(changed)


def _cut(content: bytes, others: list[bytes], random_: random.Random) -> bytes:
    start, length = _place(content, random_), random_.choice((1, 2, 4, 16, 100, 512))
    return content[:start] + content[start + length :]


def _end(content: bytes, others: list[bytes], random_: random.Random) -> bytes:
    return content[: _place(content, random_)]


def _twice(content: bytes, others: list[bytes], random_: random.Random) -> bytes:
    start, length = _place(content, random_), random_.choice((1, 4, 30, 300, 3000))
    piece = content[start : start + length] * random_.choice((1, 1, 5, 50))
    place = random_.choice((start, _place(content, random_)))
    return content[:place] + piece + content[place:]


def _word(content: bytes, others: list[bytes], random_: random.Random) -> bytes:
    place = _place(content, random_)
    return content[:place] + random_.choice(WORDS) * random_.choice((1, 1, 1, 300)) + content[place:]


def _number(content: bytes, others: list[bytes], random_: random.Random) -> bytes:
    found = list(re.finditer(rb"(?<![\w.])-?\d[\d.eE+-]*", content[:20_000]))
    if not found:
        return _flip(content, others, random_)
    one = random_.choice(found)
    return content[: one.start()] + random_.choice(NUMBERS) + content[one.end() :]


def _line(content: bytes, others: list[bytes], random_: random.Random) -> bytes:
    lines = content.split(b"\n")
    one, other = random_.randrange(len(lines)), random_.randrange(len(lines))
    way = random_.randrange(3)
    if way == 0:
        lines[one], lines[other] = lines[other], lines[one]
    elif way == 1:
        lines.insert(other, lines[one])
    else:
        del lines[one]
    return b"\n".join(lines)


def _name(content: bytes, others: list[bytes], random_: random.Random) -> bytes:
    """Put one name of the file in the place of another."""
    names = list(re.finditer(rb"[A-Za-z_][\w-]{1,30}", content[:20_000]))
    if not names:
        return _flip(content, others, random_)
    one, other = random_.choice(names), random_.choice(names)
    return content[: one.start()] + other[0] + content[one.end() :]


def _element(content: bytes, others: list[bytes], random_: random.Random) -> bytes:
    """Put an element of XML somewhere else, or twice."""
    starts = [found.start() for found in re.finditer(rb"<[a-z]", content[:50_000])]
    if not starts:
        return _line(content, others, random_)
    one = random_.choice(starts)
    end = content.find(b">", one) + 1
    piece, place = content[one:end], random_.choice(starts)
    return content[:place] + piece * random_.choice((1, 2, 40)) + content[place:]


def _splice(content: bytes, others: list[bytes], random_: random.Random) -> bytes:
    other = random_.choice(others)
    return content[: _place(content, random_)] + other[_place(other, random_) :]


def _words_of_two_and_four(content: bytes, others: list[bytes], random_: random.Random) -> bytes:
    """Binary numbers of wild sizes."""
    width = random_.choice((2, 4))
    place = max(0, _place(content, random_) - width)
    value = random_.choice((0, 1, 2 ** (8 * width) - 1, 2 ** (8 * width - 1), 2 ** (8 * width - 1) - 1))
    return content[:place] + value.to_bytes(width, random_.choice(("little", "big"))) + content[place + width :]


WAYS = (_flip, _cut, _end, _twice, _word, _number, _line, _name, _element, _splice, _words_of_two_and_four)
OF_TEXT = (_number, _number, _number, _number, _name, _name, _element, _line)
"""What leaves most of a text as it is."""


def _other_arrays(content: bytes, random_: random.Random) -> bytes:
    """An archive of arrays with one of them changed, missing, renamed or of another kind."""
    with np.load(io.BytesIO(content)) as archive:
        arrays = dict(archive)
    name = random_.choice(sorted(arrays))
    value = arrays[name]
    way = random_.randrange(9)
    if way == 0:
        del arrays[name]
    elif way == 1:
        arrays[name] = value[..., :-1] if value.ndim else np.array([value, value])
    elif way == 2:
        arrays[random_.choice(sorted(arrays))] = value
    elif way == 3 and value.dtype.kind in "fi":
        arrays[name] = value.astype(random_.choice(("S3", "U3", "c16", "i1", "?", "f2")), casting="unsafe", copy=True)
    elif way == 4 and value.dtype.kind in "fi" and value.size:
        value = value.astype(np.float64)
        wild = random_.choice((np.nan, np.inf, -1.0, 0.0, 1e308, 1e-320, 1e18))
        value.reshape(-1)[random_.randrange(value.size)] = wild
        arrays[name] = value
    elif way == 5:
        arrays[name] = value[None]
    elif way == 6 and value.dtype.kind in "fi":
        arrays[name] = -value if random_.random() < 0.5 else value * 1e300
    elif way == 7 and value.dtype.kind == "U":
        text = str(value.reshape(-1)[0]).encode()
        arrays[name] = np.array(mutated(text, [text], random_).decode("utf-8", "replace"))
    else:
        arrays[name] = value.reshape(-1)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for key, array in arrays.items():
            with archive.open(f"{key}.npy", "w") as entry:
                np.lib.format.write_array(entry, np.asarray(array), allow_pickle=False)
    return stream.getvalue()
