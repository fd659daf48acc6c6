"""The verdict: one answer, in plain words, wherever a result is told."""

import html
import io
import re
import shlex
from dataclasses import replace

import numpy as np
import pytest

import maniport as mp
from maniport.arms.collisions import Lowest
from maniport.errors import on_the_command_line
from maniport.motion.trajectory import Clearance
from maniport.pipeline.config import Config
from maniport.pipeline.execution import Execution
from maniport.report import as_html, as_markdown, as_numbers, facts_of
from maniport.report.console import Console
from maniport.report.page import as_html as as_page
from maniport.report.page.motions import motion_of
from maniport.report.summary import rounded_sum


@pytest.fixture(scope="module")
def facts(small_result):
    """What is told of the main job on a small scale."""
    return facts_of(small_result)


def complete(result):
    """A result that gives no reason for a warning: a tracked motion above the base plane, a person who is seen."""
    n = len(result.time)
    tracked = {"distance": np.full(n, 0.01), "position_error": np.zeros(n), "status": ("followed",) * n,
               "achieved": result.execution.motion.target}  # fmt: skip
    fit = replace(result.fit, determined=np.ones_like(result.fit.observable), quality_warnings=())
    execution = replace(result.execution, gap=np.zeros(len(result.time)))
    execution = replace(execution, motion=replace(execution.motion, **tracked))
    return replace(result, fit=fit, execution=execution, warnings=(), config=Config())


def test_green_needs_that_nothing_is_open(small_result):
    """Each thing that is assumed, unchecked or not met makes a result amber, under a key of its own."""
    whole = complete(small_result)
    facts = facts_of(whole)
    assert facts.warning_keys == ()
    assert (facts.summary.status, as_numbers(facts)["status"]) == ("green", "green")
    assert facts.summary.advice.startswith("Run it")
    assert facts.summary.title.startswith("Position tracked; ellipsoids tracked")
    assert not facts.summary.command  # which would plan anew, and another motion where limits or a table were given
    execution, n = whole.execution, len(whole.time)
    names = execution.motion.joint_names
    guessed = replace(execution.plan.limits, assumed={**execution.plan.limits.assumed, "acceleration": names[:2]})
    above = replace(execution.room, stand_ins=("panda_link3",))
    across = np.diag([1.0, 2.0, 4.0]), np.diag([4.0, 2.0, 1.0])
    tolerance = execution.motion.position_tolerance
    outlier = np.where(np.arange(n) == 0, 3.1 * tolerance, 0.0)
    for key, changes in {
        "assumed-acceleration-limits": {"plan": replace(execution.plan, limits=guessed)},
        "unchecked-collisions": {"room": Clearance()},
        "missing-meshes": {"room": above},
        "position-error": {"motion": replace(execution.motion, position_error=outlier)},
        "longest-axis": {"motion": replace(execution.motion, target=np.tile(across[0], (n, 1, 1)),
                                           achieved=np.tile(across[1], (n, 1, 1)))},
        "targets-missed": {"motion": replace(execution.motion, status=("ellipsoid missed",) * n)},
        "infeasible-targets": {"gap": np.ones(n)},
    }.items():  # fmt: skip
        found = facts_of(replace(whole, execution=replace(execution, **changes)))
        assert found.warning_keys == (key,)
        assert found.summary.status == "amber"
        assert "Run it" not in found.summary.advice
        assert key.replace("-", " ") in as_markdown(found).split("## Warnings")[0]
        assert as_numbers(found)["warnings"] == [{"key": key, "text": found.warnings[0]}]
    doubted = facts_of(replace(whole, fit=replace(whole.fit, quality_warnings=("the model and the person differ",))))
    assert (doubted.warning_keys, doubted.summary.status) == (("human-model",), "amber")


def test_what_goes_below_the_base_is_warned_of(small_result, monkeypatch):
    """Below the base plane the option that prevents it is named, unless a table was given; no text names one then."""
    whole = complete(small_result)
    for height, table, key in ((0.1, None, ()), (-0.136, None, ("below-base-plane",)), (-0.136, -0.2, ())):
        lowest = (Lowest("panda_link5", height, 0.0), Lowest("panda_link4", 0.2, 0.0))
        monkeypatch.setattr(Execution, "lowest_of_links", lowest)
        around = mp.Collisions.of(whole.robot, table=table)
        facts = facts_of(replace(whole, execution=replace(whole.execution, collisions=around)))
        assert facts.warning_keys == key
        points = as_numbers(facts)["motion"]["lowest_points"]
        assert points["panda_link5"]["height_mm"] == pytest.approx(1e3 * height)
        assert set(points) == {"panda_link5", "panda_link4"}
        told = as_markdown(facts).replace("--table", "").replace("table=0", "")
        assert ("the table" in told) == (table is not None)
        if key:
            assert "136 mm below the base plane" in facts.warnings[0]
            assert "table=0" in facts.warnings[0]
            with on_the_command_line():
                told = facts_of(replace(whole, execution=replace(whole.execution, collisions=around)))
            assert "--table 0" in told.warnings[0]
    monkeypatch.setattr(Execution, "lowest_of_links", ())
    assert facts_of(whole).warning_keys == ("unchecked-floor",)


