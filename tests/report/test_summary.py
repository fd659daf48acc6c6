"""The summary: status, outcome and next step, the same in all renderings."""

import html
import io
import json
import re
import shlex
from dataclasses import replace

import numpy as np
import pytest

import maniport as mp
from maniport.arms import Arm
from maniport.arms.collisions import Lowest
from maniport.errors import on_the_command_line
from maniport.motion.trajectory import Clearance
from maniport.pipeline.config import Config
from maniport.pipeline.results import RESULT_FILES, ArmResult
from maniport.report import as_markdown, as_numbers, report_of
from maniport.report.console import Console
from maniport.report.describe.motions import add_statistics
from maniport.report.page import as_html as as_page
from maniport.report.page.animation import animation_of
from maniport.report.values import Metric, Report, Section


@pytest.fixture(scope="module")
def complete(result, changed):
    """A result without a reason for a warning: a tracked motion, and a person who is fully observed."""
    n = len(result.time)
    arm = result.arm
    tracked = {
        "distance": np.full(n, 0.01),
        "position_error": np.zeros(n),
        "status": ("followed",) * n,
        "achieved": arm.motion.target,
        "directed": False,
    }
    fit = replace(arm.fit, unobservable={}, quality_warnings=())
    config = Config().changed(recording=("ladder",))
    return replace(
        changed(result, {"fit": fit, "gap": np.zeros(n)}, **tracked), warnings=(), config=config
    )


def test_the_status_is_the_worst_of_all_metrics(complete, changed):
    """Green without warnings; each assumption, omitted check and missed target is amber; red prohibits the motion."""
    report = report_of(complete)
    assert (report.warning_keys, report.status, as_numbers(report)["status"]) == (
        (),
        "green",
        "green",
    )
    assert report.outcome.startswith("Position tracked; ellipsoids tracked")
    assert not report.advice + report.command
    motion = complete.arm.motion
    n = len(complete.time)
    assumed = replace(
        motion.limits, assumed={**motion.limits.assumed, "acceleration": motion.joint_names[:2]}
    )
    target, achieved = (
        np.tile(np.diag(axes), (n, 1, 1)) for axes in ([1.0, 2.0, 4.0], [4.0, 2.0, 1.0])
    )
    outlier = np.where(np.arange(n) == 0, 3.1 * motion.position_tolerance, 0.0)
    text = "model and person differ"
    fit = replace(complete.arm.fit, quality_warnings=(text,), model_warnings=(text,))
    jumping = replace(complete.arm.fit, quality_warnings=("joints jump",))
    for key, status, changes in (
        ("assumed-acceleration-limits", "amber", {"limits": assumed}),
        ("unchecked-collisions", "amber", {"clearance": Clearance()}),
        (
            "missing-meshes",
            "amber",
            {"clearance": replace(motion.clearance, stand_ins=("panda_link3",))},
        ),
        ("position-error", "amber", {"position_error": outlier}),
        ("longest-axis", "amber", {"target": target, "achieved": achieved}),
        (
            "targets-missed",
            "amber",
            {"status": ("ellipsoid missed",) * 2 + ("followed",) * (n - 2)},
        ),
        ("infeasible-targets", "amber", {"arm": {"gap": np.ones(n)}}),
        ("human-model", "amber", {"arm": {"fit": fit}}),
        ("recording", "amber", {"arm": {"fit": jumping}}),
        ("limits-exceeded", "red", {"control_time": 0.5 * motion.control_time}),
        ("collision", "red", {"clearance": Clearance(True, "", 0.25, -0.01, 0.0, ("a", "b"))}),
        ("held", "red", {"held": np.arange(len(motion.held)) == 0}),
    ):
        report = report_of(changed(complete, **changes))
        keys = report.warning_keys
        assert (keys[0], set(keys) <= {key, "torques-exceeded"}, report.status) == (
            key,
            True,
            status,
        )
        assert report.advice.startswith("Do not execute") == (status == "red")
        assert ("--speed-scale 0.5" in report.command) == (key == "limits-exceeded")
        assert key.replace("-", " ") in as_markdown(report).split("## Warnings")[0]
        assert as_numbers(report)["warnings"][0] == {"key": key, "text": report.warnings[0]}
        if key == "targets-missed":  # the sentence has the same count as the warning
            assert f"{n - 2} of {n} waypoints reached" in report.outcome
            assert f"2 of {n} waypoints are missed (ellipsoid: 2)" in report.warnings[0]


