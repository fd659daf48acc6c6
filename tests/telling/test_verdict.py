"""The verdict: one answer, in plain words, wherever a result is told."""

import html
import io
import re
import shlex
from dataclasses import replace

import numpy as np
import pytest

from maniport.telling import Card, as_html, as_markdown, as_numbers, facts_of
from maniport.telling.console import Console
from maniport.telling.facts import in_axes
from maniport.telling.page import as_html as as_page
from maniport.telling.page.motions import motion_of
from maniport.tracking.plan.room import Room


@pytest.fixture(scope="module")
def facts(small_result):
    """What is told of the main job on a small scale."""
    return facts_of(small_result)


def changed(result, **motion):
    """A result whose motion came out otherwise."""
    moved = replace(result.execution.motion, **motion)
    return facts_of(replace(result, execution=replace(result.execution, motion=moved))).verdict


def test_the_verdict_is_the_same_everywhere(small_result, facts):
    """Terminal, Markdown, JSON, notebook and page say it in the same words, with the same figures."""
    verdict, screen = facts.verdict, Console()
    screen._out.file = io.StringIO()
    screen.tell(facts, output="out")
    page = html.unescape(re.sub("<.*?>", "", as_page(facts, {"motion": [motion_of(small_result)]})))
    told = screen._out.file.getvalue(), as_markdown(facts), page, html.unescape(as_html(small_result))
    assert all(verdict.title in " ".join(text.split()) for text in told)
    assert as_numbers(facts)["verdict"]["title"] == verdict.title
    for card in verdict.cards:
        assert card.text in told[1]
        assert all(piece in page for piece in (card.value, *card.details))


def test_the_last_eight_lines_of_a_terminal_are_the_answer(facts):
    """Verdict, three figures with their largest, a command that takes the results, and where to look."""
    screen = Console()
    screen._out.file = io.StringIO()
    screen.tell(facts, output="some/folder")
    last = screen._out.file.getvalue().split("\n\n")[-1].strip().splitlines()
    assert len(last) <= 8
    assert facts.verdict.title.split()[0] in " ".join(last)
    assert sum(line.startswith("  ") for line in last) == 3
    assert all("largest" in line for line in last if line.startswith(("  ellipsoids", "  tip")))
    assert last[-2].startswith("next: maniport ")
    assert "{" not in last[-2]
    assert last[-1] == "open some/folder/report.html"


def test_moments_are_links(small_result, facts):
    """Each "at 3.4 s" leads there on a page with a motion, and is plain text on one without."""
    text = as_page(facts, {"motion": [motion_of(small_result)]}).split("<script")[0]
    for card in facts.verdict.cards[:2]:
        when = re.search(r"at ([\d.]+) s", card.details[-1])[1]
        assert f'<a href="#t={when}">at {when} s</a>' in text
    assert "#t=" not in as_page(facts).split("<script")[0]


def test_words_follow_the_figures(small_result):
    """A tip that is far off and ellipsoids that are near are called so; a far tip is an alarm with its moment."""
    count = len(small_result.time)
    exact = changed(small_result, distance=np.full(count, 0.01), position_error=np.zeros(count))
    assert exact.title == "The tip follows its path, and the ellipsoids follow."
    assert exact.good
    off = changed(small_result, distance=np.full(count, 2.0), position_error=np.full(count, 0.02))
    assert off.title == "The tip does not follow its path; the ellipsoids do not follow."
    assert "20.0 mm" in off.cards[1].alarm
    assert not off.good
    assert "2.7 times as long" in off.text


def test_what_should_not_be_run_is_not_advised(small_result):
    """A motion beyond its limits or in a collision is said to be so first, and nobody is told to run it."""
    count = len(small_result.time)
    near = {"distance": np.full(count, 0.01), "position_error": np.zeros(count)}
    run = changed(small_result, **near)
    assert run.advice.startswith("Run it")
    assert not run.command  # which would plan anew, and another motion where limits or a table were given
    motion = small_result.execution.motion
    quick = changed(small_result, **near, control_time=0.5 * motion.control_time)
    assert quick.text.startswith("It exceeds its limits of velocity")
    assert "--tempo 0.5" in quick.command
    execution = replace(small_result.execution, room=Room(True, "", 0.25, -0.01, 0.0, ("a", "b")))
    struck = facts_of(replace(small_result, execution=replace(execution, motion=replace(motion, **near)))).verdict
    assert struck.text.startswith("The robot collides in 25.0% of the time.")
    assert (quick.good, struck.good) == (False, False)
    assert "Run it" not in quick.advice + struck.advice


