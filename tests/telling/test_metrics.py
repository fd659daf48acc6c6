"""Facts: said once, and the same in terminal, Markdown, JSON, notebook and page."""

import dataclasses
import html
import io
import json
import re

import numpy as np
import pytest

import maniport as mp
from maniport.demonstrations.data_quality import doubts_of
from maniport.errors import IdentifiabilityWarning
from maniport.evaluation import RMSE
from maniport.pipeline.follow import follow
from maniport.studies.paper.outcome import Experiment, Outcome
from maniport.studies.paper.report import Reproduction
from maniport.studies.paper.tables import PaperRow
from maniport.telling import as_html, as_markdown, as_numbers, facts_of
from maniport.telling.console import Console
from maniport.telling.metrics import Metric, Report, Section, statistics
from maniport.telling.page import as_html as as_page
from maniport.telling.write import EXECUTION_FILES, RUN_FILES


@pytest.fixture(scope="module")
def motion():
    """The Panda follows ellipsoids of its own, a path that it cannot reach in part."""
    panda = mp.load_arm("panda")
    joints = np.linspace([0, -0.5, 0, -2, 0, 1.8, 0], [0.1, -0.4, 0.1, -1.8, 0.1, 1.9, 0], 15)
    path = panda.forward(joints)[:, :3, 3] + np.linspace(0, 1, 15)[:, None]
    return follow(panda, panda.manipulability(joints), np.linspace(0, 1, 15), path, place=False)


@pytest.fixture(scope="module")
def told(small_result, motion):
    """A run, a robot's motion, and an evaluation: each with its facts."""
    execution = small_result.execution
    missed = dataclasses.replace(execution.motion, status=("ellipsoid missed",) * len(execution.motion.time))
    far = dataclasses.replace(execution, gap=execution.gap + 1.0, motion=missed)
    warned = dataclasses.replace(small_result, warnings=("mind <the> step & the gap",), execution=far)
    return {thing: (one, facts_of(one)) for thing, one in (("run", warned), ("motion", motion),
                                                           ("evaluation", small_result.evaluation))}  # fmt: skip


def in_terminal(facts):
    """Warnings of what a terminal is sent."""
    screen = Console()
    screen._out.file = io.StringIO()
    screen.tell(facts)
    return in_markdown(screen._out.file.getvalue())


def in_markdown(text):
    """Warnings of a page in Markdown."""
    _, mark, rest = text.partition("## Warnings\n\n")
    lines = [re.sub(r"\\(?=[^\w\s])", "", line) for line in rest.split("\n\n")[0].splitlines()]  # as they are rendered
    return [line.removeprefix("- ") for line in lines] if mark else []


def in_notebook(text):
    """Warnings of a piece of a notebook: those beside the label and the rows below it."""
    rows = re.findall(r"<tr><th[^>]*>(.*?)</th><td[^>]*>(.*?)</td></tr>", text.split("</table>")[0])
    return [html.unescape(value) for _, value in rows] if rows[:1] and rows[0][0] == "warnings" else []


def in_page(text):
    """Warnings of a page: at its head, or first in what is folded."""
    items = re.findall(r"<li>(.*?)</li>", text.partition('class="mind"')[2].partition("</ul>")[0])
    return [html.unescape(re.sub("<.*?>", "", item)) for item in items]


@pytest.mark.parametrize("thing", ["run", "motion", "evaluation"])
def test_warnings_are_the_same_everywhere(told, thing):
    """Terminal, Markdown, JSON, notebook and page name the same warnings in the same words and order."""
    one, facts = told[thing]
    expected = list(facts.warnings)
    assert expected or thing == "evaluation"
    assert in_terminal(facts) == expected
    assert in_markdown(as_markdown(facts)) == expected
    assert [one["text"] for one in as_numbers(facts)["warnings"]] == expected
    assert all(one["key"] for one in as_numbers(facts)["warnings"])
    assert in_notebook(as_html(one)) == expected
    assert in_page(as_page(facts))[: len(expected)] == expected


def test_a_run_warns_of_what_stands_in_the_way_worst_first(told):
    """First what the motion misses, then what cannot be made, the person, and what the steps warned of."""
    run, facts = told["run"]
    words = "waypoints are missed", "infeasible", "does not determine", "Mind <the>"
    places = [next(i for i, text in enumerate(facts.warnings) if word in text) for word in words]
    assert places == sorted(places)
    assert all(name in " ".join(facts.warnings) for name in run.fit.undetermined)


def test_the_largest_and_its_moment_stand_beside_median_and_95_percent(told):
    """The distance, the gap, the node floor and the tip's error have them in text and numbers."""
    run, facts = told["run"]
    motion, numbers = run.execution.motion, as_numbers(facts)
    assert numbers["motion"]["distance"]["max"] == motion.distance.max()
    assert numbers["motion"]["distance"]["max_at_s"] == run.time[np.argmax(motion.distance)]
    assert numbers["motion"]["tip_error_mm"]["max"] == pytest.approx(1e3 * motion.position_error.max())
    for key in ("distance", "feasibility_gap", "tip_error", "node_floor"):
        assert re.search(r"\(median\).*\(95th percentile\).*\(max at [\d.]+ s\)", facts.metric(key).text)
    at = facts_of(run.fit).sections[0].tables[0].value["hand"]["max_at_s"]
    assert run.fit.residual[np.flatnonzero(run.fit.time == at)[0], -1] == run.fit.residual[:, -1].max()


