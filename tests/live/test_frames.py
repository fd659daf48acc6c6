"""Lines of JSON: frames are read, all else is refused with the place and what is allowed; the page shows the same."""

import json
import re
import socket
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from toy import NAMES, Toy, serving, wait

from maniport.errors import InvalidInputError
from maniport.live.transport import Datagrams, as_frame, encoded, read_frame
from maniport.util.input_limits import FRAME_BYTES

POSITION = st.none() | st.lists(st.floats(-1e3, 1e3) | st.integers(-9, 9), min_size=3, max_size=3)


@given(st.floats(-1e6, 1e6), st.lists(POSITION, min_size=3, max_size=3))
def test_a_frame_by_name_or_in_order_is_the_same(t, positions):
    named = dict(reversed(list(zip(NAMES, positions, strict=True))))
    seen = {name: position for name, position in named.items() if position is not None}
    wanted = np.array(
        [[np.nan] * 3 if position is None else position for position in positions], dtype=float
    )
    for points in (positions, named, seen):
        frame = read_frame(json.dumps({"points": points, "t": t}).encode(), NAMES)
        assert frame.t == t
        np.testing.assert_array_equal(frame.points, wanted)
    assert read_frame(b" {} ", NAMES) is None


def test_masked_points_are_not_seen():
    masked = np.ma.masked_array(np.ones((2, 3), dtype=int), mask=[[True] * 3, [False] * 3])
    for points in (masked, {"wrist": [1, 1, 1], "elbow": None}):
        np.testing.assert_array_equal(
            as_frame(points, ("elbow", "wrist")), [[np.nan] * 3, [1.0] * 3]
        )


@pytest.mark.parametrize(
    ("text", "word"),
    [
        (None, str(FRAME_BYTES)),
        (b"", "JSON"),
        (b"nonsense", "'nonsense'"),
        (b"\xff\xfe", "JSON"),
        (b"[" * 16_000, "JSON"),
        (b'{"t":' + b"9" * 5000 + b"}", "JSON"),
        (b"3", "object"),
        (b'[{"t": 0}]', "[{'t': 0}]"),
        (b'{"t": 0}', "{'t': 0}"),
        (b'{"t": 0, "points": [], "seq": 1}', "'seq'"),
        (b'{"t": NaN, "points": []}', "nan"),
        (b'{"t": 1e999, "points": []}', "within"),
        (b'{"t": 0, "points": [[-Infinity, 0, 0], null, null]}', "within"),
        (b'{"t": 1' + b"0" * 400 + b', "points": []}', "within"),
        (b'{"t": "0", "points": []}', "'0'"),
        (b'{"t": true, "points": []}', "True"),
        (b'{"t": 0, "points": 1}', "found 1"),
        (b'{"t": 0, "points": [null]}', "3 positions"),
        (b'{"t": 0, "points": {"elbo": null}}', "nearest first: 'elbow'"),
        (b'{"t": 0, "points": {"elbow": [1, 2]}}', "points['elbow']"),
        (b'{"t": 0, "points": [null, [1, 2, "3"], null]}', "points['elbow']"),
        (b'{"t": 0, "points": [null, [1, 2, 1e13], null]}', "1e+12"),
        (b'{"t": 0, "points": [null, [1, 2, 1' + b"0" * 400 + b"], null]}", "elbow"),
        (b'{"t": 0, "points": [null, {}, null]}', "must be numbers; found {}"),
    ],
)
def test_other_lines_are_refused(text, word):
    with pytest.raises(InvalidInputError) as caught:
        read_frame(text, NAMES)
    assert word in str(caught.value)
    assert len(encoded(error=str(caught.value))) < 600


def blocks(language):
    page = (Path(__file__).parents[2] / "docs" / "live_protocol.md").read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", page, flags=re.DOTALL | re.MULTILINE)


def test_the_page_shows_the_lines():
    first, frames, state, error = blocks("json")
    names = json.loads(first)["points"]
    joints = json.loads(first)["units"]
    named, listed, engage, hold = (
        read_frame(line.encode(), names, [*joints]) for line in frames.splitlines()
    )
    assert (named.t, listed.t) == (0.02, 0.03)
    assert (named.order.joints, engage.engage, hold.engage) == (None, True, False)
    assert listed.order.joints == engage.joints == [-1.41]
    with pytest.raises(InvalidInputError) as caught:
        read_frame(b'{"t": 0, "points": {"RELBO": null}}', names)
    assert encoded(error=str(caught.value), line=7).decode() == error
    transport = Datagrams(0)
    (code,) = blocks("py")
    code = code.replace("9000", str(transport.about["udp"])).replace(
        "...", "answers.append(answer)"
    )
    found = {
        "frames": [dict.fromkeys(NAMES, (0.1 * i, 0.0, 0.0)) for i in range(3)],
        "answers": (answers := []),
        "measured": lambda: [0.0, 0.0],
        "asked": lambda: True,
    }
    toy = Toy()
    with serving(toy, transport):
        exec(compile(code, "page", "exec"), found)
        wait(lambda: any(answer["joints"]["lift"] == pytest.approx(0.2) for answer in answers))
    assert toy.engaged > 0
    found["link"].shutdown(socket.SHUT_RDWR)
    transport.close()
    assert found["expected"].keys() == json.loads(first).keys()
    assert found["expected"]["points"] == [*NAMES]
    assert answers[0].keys() == json.loads(state).keys()
