"""The page as a file: structure, safety, size, and its data."""

import base64
import hashlib
import re

import numpy as np
import pytest
from pages import Page, motion_of, page_of

from maniport.errors import InvalidInputError
from maniport.report.page.animation import semi_axis_panels
from maniport.report.page.content import Animation, Body, Line, Panel, Stage, unpacked
from maniport.report.values import Metric, Table


@pytest.fixture(scope="module")
def animation(motion):
    time, teacher = motion(3, 40)
    skeleton = np.cumsum(np.ones((40, 4, 3)) * np.linspace(0.1, 0.2, 40)[:, None, None], axis=1)
    panels = {"Ellipsoids": semi_axis_panels({"person": teacher, "target": 2 * teacher}, "m/s")}
    stages = (Stage("person", (Body("person", skeleton, {"person": teacher}),)),)
    return Animation(time, stages, panels, unit="m/s")


def read(text):
    return unpacked(motion_of(text))


def test_the_page_loads_nothing(animation):
    """The page is well-formed; it has no address with http and no link out, and a policy forbids all but its parts."""
    text = page_of(
        Metric("n", "1", "what"), Table(("a",), (("b",),), "caption"), animation=animation
    )
    page = Page(text)
    assert page.open == []
    assert ("html", {"lang": "en"}) in page.elements
    assert {"title", "h1", "main", "footer", "table", "dl", "noscript"} <= {
        tag for tag, _ in page.elements
    }
    for tag, attributes in page.elements:
        for name in ("src", "href", "action", "srcset", "poster", "data"):
            assert attributes.get(name, "data:").startswith(("data:", "#")), (tag, attributes)
    rest = text.replace("http://www.w3.org/2000/svg", "")  # a name, not an address
    assert not re.search(
        r"https?://|//[a-z]+\.|@import|fetch\(|XMLHttpRequest|WebSocket|import\(|url\(", rest
    )
    policy = next(
        a["content"] for _, a in page.elements if a.get("http-equiv") == "Content-Security-Policy"
    )
    assert "default-src 'none'" in policy
    assert not re.search("connect|unsafe", policy)
    script = next(data for attributes, data in page.scripts if not attributes)
    for part in (script, page.styles[0]):
        assert base64.b64encode(hashlib.sha256(part.encode()).digest()).decode() in policy


def test_data_are_the_arrays_of_the_animation(animation):
    data = read(page_of(animation=animation))
    body = animation.stages[0].bodies[0]
    (decoded,) = data["stages"][0]["bodies"]
    assert data["start"] == animation.time[0]
    pairs = [
        (data["time"], animation.time - animation.time[0]),
        (decoded["skeleton"], body.skeleton),
        (
            decoded["ellipsoids"]["person"],
            body.ellipsoids["person"][:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]],
        ),
    ]
    for panel, drawn in zip(
        animation.panels["Ellipsoids"], data["panels"]["Ellipsoids"], strict=True
    ):
        pairs += [(b["values"], a.values) for a, b in zip(panel.lines, drawn["lines"], strict=True)]
    for values, array in pairs:
        np.testing.assert_array_equal(values, array.astype(np.float32))


def test_the_page_of_a_long_motion_is_small():
    count = 20_000
    time = np.arange(count) / 100.0
    values = np.random.default_rng(0).normal(size=count)
    skeleton = np.random.default_rng(1).normal(size=(count, 8, 3))
    shells = np.broadcast_to(np.eye(3), (count, 3, 3))
    drawn = dict.fromkeys(("person", "target", "achieved"), shells)
    stages = tuple(
        Stage(name, (Body(name, skeleton, drawn, skeleton[:, -1]),)) for name in ("a", "b")
    )
    panels = {"all": tuple(Panel(str(k), "", (Line("x", values),)) for k in range(50))}
    text = page_of(animation=Animation(time, stages, panels))
    assert len(text.encode()) < 6_000_000
    data = read(text)
    assert (data["time"][0], data["time"][-1]) == (0.0, np.float32(time[-1]))
    assert len(data["time"]) <= 1500
    with pytest.raises(InvalidInputError, match="6 MB"):
        page_of(Metric("n", "x" * 6_000_000))


def test_texts_cannot_become_elements(animation):
    evil = "</script><script>alert(1)</script>"
    stage = Stage(evil, (Body(evil, animation.stages[0].bodies[0].skeleton),))
    drawn = Animation(animation.time, (stage,))
    text = page_of(Metric(evil, evil, evil), animation=drawn, warnings=(evil,), title=evil)
    assert "<script>alert" not in text
    assert read(text)["stages"][0]["bodies"][0]["name"] == evil
    assert len(Page(text).scripts) == 2
