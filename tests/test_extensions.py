"""Extensions in one file each, used by the main job. docs/extensions.md includes these files."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import maniport as mp
from extensions import dh_reader, lab_names, stiff_shoulder, table_reader  # noqa: F401 - their import registers them
from extensions.height_cost import HeightCost
from extensions.log_euclidean_shift import LogEuclideanShift
from extensions.spectrum_correspondence import SpectrumCorrespondence
from extensions.speed_panel import write_page_with_speed
from maniport.mocap import synthetic_recording
from maniport.mocap.roles import assign_roles
from sizes import SIX_ROWS, SMALL, little_search

HERE = Path(__file__).parent

SIX_JOINTS = {"name": "six joints", "rows": SIX_ROWS, "lower": [-3.1] * 6, "upper": [3.1] * 6}


@pytest.fixture(scope="module")
def moment(second):
    return second.crop(10.7, 11)


@pytest.fixture(scope="module")
def result(moment, tmp_path_factory):
    """The main job with a recording format, a person, a robot format, a method and a cost of one's own."""
    folder = tmp_path_factory.mktemp("extensions")
    header = ["time", *(f"{name}.{axis}" for name in moment.names for axis in "xyz")]
    table = np.column_stack([moment.time, moment.positions.reshape(len(moment), -1)])
    np.savetxt(folder / "ladder.pts", table, header=" ".join(header), comments="")
    robot = folder / "six.json"
    robot.write_text(json.dumps(SIX_JOINTS), encoding="utf-8")
    recording = mp.read_recording(folder / "ladder.pts")
    method = LogEuclideanShift(damping=0.01)
    with little_search():
        found = mp.transfer_recording(
            recording,
            person="stiff_shoulder",
            robot=robot,
            method=method,
            speed_scale=0.5,
            costs=[HeightCost(mp.load_arm(robot), "link5", 0.0)],
            **SMALL,
        )
    assert not hasattr(method, "shift_")  # a clone was fitted
    return found


def test_the_main_job_takes_all_of_them(result, moment, tmp_path):
    np.testing.assert_allclose(result.recording.positions, moment.positions, atol=1e-12)
    assert result.recording.names == moment.names
    assert (result.arm.robot.name, result.arm.robot.dof) == ("six joints", 6)
    assert result.arm.motion.joint_positions.shape == (len(result.time), 6)
    assert result.arm.method == "LogEuclideanShift"
    assert result.arm.evaluation.adapter.feasibility_gap is not None
    result.arm.adapter.save(tmp_path / "adapter.npz")
    again = mp.load_adapter(tmp_path / "adapter.npz")
    np.testing.assert_array_equal(
        again.transform(result.arm.demonstrated_profile), result.arm.target_profile
    )
    write_page_with_speed(tmp_path / "page.html", result)
    assert "End-effector speed" in (tmp_path / "page.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("side", ["right", "left"])
def test_a_family_of_names_of_ones_own_is_known_for_either_arm(side):
    r, other = ("R", "L") if side == "right" else ("L", "R")
    arm = mp.load_arm("myoarm", side=side)
    seen = synthetic_recording(arm, np.linspace(arm.lower, arm.upper, 9)[3:6], [0.0, 0.1, 0.2])
    renamed = {
        "shoulder": f"Acromion_{r}",
        "elbow_lateral": f"Epi_Lat_{r}",
        "elbow_medial": f"Epi_Med_{r}",
        "wrist_radial": f"Styloid_Rad_{r}",
        "wrist_ulnar": f"Styloid_Uln_{r}",
        "trunk_low": "Sacrum",
        "trunk_high": "Vertebra_7",
        "trunk_front": f"Acromion_{other}",
    }
    points = seen.select(renamed)
    across = points.positions.copy()
    across[:, -1] = [[1, -1, 1]] * points.positions[:, 0]  # the other shoulder
    roles = assign_roles(
        replace(points, names=tuple(renamed.values()), positions=across), side=side
    )
    assert roles["elbow"] == (f"Epi_Lat_{r}", f"Epi_Med_{r}")
    assert roles["wrist_axis"] == ((f"Styloid_Uln_{r}",), (f"Styloid_Rad_{r}",))
    assert roles["trunk_left"] == (("Acromion_R",), ("Acromion_L",))


def test_a_person_of_ones_own_is_fitted_in_the_lengths_of_the_recording(result, moment):
    assert result.arm.fit.arm.name == "stiff_shoulder"
    elevation = result.arm.fit.arm.joint_names.index("shoulder_elv")
    highest = [
        np.degrees(fit.joint_angles[:, elevation]).max()
        for fit in (result.arm.fit, mp.fit_arm(moment))
    ]
    assert highest[0] <= 70.0 + 1e-9 < highest[1]


def test_a_correspondence_of_ones_own_matches_in_the_main_job(moment):
    method = mp.RiemannianICP(damping=0.01, correspondence=SpectrumCorrespondence())
    mp.transfer_recording(moment, method=method, move=False, **SMALL)
    robot = mp.load_arm("panda")
    student = mp.sample_domain(robot, 200, random_state=0)
    turn = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    again = method.fit(turn.T @ student[::-1] @ turn, student)
    np.testing.assert_allclose(again.map_rotation_, turn, atol=1e-6)


@pytest.mark.parametrize(
    "file", sorted((HERE / "extensions").glob("*.py")), ids=lambda file: file.stem
)
def test_the_page_includes_every_extension(file):
    page = (HERE.parent / "docs" / "extensions.md").read_text(encoding="utf-8")
    assert f"{{literalinclude}} ../tests/extensions/{file.name}\n" in page
