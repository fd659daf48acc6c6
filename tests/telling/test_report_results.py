"""Reports of results: a transfer, a robot's motion, the paper's experiments."""

import dataclasses

import numpy as np
import pytest

import maniport as mp
from maniport.errors import FileFormatError
from maniport.pipeline import transfer_recording
from maniport.pipeline.execution import follow
from maniport.studies.paper import motions, run
from maniport.studies.paper.outcome import Experiment, Outcome
from maniport.studies.paper.run import Reproduction
from maniport.telling.page import Motion, Table, as_html
from maniport.telling.reports import of_execution, of_reproduction, of_transfer

SMALL = {"n_teacher": 128, "n_student": 256}


@pytest.fixture(scope="module")
def recording(second):
    """One second of the shipped ladder recording."""
    return second


@pytest.fixture(scope="module")
def result(small_result):
    """The main job on a small scale."""
    return small_result


@pytest.fixture(scope="module")
def report(result):
    """Its report."""
    return of_transfer(result)


@pytest.fixture(scope="module")
def execution():
    """The Panda follows ellipsoids of its own, without a path."""
    panda = mp.load_arm("panda")
    joints = np.linspace([0, -0.5, 0, -2, 0, 1.8, 0], [0.1, -0.4, 0.1, -1.8, 0.1, 1.9, 0], 15)
    return follow(panda, panda.manipulability(joints), np.linspace(0, 1, 15))


def motion_of(report):
    """The only motion of a report."""
    return next(part for section in report.sections for part in section.parts if isinstance(part, Motion))


def test_transfer_shows_person_and_robot_together(result, report):
    """The person's ellipsoid is at the hand; the wanted and the robot's own at the tool; path and clock are there."""
    shown = motion_of(report)
    person, robot = shown.bodies
    np.testing.assert_array_equal(shown.time, result.time)
    np.testing.assert_array_equal(person.ellipsoids["teacher"], result.demonstrated_profile)
    np.testing.assert_array_equal(robot.ellipsoids["wanted"], result.execution.motion.target)
    np.testing.assert_array_equal(robot.ellipsoids["student"], result.execution.motion.achieved)
    tips = result.robot.forward(result.execution.motion.joint_positions)[:, :3, 3]
    np.testing.assert_allclose(robot.skeleton[:, -1], tips, atol=1e-12)
    np.testing.assert_array_equal(robot.path, result.execution.motion.path)
    assert shown.clocks == {"robot": 2.0}


def test_transfer_shows_all_curves(result, report):
    """Distances with their floor, the hand's error, the ellipsoids' numbers and every joint with its limits."""
    panels = motion_of(report).panels
    distance, hand = panels["How near the robot comes"]
    np.testing.assert_array_equal(distance.lines[0].values, result.execution.motion.distance)
    np.testing.assert_array_equal(distance.lines[1].values, result.execution.placement.distance)
    np.testing.assert_allclose(hand.lines[0].values, 1e3 * result.execution.motion.position_error)
    assert len(panels["Ellipsoids"]) == 5
    robot, person = panels["Joints of panda"], panels["Joints of the person"]
    assert [panel.title for panel in robot] == list(result.robot.joint_names)
    assert robot[0].limits == (result.robot.lower[0], result.robot.upper[0])
    np.testing.assert_allclose(person[0].lines[0].values, np.degrees(result.fit.joint_angles[:, 0]))


def test_map_holds_both_domains_and_all_profiles(result, report):
    """Domains of person and robot; profiles of the person, wanted and achieved, a point for each time."""
    chart = motion_of(report).map
    assert [cloud.role for cloud in chart.domains] == ["teacher", "student"]
    assert [cloud.role for cloud in chart.profiles] == ["teacher", "wanted", "student"]
    assert all(len(cloud.coordinates) == len(result.time) for cloud in chart.profiles)


def test_warnings_come_first_and_name_what_is_open(result, report):
    """Joints that are not determined, the mounting that is taken as known, and what is out of reach are told."""
    text = as_html(report)
    assert result.fit.undetermined
    assert all(name in " ".join(report.warnings) for name in result.fit.undetermined)
    known = result.summary()["adapter"]["identifiability"]
    assert known is None or any(known in warning for warning in report.warnings)
    assert text.index('class="mind"') < text.index("<main>")
    assert any("points the robot is not within" in warning for warning in report.warnings)


def test_settings_and_versions_are_told(result, report):
    """File, person, robot, frame, seed, samples, damping and versions stand in the page."""
    text = as_html(report)
    for word in ("ladder.bvh", "myoarm", "panda_link8", "damping 0.01", "128 samples", mp.__version__, "NumPy", "Seed"):
        assert word in text


def test_fresh_warning_is_passed_on(result):
    """What the steps warned of comes into the page."""
    warned = dataclasses.replace(result, warnings=("mind the step",))
    assert "Mind the step" in of_transfer(warned).warnings


@pytest.mark.parametrize("options", [{"part": "full"}, {"kind": "force"}, {"part": "rotation"}])
def test_unmoved_robot_and_other_ellipsoids_are_shown(recording, options):
    """Without a robot's motion the person alone moves; force ellipsoids are drawn as velocity ones, full ones not."""
    found = transfer_recording(
        recording, method="parallel-transport", move=False, spec=mp.EllipsoidSpec(**options), **SMALL
    )
    shown = motion_of(of_transfer(found))
    assert [body.name for body in shown.bodies] == ["Person"]
    assert ("Ellipsoids" in shown.panels) == (options.get("part") != "full")
    assert len(as_html(of_transfer(found))) < 6_000_000
    if options.get("kind") == "force":
        velocity = found.fit.arm.manipulability(found.fit.joint_angles)
        np.testing.assert_allclose(shown.bodies[0].ellipsoids["teacher"], velocity, rtol=1e-6, atol=1e-9)