def test_what_should_not_be_run_is_not_advised(small_result):
    """A motion beyond its limits, in a collision or held is red, and the advice is not to run it."""
    whole = complete(small_result)
    motion = whole.execution.motion
    quick = facts_of(
        replace(
            whole,
            execution=replace(whole.execution, motion=replace(motion, control_time=0.5 * motion.control_time)),
        )
    )
    assert quick.summary.text.startswith("It exceeds its limits of velocity")
    assert "--speed-scale 0.5" in quick.summary.command
    hit = Clearance(True, "", 0.25, -0.01, 0.0, ("a", "b"))
    struck = facts_of(replace(whole, execution=replace(whole.execution, room=hit)))
    assert struck.summary.text.startswith("The robot collides in 25.0% of the time.")
    held = np.arange(len(motion.held)) == 0
    stopped = facts_of(replace(whole, execution=replace(whole.execution, motion=replace(motion, held=held))))
    for facts, key in ((quick, "limits-exceeded"), (struck, "collision"), (stopped, "held")):
        assert facts.warning_keys == (key,)
        assert facts.summary.status == "red"
        assert "Run it" not in facts.summary.advice


def test_a_tip_beside_its_path_is_advised_what_may_help(small_result):
    """A path that was placed is not to be placed again: less tolerance where much was given, else more time."""
    off = {"distance": np.zeros(len(small_result.time)), "position_error": np.full(len(small_result.time), 0.05)}
    execution = small_result.execution
    for words, tolerance, placement in (
        ("--position-tolerance 5", 0.012, execution.placement),
        ("--speed-scale 0.5", 0.005, execution.placement),
        ("--place", 0.005, None),
    ):
        motion = replace(execution.motion, **off, position_tolerance=tolerance)
        moved = replace(execution, motion=motion, placement=placement)
        summary = facts_of(replace(small_result, execution=moved, config=Config())).summary
        assert words in summary.command
        assert summary.title.startswith("Position not tracked; ellipsoids tracked")


def test_the_next_command_keeps_what_was_asked_for(small_result):
    """It takes run.yaml and half of its speed scale; the orientation of a hand, which a profile lacks, is dropped."""
    execution, off = small_result.execution, np.full(len(small_result.time), 0.05)
    config = Config().changed(speed_scale=0.5, orientation="demonstrated")
    moved = replace(execution, motion=replace(execution.motion, position_error=off, position_tolerance=0.005))
    words = shlex.split(facts_of(replace(small_result, execution=moved, config=config)).summary.command)
    for name, value in (("--config", "{folder}/run.yaml"), ("--speed-scale", "0.25"), ("--orientation", "free")):
        assert words[words.index(name) + 1] == value


def test_the_summary_is_the_same_everywhere(small_result, facts):
    """Terminal, Markdown, JSON, notebook and page have the same sentences and metrics."""
    summary, screen = facts.summary, Console()
    screen._out.file = io.StringIO()
    screen.tell(facts, output="some folder")
    terminal = screen._out.file.getvalue()
    page = html.unescape(re.sub("<.*?>", "", as_page(facts, {"motion": [motion_of(small_result)]})))
    texts = as_markdown(facts), page, html.unescape(as_html(small_result))
    assert all(summary.title in " ".join(text.split()) for text in texts)
    assert as_numbers(facts)["verdict"]["title"] == summary.title
    assert summary.title[1:] in " ".join(terminal.split())
    assert all(text[2:30] in " ".join(terminal.split()) for text in facts.warnings)
    assert "some folder/report.html" in terminal
    assert len(terminal.splitlines()) <= 40
    for metric in summary.metrics[:2]:
        assert f"{metric.value['max']:.2f}" in terminal
        assert f"{metric.value['p95']:.2f}" in page


def test_parts_of_the_mean_distance_add_up(small_result, facts):
    """The printed parts add up to the printed sum, which is the mean distance."""
    mean, *parts = [
        round(1000 * float(number)) for number in re.findall(r"-?\d+\.\d+", facts.metric("mean_distance").text)
    ]
    assert mean == sum(parts) == round(1000 * small_result.execution.motion.distance.mean())
    for values in ((0.0024, 0.3334, 0.0444), (0.0005, 0.0005, 0.0005), (0.2, -0.0104, 0.1206)):
        total, printed = rounded_sum(values)
        assert float(total) == pytest.approx(sum(map(float, printed)))