def test_collisions_that_nobody_looked_for_are_told(small_result):
    """A good motion of a robot without shapes is to be run with care, and the verdict says why."""
    count = len(small_result.time)
    near = {"distance": np.full(count, 0.01), "position_error": np.zeros(count)}
    execution = small_result.execution
    for known in (True, False):
        room = Room(known, "" if known else "no shapes", 0.0, 0.1, 0.0, ("a", "b"))
        moved = replace(execution, room=room, motion=replace(execution.motion, **near))
        verdict = facts_of(replace(small_result, execution=moved)).verdict
        assert verdict.good
        assert ("Collisions were not checked." in verdict.text) == (not known)
        assert ("with care" in verdict.advice) == (not known)


def test_a_tip_beside_its_path_is_advised_what_may_help(small_result):
    """A path that was placed is not to be placed again: less tolerance where much was given, else more time."""
    off = {"distance": np.zeros(len(small_result.time)), "position_error": np.full(len(small_result.time), 0.02)}
    assert "--tip-tolerance 5" in changed(small_result, **off, tip_tolerance=0.012).command
    assert "--tempo 0.5" in changed(small_result, **off, tip_tolerance=0.005).command
    execution = replace(small_result.execution, placement=None)
    motion = replace(execution.motion, **off)
    told = facts_of(replace(small_result, execution=replace(execution, motion=motion))).verdict
    assert "--place" in told.command


def test_errors_at_leaps_of_the_recording_are_told_as_such(small_result):
    """Where the path leaps and the tip is farthest there, the doubt is the recording's; without a leap none is."""
    execution, count = small_result.execution, len(small_result.time)
    leap = np.zeros((count, 3))
    leap[count // 2 :] = 0.5
    error = np.where(execution.plan.leaps, 0.0, 0.001)
    error[count // 2] = 0.05
    motion = replace(execution.motion, position_error=error)
    for path, said in ((execution.plan.path, False), (execution.plan.path + leap, True)):
        plan = replace(execution.plan, path=path)
        told = facts_of(replace(small_result, execution=replace(execution, plan=plan, motion=motion))).verdict
        assert ("where the recording leaps" in told.doubts) == said


def test_the_next_command_keeps_what_was_asked_for(small_result):
    """A table, a file of limits or half the tempo hold for the next motion, too, which is slower than that."""
    execution, off = small_result.execution, np.full(len(small_result.time), 0.02)
    asked = replace(execution, options={"--table": "-0.1", "--tempo": "0.5", "--limits": "my limits.yaml"})
    moved = replace(asked, motion=replace(execution.motion, position_error=off, tip_tolerance=0.005))
    words = shlex.split(facts_of(replace(small_result, execution=moved)).verdict.command)
    for name, value in (("--table", "-0.1"), ("--tempo", "0.25"), ("--limits", "my limits.yaml")):
        assert words.count(name) == 1
        assert words[words.index(name) + 1] == value


def test_commands_are_typed_safely(facts):
    """A folder with a blank and braces comes through the shell as one word."""
    words = shlex.split(facts.verdict.typed("my {results}"))
    assert words[:3] == ["maniport", "track", "my {results}/placed_profile.npz"]


def test_parts_add_up_to_the_mean(small_result, facts):
    """What the card of the ellipsoids is the sum of, is the mean distance."""
    parts = facts.verdict.cards[0].parts
    assert sum(part for _, part in parts) == pytest.approx(small_result.execution.motion.distance.mean())


def test_distances_are_told_as_lengths_of_an_axis():
    """The distance of two ellipsoids that differ in one axis tells by how much."""
    assert in_axes(2.0 * np.log(1.05)) == "one axis 5 % too long"
    assert in_axes(2.0 * np.log(2.0)) == "one axis 2.0 times as long"
    assert Card("a", "1", "median", ("2",)).text == "1 (median), 2"
