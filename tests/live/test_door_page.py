"""What the page shows of the wire is what goes over it."""

import json
import re
import socket
from pathlib import Path

import pytest
from toy import NAMES, Toy, serving

from maniport.errors import InvalidInputError
from maniport.live.door.openings import Datagrams
from maniport.live.door.wire import answer, hello, read_frame, refusal

PAGE = (Path(__file__).parents[2] / "docs" / "live.md").read_text(encoding="utf-8")


def blocks(language):
    """Fenced blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE, flags=re.DOTALL | re.MULTILINE)


def test_lines_of_the_page_are_those_of_the_wire():
    """Frames are understood, and the answers have the fields and the words that the page shows."""
    first, frames, told, error = blocks("json")
    first, told = json.loads(first), json.loads(told)
    names = first["points"]
    named, listed = (read_frame(line.encode(), names) for line in frames.splitlines())
    assert (named.t, listed.t) == (0.02, 0.03)
    made = hello(names, first["start"], list(first["units"].values()), host=first["host"], udp=first["udp"])
    assert json.loads(made) == first
    assert json.loads(answer(*told.values())) == told
    with pytest.raises(InvalidInputError) as caught:
        read_frame(b'{"t": 0, "points": {"RELBO": null}}', names)
    assert refusal(caught.value, 7).decode() == error


def test_the_client_of_the_page_is_answered():
    """It asks what is expected, and gets an answer for each frame."""
    opening = Datagrams(0)
    (code,) = blocks("py")
    found = {"frames": [dict.fromkeys(NAMES, (0.1 * i, 0.0, 0.0)) for i in range(3)]}
    with serving(Toy(), opening):
        exec(compile(code.replace("9000", str(opening.about["udp"])), "page", "exec"), found)
    opening.close()
    assert found["expected"]["points"] == [*NAMES]
    assert found["answer"]["joints"]["lift"] == pytest.approx(0.2)
    assert isinstance(found["link"], socket.socket)
