"""Files that an MJCF includes: which ones MuJoCo 3.17 accepts, and where it finds them."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from robot_packages import farthest
from typer.testing import CliRunner

from maniport.arms import load_arm
from maniport.arms.collisions import Collisions
from maniport.cli import app
from maniport.errors import FileFormatError

CASES = Path(__file__).parent / "cases" / "include"
MASS = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
BODY = f'<body name="a">{MASS}<joint name="j" axis="0 1 0" range="-9 9"/>{{}}</body>'
INNER = f'<body name="b">{MASS}<joint name="k" range="-9 9"/>{{}}</body>'


def include(file):
    return f'<include file="{file}"/>'


def part(*texts):
    return f"<mujocoinclude>{''.join(texts)}</mujocoinclude>"


def model(text, head=""):
    return f"<mujoco>{head}<worldbody>{text}</worldbody></mujoco>"


def wrapped(*files):
    return f"<mujoco>{''.join(map(include, files))}</mujoco>"


GEOM = part('<geom size=".1"/>')
TWO = BODY.format(include("g.xml") + INNER.format(include("g.xml")))
CLASS = '<default class="fine"><joint range="{}"/></default>'
FINE = BODY.replace("range", 'class="fine" armature').replace('"-9 9"/>', '"0"/>').format("")


def fine(degrees):
    return part(f"<default>{CLASS.format(f'-{degrees} {degrees}')}</default>")


ACCEPTED = {
    "twice in an included file": {"main.xml": wrapped("r.xml"), "r.xml": model(TWO), "g.xml": GEOM},
    "twice, two levels below": {
        "main.xml": wrapped("s.xml"),
        "s.xml": wrapped("r.xml"),
        "r.xml": model(TWO),
        "g.xml": GEOM,
    },
    "twice in one body": {
        "main.xml": wrapped("r.xml"),
        "r.xml": model(BODY.format(include("g.xml") * 2)),
        "g.xml": GEOM,
    },
    "by two included files": {
        "main.xml": model(BODY.format(include("p.xml") + include("q.xml"))),
        "p.xml": part(include("g.xml")),
        "q.xml": part(include("g.xml")),
        "g.xml": GEOM,
    },
    "below, then here": {
        "main.xml": model(BODY.format(include("p.xml") + include("g.xml"))),
        "p.xml": part(include("g.xml")),
        "g.xml": GEOM,
    },
    "two robots with one file of defaults": {
        "main.xml": wrapped("r.xml", "s.xml"),
        "r.xml": model(BODY.format(""), include("d.xml")),
        "s.xml": model(INNER.format(""), include("d.xml")),
        "d.xml": part("<default><geom size='.3'/></default>"),
    },
    "beside the including file": {
        "main.xml": wrapped("sub/p.xml"),
        "sub/p.xml": model(FINE, include("more.xml")),
        "sub/more.xml": fine(20),
    },
    "beside the model": {
        "main.xml": wrapped("sub/p.xml"),
        "sub/p.xml": model(FINE, include("more.xml")),
        "more.xml": fine(30),
    },
    "beside both": {
        "main.xml": wrapped("sub/p.xml"),
        "sub/p.xml": model(FINE, include("more.xml")),
        "sub/more.xml": fine(20),
        "more.xml": fine(30),
    },
    "three folders": {
        "main.xml": wrapped("sub/p.xml"),
        "sub/p.xml": model(FINE, include("deep/q.xml")),
        "sub/deep/q.xml": part(include("more.xml")),
        "sub/deep/more.xml": fine(20),
        "sub/more.xml": fine(30),
    },
    "above the including file": {
        "main.xml": wrapped("sub/p.xml"),
        "sub/p.xml": model(FINE, include("../more.xml")),
        "more.xml": fine(20),
    },
    "one name in two folders": {
        "main.xml": wrapped("s/p.xml", "t/p.xml"),
        "s/p.xml": model(FINE, include("more.xml")),
        "t/p.xml": model(INNER.format(""), include("more.xml")),
        "s/more.xml": fine(20),
        "t/more.xml": part("<option timestep='.001'/>"),
    },
    "in a default": {
        "main.xml": model(FINE, f"<default>{include('d.xml')}</default>"),
        "d.xml": part(CLASS.format("-20 20")),
    },
}
REFUSED = {
    "twice here": {"main.xml": model(TWO), "g.xml": GEOM},
    "twice here by another name": {
        "main.xml": model(BODY.format(include("g.xml") + include("./g.xml"))),
        "g.xml": GEOM,
    },
    "here, then below": {
        "main.xml": model(BODY.format(include("g.xml") + include("p.xml"))),
        "p.xml": part(include("g.xml")),
        "g.xml": GEOM,
    },
    "itself": {"main.xml": wrapped("main.xml")},
    "the model": {"main.xml": wrapped("p.xml"), "p.xml": wrapped("main.xml")},
    "an included file that includes itself": {
        "main.xml": wrapped("p.xml"),
        "p.xml": model(BODY, include("p.xml")),
    },
    "a circle": {
        "main.xml": wrapped("p.xml"),
        "p.xml": wrapped("q.xml"),
        "q.xml": wrapped("p.xml"),
    },
}


def write(folder, files):
    for name, text in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    return folder / "main.xml"


@pytest.mark.parametrize("case", ACCEPTED)
def test_models_are_mujocos(tmp_path, case):
    path = write(tmp_path, ACCEPTED[case])
    reference = mujoco.MjModel.from_xml_path(str(path))
    tip = reference.body(reference.nbody - 1).name
    arm = load_arm(path, frame=tip)
    assert farthest(mujoco, reference, arm) < 1e-12
    ranges = [reference.joint(name).range for name in arm.joint_names]
    np.testing.assert_allclose(np.stack([arm.lower, arm.upper], axis=1), ranges, atol=1e-12)


@pytest.mark.parametrize("case", REFUSED)
def test_what_mujoco_refuses_is_refused(tmp_path, case):
    path = write(tmp_path, REFUSED[case])
    with pytest.raises(ValueError, match="already included"):
        mujoco.MjModel.from_xml_path(str(path))
    with pytest.raises(FileFormatError, match=r"'.*xml'.*cycle"):
        load_arm(path)


def test_the_scene_loads_and_the_robot_that_mujoco_refuses_does_not():
    assert load_arm(CASES / "scene.xml").joint_names == ("j1", "j2", "j3", "j4", "j5", "j6")
    nested = load_arm(CASES / "nested.xml")
    assert nested.joint_names == ("ja", "jb")
    np.testing.assert_allclose(
        [nested.lower, nested.upper], np.pi / 2 * np.array([[-1, -1], [1, 1]])
    )
    with pytest.raises(FileFormatError, match=r"robot\.xml.*'geoms\.xml'.*once"):
        load_arm(CASES / "robot.xml")


def test_a_folder_that_is_allowed_may_be_included(tmp_path):
    """The message of a file outside names an option that allows its folder."""
    for name in ("robot", "common"):
        (tmp_path / name).mkdir()
    path = write(tmp_path / "robot", {"main.xml": model(BODY.format(include("../common/g.xml")))})
    (tmp_path / "common" / "g.xml").write_text(GEOM)
    with pytest.raises(FileFormatError, match=r"outside.*mesh_folders="):
        load_arm(path)
    arm = load_arm(path, mesh_folders=[tmp_path / "common"])
    assert len(arm.surfaces()) == 1
    assert Collisions.of(arm).shapes.collision == ("a",)
    words = ["info", str(path), "--mesh-folders", str(tmp_path / "common")]
    assert CliRunner().invoke(app, words).exit_code == 0


def test_files_that_double_on_each_level_are_limited(tmp_path):
    files = {f"{k}.xml": part(include(f"{k + 1}.xml") * 2) for k in range(40)}
    path = write(tmp_path, {"main.xml": wrapped("0.xml"), **files, "40.xml": part(BODY.format(""))})
    with pytest.raises(FileFormatError, match="inclusions"):
        load_arm(path)