def test_robot_alone_is_shown(execution):
    """A motion without a person has one body, no map, and no error of a path that is not there."""
    report = of_execution(execution)
    shown = motion_of(report)
    assert [body.name for body in shown.bodies] == ["panda"]
    assert shown.map is None
    assert [panel.title for panel in shown.panels["How near the robot comes"]] == [
        "Distance from wanted to achieved, and feasibility gap"
    ]
    assert report.warnings == ()
    assert "The motion of panda" in as_html(report)


def test_surfaces_stand_where_forward_kinematics_puts_them(result, report, execution):
    """Each surface of the robot has the pose of the joint it hangs on; the person has none."""
    person, robot = motion_of(report).bodies
    assert person.parts == ()
    for shown, arm, joints in (
        (robot, result.robot, result.execution.motion.joint_positions),
        (motion_of(of_execution(execution)).bodies[0], execution.robot, execution.motion.joint_positions),
    ):
        surfaces, poses = arm.surfaces(), arm.link_poses(joints)
        assert len(shown.parts) == len(surfaces) > 1
        for part, surface in zip(shown.parts, surfaces, strict=True):
            np.testing.assert_array_equal(part.poses, poses[:, surface.joint])
            np.testing.assert_array_equal(part.triangles, surface.triangles)
            np.testing.assert_array_equal(part.points, surface.points)


def test_robot_without_its_meshes_is_a_skeleton_and_says_why(execution, monkeypatch):
    """A mesh that cannot be read costs the surface, not the report; the page tells which it was."""

    def missing(self, most_triangles=15_000):
        raise FileFormatError("no file link3.stl")

    monkeypatch.setattr(mp.Arm, "surfaces", missing)
    shown = motion_of(of_execution(execution))
    assert shown.bodies[0].parts == ()
    assert "panda is drawn as a skeleton: no file link3.stl" in as_html(of_execution(execution))


def test_feasibility_gap_is_a_floor_of_what_is_achieved(result, report, execution):
    """A motion hardly gets below the gap, which is warned of; of ellipsoids that the robot made itself it is none."""
    lines = {line.name: line.values for line in motion_of(report).panels["How near the robot comes"][0].lines}
    assert (lines["feasibility gap"] <= lines["achieved"] + 1e-6).mean() > 0.95
    assert any("Feasibility gap" in warning for warning in report.warnings)
    assert execution.gap.max() < 0.01


def test_part_of_the_ellipsoids_is_kept():
    """An execution knows which ellipsoids it followed, so that its report names their unit."""
    panda = mp.load_arm("panda")
    joints = np.linspace([0, -0.5, 0, -2, 0, 1.8, 0], [0.1, -0.4, 0.1, -1.8, 0.1, 1.9, 0], 8)
    turned = follow(panda, panda.manipulability(joints, part="rotation"), np.linspace(0, 1, 8), part="rotation")
    assert turned.part == "rotation"
    assert motion_of(of_execution(turned)).unit == "rad/s per rad/s"


def outcome(**changes):
    """An outcome of an experiment."""
    row = {
        "table": "I", "row": 1, "data": "toy", "samples": "10", "method": "PT", "evaluation": "E", "paper_rmse": 0.5,
        "paper_iterations": None, "settings": "paper's", "adapter": "A()", "undivided": 1.0, "undivided_spread": 0.0,
        "per_dispersion": 0.25, "per_dispersion_spread": 0.125, "per_squared_dispersion": 1.0,
        "per_squared_dispersion_spread": 0.0, "iterations": 1.0, "seconds": 0.1, "draws": 10, "seed": 0, "warned": 0,
    }  # fmt: skip
    return Outcome(**(row | changes))


def test_paper_stands_beside_what_came_out():
    """A line for each row and evaluation set, with the paper's number and a column for each setting."""
    ours = {"settings": "ours", "per_dispersion": 1e-6, "draws": 1, "warned": 1}
    both = (outcome(), outcome(**ours), outcome(evaluation="F"), outcome(evaluation="F", **ours))
    experiment = Experiment("toy", "Table I", ("How.",), both, {"width": 2.0})
    report = of_reproduction(Reproduction((experiment,), 3, 12.0), {})
    table = next(part for part in report.sections[0].parts if isinstance(part, Table))
    assert table.columns[-3:] == ("paper", "paper's", "ours")
    assert table.rows == tuple(("toy", "10", "PT", on, "0.500", "0.250 ± 0.125", "1e-06") for on in "EF")
    assert "in 1 of 1 fits" in report.warnings[0]
    assert "IROS 2022" in as_html(report)


def test_arms_of_the_paper_move():
    """With known joint samples the two-joint arms' adapted ellipsoids are the student's own, as the curve says."""
    shown = motions.two_dof_motion(0)
    distance = shown.panels["Ellipsoids"][0].lines[0].values
    assert distance.max() < 1e-3
    assert set(motions.MOVED) <= set(run.FIGURES)


def test_reproduction_writes_its_page(tmp_path):
    """The page is among the files, and holds the figures."""
    run.reproduce("toy", tmp_path / "out", draws=1)
    text = (tmp_path / "out" / run.REPORT).read_text(encoding="utf-8")
    assert "data:image/png;base64," in text
    assert "Reithmeir" in text
