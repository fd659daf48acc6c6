"""What goes over the wire: frames are understood, all else is refused with what, where and what is allowed."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maniport.errors import InvalidInputError
from maniport.input_limits import FRAME_BYTES
from maniport.live.door.wire import answer, hello, read_frame, refusal

NAMES = ("shoulder", "elbow", "wrist")
PLACE = st.none() | st.lists(st.floats(-1e3, 1e3) | st.integers(-9, 9), min_size=3, max_size=3)


def line(content):
    """A line as a sender writes it."""
    return json.dumps(content).encode()


@given(st.floats(-1e6, 1e6), st.lists(PLACE, min_size=3, max_size=3))
def test_a_frame_by_name_or_in_order_is_the_same(t, places):
    """An object by name, in any order, and a list give the same points; null and absent ones are nan."""
    listed = read_frame(line({"t": t, "points": places}), NAMES)
    named = dict(reversed(list(zip(NAMES, places, strict=True))))
    there = {name: place for name, place in named.items() if place is not None}
    wanted = np.array([[np.nan] * 3 if place is None else place for place in places], dtype=float)
    for frame in (listed, *(read_frame(line({"points": some, "t": t}), NAMES) for some in (named, there))):
        assert frame.t == t
        np.testing.assert_array_equal(frame.points, wanted)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (None, f"at most {FRAME_BYTES} bytes"),
        (b"", "must be JSON"),
        (b"nonsense", "found 'nonsense'"),
        (b"\xff\xfe", "must be JSON"),
        (b"[" * 16_000, "must be JSON"),
        (b'{"t":' + b"9" * 5000 + b"}", "must be JSON"),
        (b"3", "must be an object"),
        (b'[{"t": 0}]', "found a list of 1"),
        (b'{"t": 0}', 'nothing else; found "t"'),
        (b'{"t": 0, "points": [], "seq": 1}', '"seq"'),
        (b'{"t": 0, "t": 1, "points": []}', '"t" more than once'),
        (b'{"t": NaN, "points": []}', "no number NaN"),
        (b'{"t": 0, "points": [[-Infinity, 0, 0], null, null]}', "no number -Infinity"),
        (b'{"t": 1e999, "points": []}', "t: a number must be finite"),
        (b'{"t": "0", "points": []}', 't: a number must be finite, within ±5e+11; found "0"'),
        (b'{"t": true, "points": []}', "found true"),
        (b'{"t": 0, "points": 1}', "points must be an object of places by name, or a list; found 1"),
        (b'{"t": 0, "points": [null]}', "points must be 3 places, in the order told; found 1"),
        (b'{"t": 0, "points": {"elbo": null}}', "nearest first: 'elbow'"),
        (b'{"t": 0, "points": {"elbow": null, "elbow": null}}', '"elbow" more than once'),
        (b'{"t": 0, "points": {"elbow": [1, 2]}}', 'points["elbow"] must be three numbers'),
        (b'{"t": 0, "points": [null, [1, 2, "3"], null]}', 'points[1]: a number must be finite, within ±1e+12'),
        (b'{"t": 0, "points": [null, [1, 2, 1e13], null]}', "found 10000000000000.0"),
        (b'{"t": 0, "points": [null, [1, 2, 1' + b"0" * 400 + b"], null]}", "found 1000"),
        (b'{"t": 0, "points": [null, [1, 2, {}], null]}', "found an object of 0"),
    ],
)  # fmt: skip
def test_what_is_no_frame_is_refused(text, told):
    """The message says what, where and what is allowed, in few characters, and goes back as one line of JSON."""
    with pytest.raises(InvalidInputError) as caught:
        read_frame(text, NAMES)
    assert told in str(caught.value)
    back = refusal(caught.value, 7)
    assert len(back) < 600
    assert back.count(b"\n") == 1
    assert json.loads(back)["line"] == 7


def test_the_empty_object_asks_what_is_expected():
    """It is no frame and no mistake; the answer names points, units and where the robot begins."""
    assert read_frame(b" {} ", NAMES) is None
    told = json.loads(hello(NAMES, {"lift": 0.5}, ["m"], udp=9000))
    assert (told["points"], told["units"], told["start"], told["udp"]) == ([*NAMES], {"lift": "m"}, {"lift": 0.5}, 9000)


def test_an_answer_is_one_line():
    """What there is none of is null."""
    told = json.loads(answer(1.5, 1.48, "holding", {"lift": 0.25}, None, None, 3))
    assert told == {
        "t": 1.5, "frame": 1.48, "state": "holding", "joints": {"lift": 0.25}, "distance": None, "tip_error": None,
        "skipped": 3,
    }  # fmt: skip