def test_a_tip_far_from_its_path_is_warned_of(motion):
    """An error of more than three times the tolerance at any time is a warning, however good the median is."""
    error, facts = motion.motion.position_error, facts_of(motion)
    assert error.max() > 3.0 * motion.motion.tip_tolerance
    assert "position-error" in facts.warning_keys
    assert any(f"{1e3 * error.max():.1f} mm" in text for text in facts.warnings)
    near = dataclasses.replace(motion.motion, position_error=error * 2.9 * motion.motion.tip_tolerance / error.max())
    assert "position-error" not in facts_of(dataclasses.replace(motion, motion=near)).warning_keys


def test_a_person_who_is_fitted_badly_is_warned_of(small_result):
    """A segment far from the model and joints that are held back by limits come first, with what to do."""
    fit = small_result.fit
    residual = np.full_like(fit.residual, 1.0)
    residual[:, 1] = 44.0
    bad = dataclasses.replace(fit, residual=residual, beyond_limit=np.full_like(fit.joint_angles, 13.0))
    text = " ".join(facts_of(dataclasses.replace(bad, doubts=tuple(doubts_of(bad)))).warnings)
    assert "the forearm is 44.0° (median) from what was measured" in text
    assert "the upper arm is" not in text
    held = [name in fit.undetermined or f"{name} would go beyond its limit of" in text for name in fit.joint_names]
    assert all(held)
    assert "side='left'" in text


def test_what_stands_in_json_stands_in_text(told):
    """Units are in the names, nothing is infinite, and no home of the user is told."""
    numbers = json.dumps(as_numbers(told["run"][1]), allow_nan=False)
    assert "tip_error_mm" in numbers
    assert "/root" not in numbers
    assert as_numbers(told["run"][1])["run"]["mounting"] == np.eye(3).tolist()


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


def test_results_are_data_and_are_told_of_in_a_folder(small_result, motion, tmp_path):
    """`save` writes data alone; `write_results` what people read as well, and gives the facts."""
    small_result.save(tmp_path / "data")
    motion.save(tmp_path / "motion")
    saved = {entry.name for entry in (tmp_path / "data").iterdir()}
    assert {name.split(".")[-1] for name in saved} == {"csv", "npz"}
    assert saved < set(RUN_FILES)
    assert {entry.name for entry in (tmp_path / "motion").iterdir()} < set(EXECUTION_FILES)
    facts = mp.write_results(motion, tmp_path / "motion", overwrite=True)
    assert facts.warnings == facts_of(motion).warnings
    summary = json.loads((tmp_path / "motion" / "summary.json").read_text())
    assert summary["status"] == facts.summary.status == "amber"
    assert summary["warnings"] == [
        {"key": key, "text": text} for key, text in zip(facts.warning_keys, facts.warnings, strict=True)
    ]


def outcome(settings, per_dispersion, warned):
    """An outcome of an experiment on two evaluation sets, with an error for each draw."""
    row = PaperRow("I", 1, "toy", 10, "PT", {"E": 0.5, "F": 0.5}, "identity", None, None, None)
    errors = tuple(RMSE(1.0, error, 1.0) for error in per_dispersion)
    fit = (1.0, 0.1, len(errors), 0, warned, (IdentifiabilityWarning,) * warned)  # iterations, seconds, draws, seed
    return Outcome(row, "toy", "10", "PT", settings, "A()", {"E": errors, "F": errors}, *fit)


def test_paper_stands_beside_what_came_out():
    """A row for the paper and for each setting and form of the error, a column for each evaluation set."""
    both = (outcome("paper's", (0.125, 0.375), 0), outcome("ours", (1e-6,), 1))
    experiment = Experiment("toy", "Table I", ("How.",), both, {"width": 2.0})
    facts = facts_of(Reproduction((experiment,), 3, 12.0))
    table = facts.sections[0].tables[0]
    assert table.columns[-3:] == ("numbers of", "E", "F")
    rows = {"paper": "0.500", "paper's ÷ c": "0.250 ± 0.125", "paper's ÷ c²": "1.000 ± 0.000"}
    rows |= {"ours ÷ c": "1e-06", "ours ÷ c²": "1.000"}
    assert table.rows == tuple(("toy", "10", "PT", name, cell, cell) for name, cell in rows.items())
    assert "in 1 of 1 fits that the domains do not determine the rotation" in facts.warnings[0]
    assert as_numbers(facts)["toy"]["rows"][2]["per_dispersion"] == 1e-6
    assert "IROS 2022" in as_page(facts)


def test_of_semi_axes_the_farthest_is_told_with_its_moment(small_result):
    """Beside the median of achieved over target stands the ratio that is farthest from 1, and when."""
    motion = small_result.execution.motion
    told = facts_of(small_result).metric("semi_axes").value
    for name, column in zip(("minor", "middle", "major"), motion.semi_axis_ratio.T, strict=True):
        assert told[name]["median"] == pytest.approx(np.median(column))
        assert abs(np.log(told[name]["max"])) == pytest.approx(np.abs(np.log(column)).max())
        at = np.flatnonzero(small_result.time == told[name]["max_at_s"])
        assert column[at] == pytest.approx(told[name]["max"])