def test_links_below_the_base_plane_are_a_warning(complete, changed, monkeypatch):
    for height, table, key in (
        (0.1, None, ()),
        (-0.136, None, ("below-base-plane",)),
        (-0.136, -0.2, ()),
    ):
        monkeypatch.setattr(ArmResult, "lowest", Lowest("panda_link5", height, 0.0))
        collisions = mp.Collisions.of(complete.arm.robot, table=table)
        report = report_of(changed(complete, {"collisions": collisions}))
        assert report.warning_keys == key
        value = {
            name: as_numbers(report)["motion"]["lowest_point"][name]
            for name in ("link", "height_mm")
        }
        assert value == {"link": "panda_link5", "height_mm": pytest.approx(1e3 * height)}
        if key:
            assert re.search("136 mm below the base plane.* table=0 ", report.warnings[0])
            with on_the_command_line():
                assert (
                    "--table 0"
                    in report_of(changed(complete, {"collisions": collisions})).warnings[0]
                )
    arm = complete.arm.robot
    torso = Arm(replace(arm.chain, on_base_plane=False))
    report = report_of(changed(complete, {"robot": torso}))
    assert report.warning_keys == ()
    assert "lowest_point" not in as_numbers(report)["motion"]
    monkeypatch.setattr(ArmResult, "lowest", None)
    assert report_of(changed(complete)).warning_keys == ("unchecked-floor",)
    assert report_of(changed(complete, {"robot": torso})).warning_keys == ()


def test_the_advice_suits_a_missed_path(result, changed):
    n = len(result.time)
    placement = result.arm.placement
    for words, tolerance, own in (
        ("--position-tolerance 5", 0.012, placement),
        ("--speed-scale 0.25", 0.005, placement),
        ("--place", 0.005, None),
    ):
        missed = {
            "distance": np.zeros(n),
            "position_error": np.full(n, 0.05),
            "position_tolerance": tolerance,
            "directed": False,
        }
        config = Config().changed(speed_scale=0.5, recording=("ladder",))
        report = report_of(replace(changed(result, {"placement": own}, **missed), config=config))
        assert words in report.command
        assert report.outcome.startswith("Position not tracked; ellipsoids tracked")
        assert shlex.split(report.command)[:4] == [
            "maniport",
            "transfer",
            "--config",
            "{folder}/run.yaml",
        ]


def test_all_renderings_have_the_same_sentences(result, changed):
    n = len(result.time)
    arm = result.arm
    missed = changed(result, {"gap": arm.gap + 1.0}, status=("ellipsoid missed",) * n)
    report = report_of(replace(missed, warnings=("mind <the> step & the gap",)))
    console = Console()
    console._out.file = io.StringIO()
    console.print_report(report, output="some folder")
    lines = console._out.file.getvalue().splitlines()
    terminal = " ".join(" ".join(lines).split())
    title = report.outcome
    page = as_page(report, animation_of(missed))
    for rendered in (as_markdown(report), page):
        text = re.sub(r"\\(?=[^\w\s])", "", html.unescape(re.sub(r"</?a\b.*?>", "", rendered)))
        at = [text.find(warning) for warning in report.warnings]
        assert min(at) >= 0
        assert at == sorted(at)
        assert title in " ".join(text.split())
    numbers = as_numbers(report)
    assert [one["text"] for one in numbers["warnings"]] == list(report.warnings)
    assert all(one["key"] for one in numbers["warnings"])
    assert numbers["summary"]["title"] == title
    assert title[1:] in terminal
    assert "some folder/report.html" in terminal
    assert len(lines) <= 25
    measured = [metric for metric in report.main_metrics if metric.statistics is not None]
    assert len(measured) >= 2
    for metric in measured:
        assert metric.statistics.cells[2] in terminal
        assert metric.statistics.cells[1] in page


