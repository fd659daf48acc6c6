"""Notebook displays and prompts of objects: small, escaped tables, and short lines."""

import warnings

import numpy as np
import pytest
from pages import Page
from sklearn.base import clone

import maniport as mp
from maniport.report import as_html
from maniport.report.values import Metric, Report, Section, Table
from maniport.transfer import Search
from sizes import motion_alone, panda_profile


@pytest.fixture(scope="module")
def objects(small_result):
    person, (panda, time, joints, profile, path) = mp.load_arm("myoarm"), panda_profile()
    teacher, student = mp.sample_domain(person, 64, 0), mp.sample_domain(panda, 96, 1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mp.errors.ManiportWarning)
        icp = mp.RiemannianICP(damping=0.01, random_state=0, search=Search(n_starts=2)).fit(teacher, student)
    bank = mp.SeedBank(panda, 1024, 0)
    return {
        "Arm": panda,
        "Recording": small_result.recording,
        "ArmFit": small_result.arm.fit,
        "RiemannianICP": icp,
        "Identifiability": icp.identifiability_,
        "Placement": small_result.arm.placement,
        "ArmMotion": mp.track(panda, profile, path=path, time=time, start=joints[0]).arms[0],
        "FeasibleEllipsoids": mp.nearest_feasible(panda, profile, positions=path, bank=bank),
        "MotionResult": motion_alone(small_result),
        "TransferResult": small_result,
        "Evaluation": small_result.arm.evaluation,
    }


def test_html_is_small_and_colorless(objects):
    """Less than 12 kB, a run 28; tags closed, nothing loaded, no colors: readable on every background."""
    for name, thing in objects.items():
        html = thing._repr_html_()
        page = Page(html)
        assert page.open == []
        assert all(set(attributes) <= {"style"} for _, attributes in page.elements)
        assert len(html) < (28_000 if name == "TransferResult" else 12_000)
        assert {tag for tag, _ in page.elements} <= {"div", "b", "table", "thead", "tbody", "tr", "th", "td"}
        assert not any(word in str(page.elements) for word in ("color:", "background"))
        assert page.text[0] == name
        assert "nan" not in page.text


def test_texts_are_escaped():
    names, notes = ("<script>alert(1)</script>",), ("a & b",)
    html = mp.Recording(names, np.zeros((2, 1, 3)), np.arange(2.0), source="<img>", notes=notes)._repr_html_()
    assert "<script" not in html
    assert "<img" not in html
    assert "A &amp; b." in html
    evil = "<i>"
    section = Section(evil, (Metric(evil, evil, evil),), (Table((evil,), ((evil,),), evil),))
    assert evil not in as_html(Report(evil, evil, (section,)))


def test_the_prompt_of_an_adapter_makes_it_again(objects):
    icp = objects["RiemannianICP"]
    again = eval(repr(icp), {"RiemannianICP": mp.RiemannianICP, "Search": Search})
    assert again.get_params() == icp.get_params()
    assert repr(again) == repr(clone(icp))
    assert "#" not in repr(again)
    assert "not fitted" in again._repr_html_()
