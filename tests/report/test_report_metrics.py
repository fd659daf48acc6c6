"""Facts: said once, and the same in terminal, Markdown, JSON, notebook and page."""

import dataclasses
import html
import io
import json
import re

import numpy as np
import pytest

import maniport as mp
from maniport.report import as_html, as_markdown, as_numbers, report_of
from maniport.report.console import Console
from maniport.report.metrics import statistics
from maniport.report.page import as_html as as_page
from maniport.report.values import Metric, Report, Section
from maniport.report.write import EXECUTION_FILES, RUN_FILES


@pytest.fixture(scope="module")
def warned(result, changed):
    """A run with warnings of its motion, its targets and a stage."""
    n, arm = len(result.time), result.arm
    missed = changed(result, {"gap": arm.gap + 1.0}, status=("ellipsoid missed",) * n)
    return dataclasses.replace(missed, warnings=("mind <the> step & the gap",))


def test_warnings_are_the_same_everywhere(warned):
    """Terminal, Markdown, JSON, notebook and page have the same warnings in the same order, the motion first."""
    facts, screen = report_of(warned), Console()
    screen._out.file = io.StringIO()
    screen.tell(facts)
    words = "waypoints are missed", "infeasible", "does not determine", "Mind <the>"
    places = [next(i for i, text in enumerate(facts.warnings) if word in text) for word in words]
    assert places == sorted(places)
    texts = [screen._out.file.getvalue(), as_markdown(facts), as_html(warned), as_page(facts)]
    for shown in (re.sub(r"\\(?=[^\w\s])", "", html.unescape(re.sub(r"</?a\b.*?>", "", text))) for text in texts):
        at = [shown.find(text) for text in facts.warnings]
        assert min(at) >= 0
        assert at == sorted(at)
    assert [one["text"] for one in as_numbers(facts)["warnings"]] == list(facts.warnings)
    assert all(one["key"] for one in as_numbers(facts)["warnings"])


def test_numbers_of_a_run(result):
    """JSON has maxima with their times and units in the names; nothing in it is infinite."""
    report, motion = report_of(result), result.arm.motion
    numbers = as_numbers(report)
    assert numbers["motion"]["distance"]["max"] == motion.distance.max()
    assert numbers["motion"]["distance"]["max_at_s"] == result.time[np.argmax(motion.distance)]
    assert numbers["motion"]["position_error_mm"]["max"] == pytest.approx(1e3 * motion.position_error.max())
    assert numbers["run"]["base_rotation"] == np.eye(3).tolist()
    assert "/root" not in json.dumps(numbers, allow_nan=False)
    assert re.search(r"\(median\).*\(95th percentile\).*\(max at [\d.]+ s\)", report.metric("distance").text)


def test_results_are_data_and_are_described_in_a_folder(small_result, alone, tmp_path):
    """`save` writes data alone; `write_results` also what people read, and returns the report."""
    small_result.save(tmp_path / "data")
    saved = {entry.name for entry in (tmp_path / "data").iterdir()}
    assert {name.split(".")[-1] for name in saved} == {"csv", "npz"}
    assert saved < set(RUN_FILES)
    alone.save(tmp_path / "motion")
    assert {entry.name for entry in (tmp_path / "motion").iterdir()} < set(EXECUTION_FILES)
    facts = mp.write_results(alone, tmp_path / "motion", overwrite=True)
    summary = json.loads((tmp_path / "motion" / "summary.json").read_text())
    assert summary["status"] == facts.summary.status
    assert [one["text"] for one in summary["warnings"]] == list(facts.warnings)


def test_a_spread_names_median_percentile_and_largest():
    """Of four values at four times; without times the number of the largest is told."""
    fact = statistics("Error", "error", [1.0, 4.0, 2.0, 3.0], [0.0, 0.5, 1.0, 1.5], "mm")
    assert fact.text == "2.50 mm (median), 3.85 mm (95th percentile), 4.00 mm (max at 0.5 s)"
    assert fact.value == {"median": 2.5, "p95": pytest.approx(3.85), "max": 4.0, "max_at_s": 0.5}
    assert statistics("Error", "error", [1.0, 4.0]).value["max_at"] == 1


def test_facts_without_text_stand_in_json_alone():
    """A number that nobody reads has a key, a sentence that no machine reads has none."""
    facts = Report(
        "t", "", (Section("s", (Metric("", "", key="hidden", value=1, unit="°"), Metric("a", "b")), key="k"),)
    )
    assert as_numbers(facts)["k"] == {"hidden_deg": 1}
    assert "hidden" not in as_markdown(facts) + as_html(facts) + as_page(facts).split("<body>")[1].split("<script>")[0]
    assert "- A: b." in as_markdown(facts)