def test_results_are_written_to_a_folder(small_result, alone, tmp_path):
    """`save` writes data alone; `write_results` also summaries, with times and units, and returns the report."""
    small_result.save(tmp_path / "data")
    saved = {entry.name for entry in (tmp_path / "data").iterdir()}
    assert {name.split(".")[-1] for name in saved} == {"csv", "npz"}
    assert saved < RESULT_FILES
    alone.save(tmp_path / "motion")
    assert {entry.name for entry in (tmp_path / "motion").iterdir()} < RESULT_FILES
    report = mp.write_results(alone, tmp_path / "motion", overwrite=True)
    motion = alone.arm.motion
    summary = json.loads((tmp_path / "motion" / "summary.json").read_text())
    assert summary["status"] == report.status
    assert [one["text"] for one in summary["warnings"]] == list(report.warnings)
    distance = summary["motion"]["distance"]
    assert (distance["max"], distance["max_at_s"]) == (
        motion.distance.max(),
        motion.time[np.argmax(motion.distance)],
    )
    assert summary["motion"]["position_error_mm"]["max"] == pytest.approx(
        1e3 * motion.position_error.max()
    )
    assert "/root" not in json.dumps(as_numbers(report_of(small_result)), allow_nan=False)


def test_statistics_are_median_percentile_and_maximum():
    section = Section("")
    add_statistics(section, "orientation_error", [1.0, 4.0, 2.0, 3.0], [0.0, 0.5, 1.0, 1.5])
    (metric,) = section.metrics
    assert metric.text == "median 2.50, 95th percentile 3.85, max 4.00 at 0.5 s"
    assert metric.value.numbers == {
        "median": 2.5,
        "p95": pytest.approx(3.85),
        "max": 4.0,
        "max_at_s": 0.5,
    }


def test_metrics_without_text_are_in_json_alone():
    metrics = Metric("", "", key="hidden", value=1, unit="°"), Metric("a", "b")
    report = Report("t", "", (Section("s", metrics, key="k"),))
    assert as_numbers(report)["k"] == {"hidden_deg": 1}
    body = as_page(report).split("<body>")[1].split("<script>")[0]
    assert "hidden" not in as_markdown(report) + body
    assert "- A: b\n" in as_markdown(report)


def test_all_arms_are_reported(result, several):
    for report in (report_of(result), report_of(several(3))):
        lines = as_markdown(report).splitlines()
        assert len(lines) <= 64
        assert max(len(line) for line in lines if line.startswith("|")) <= 100
    names = ("left", "right", "middle")
    keys = [section.key for section in report.sections]
    assert keys[0] == "arms"
    for name in names:
        assert {f"{name}_motion", f"{name}_placement", f"{name}_adapter", f"{name}_person"} <= set(
            keys
        )
    assert keys.count("recording") == 1
    assert [report.outcome.count(f"{name.capitalize()}: position") for name in names] == [1] * 3
    labels = [metric.label for metric in report.main_metrics]
    strong = [label for label in labels if label.endswith("force where person is strong")]
    assert strong == [f"{name.capitalize()}: force where person is strong" for name in names]
    assert labels[: len(strong)] == strong
    distances = [label for label in labels if label.endswith("ellipsoid distance")]
    assert distances == [f"{name.capitalize()}: ellipsoid distance" for name in names]
    assert labels.count("Duration") == labels.count("Collisions") == 1
    numbers = as_numbers(report)
    assert numbers["arms"]["relative_position_error_mm"]["max"] == pytest.approx(1.0)
    assert numbers["left_motion"]["distance"] == numbers["right_motion"]["distance"]


def test_parts_of_the_mean_distance_add_up(result):
    text = next(
        metric.text for metric in report_of(result).metrics if metric.key == "mean_distance"
    )
    mean, *parts = [round(1000 * float(number)) for number in re.findall(r"-?\d+\.\d+", text)]
    assert mean == sum(parts) == pytest.approx(1000 * result.arm.motion.distance.mean(), abs=1.5)
