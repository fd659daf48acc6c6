"""Unusual but valid MJCF: poses, limits, masses, gravity and torque limits are MuJoCo's."""

from itertools import product

import mujoco
import numpy as np
import pytest

from maniport.arms import load_arm

MASS = '<inertial pos=".02 .01 .03" mass="1.5" diaginertia=".01 .012 .015"/>'
A = '<joint name="a" axis="0 0 1" range="-90 90"/>'
B = '<joint name="b" axis="0 1 0" range="-80 100"/>'
C = '<joint name="c" axis="1 0 0" range="-45 45"/>'


def robot(before="", after="", a=A, b=B, c=C, attributes=("", "", "")):
    """Three links with a site on the last."""
    links = ""
    for number, (one, pose) in enumerate(
        ((a, "0 .1 .2"), (b, ".1 0 .3"), (c, "0 .05 .25")), start=1
    ):
        turn = 'euler="10 20 30"' if number == 2 else ""
        links += (
            f'<body name="l{number}" pos="{pose}" {turn} {attributes[number - 1]}>{MASS}{one}'
            '<geom size=".02"/>'
        )
    site = '<site name="tip" pos="0 .02 .1" euler="0 0 40"/>'
    return (
        f'<mujoco model="r">{before}<worldbody><body name="base">{MASS}<geom size=".02"/>{links}{site}'
        f"</body></body></body></body></worldbody>{after}</mujoco>"
    )


NESTED = (
    '<default><joint axis="0 1 0" range="-10 10"/><default class="x"><joint range="-20 20" axis="1 0 0"/>'
    '<default class="y"><joint range="-30 30"/></default></default>'
    '<default class="z"><joint axis="0 0 3"/></default></default>'
)
REF = (
    '<joint name="b" axis="0 1 0" range="-80 100" ref="20"/>',
    '<joint name="c" axis="1 0 0" range="-45 45" ref="-10"/>',
)
FOLLOWING = '<equality><joint joint1="c" joint2="b" polycoef="0.1 -0.5"/></equality>'
CASES = {
    "order of Euler angles": robot('<compiler eulerseq="zXy"/>'),
    "long axis": robot(b='<joint name="b" axis="1 1 .5" range="-80 100"/>'),
    "joint beside the origin": robot(a='<joint name="a" pos=".1 .2 .3" range="-90 90"/>'),
    "ref": robot(b=REF[0]),
    "ref of a slide": robot(
        b='<joint name="b" type="slide" axis="0 1 0" range="-.2 .3" ref=".1"/>'
    ),
    "range without a limit": robot(b=B.replace("/>", ' limited="false"/>')),
    "nested classes": robot(
        NESTED, a='<joint name="a" class="y"/>', b='<joint name="b" class="z"/>'
    ),
    "classes of bodies": robot(
        NESTED,
        a='<joint name="a"/>',
        b='<joint name="b" class="z"/>',
        c='<joint name="c"/>',
        attributes=('childclass="x"', "", 'childclass="y"'),
    ),
    "defaults in two sections": robot(
        '<default><joint axis="0 1 0"/></default><default><joint range="-11 12"/></default>',
        a='<joint name="a"/>',
    ),
    "coupled": robot(after=FOLLOWING, b=REF[0], c=REF[1]),
    "coupling that is off": robot(after=FOLLOWING.replace("/><", ' active="false"/><')),
    "coupling that is off by default": robot(
        '<default><equality active="false"/></default>', FOLLOWING
    ),
    "coupling in a class that is on": robot(
        '<default><equality active="false"/><default class="on"><equality active="true"/></default></default>',
        FOLLOWING.replace("<joint", '<joint class="on"'),
    ),
    "couplings in two sections": robot(
        after=FOLLOWING + '<equality><joint joint1="b" joint2="a" polycoef="0.1 2"/></equality>'
    ),
    "constant joint": robot(
        after='<equality><joint joint1="c" polycoef="0.2 0 0 0 0"/></equality>'
    ),
    "three joints of a body": robot(
        b=B
        + '<joint name="d" axis="1 0 0" pos="0 .1 0" range="-40 40"/>'
        + '<joint name="e" type="slide" axis="1 1 0" range="-.1 .2"/>'
    ),
    "moving base": robot().replace(
        '<body name="base">', '<body name="base" pos="1 2 3" euler="0 0 30"><freejoint/>'
    ),
    "orientations": robot(attributes=('axisangle="0 0 2 30"', "", 'xyaxes="1 1 0 -1 2 0"')),
    "full inertia": robot().replace(
        'diaginertia=".01 .012 .015"', 'fullinertia=".01 .012 .015 .001 -.002 .0005"'
    ),
    "total mass": robot('<compiler settotalmass="50"/>'),
    "least mass": robot('<compiler boundmass="2" boundinertia=".013"/>'),
    "gravity of the Moon": robot('<option gravity="0 0 -1.62"/>'),
    "gravity of a wall": robot('<option timestep=".01"/><option gravity="9.81 0 0"/>'),
    "armature": robot('<default><joint armature=".1"/></default>'),
    "names": robot().replace('name="b"', 'name="épaule droite"').replace('"l3"', '"手 1"'),
    "mark of the byte order": "\ufeff" + robot().replace("><", ">\r\n<"),
    "declared encoding": '<?xml version="1.0" encoding="utf-8"?><!-- robot -->' + robot(),
}
TENDON = '<tendon><fixed name="t"><joint joint="b" coef="2"/><joint joint="c" coef="-.5"/></fixed></tendon>'
DRIVES = {
    "through a tendon": TENDON
    + '<actuator><motor tendon="t" ctrlrange="-4 4" gear="3"/></actuator>',
    "joint and tendon": TENDON
    + '<actuator><motor tendon="t" forcerange="-4 5"/><motor joint="c" ctrlrange="-1 1"/></actuator>',
    "two motors of one direction each": '<actuator><motor joint="a" ctrlrange="0 2"/>'
    '<motor joint="a" gear="-1" ctrlrange="0 3"/></actuator>',
    "negative gear": '<actuator><motor joint="c" gear="-2" ctrlrange="-3 4"/></actuator>',
    "force within the range": '<actuator><general joint="b" gainprm="-10" ctrlrange="-1 2" forcerange="-9 30"/>'
    "</actuator>",
    "without a limit": '<actuator><motor joint="a" forcerange="-5 5" forcelimited="false"/></actuator>',
    "in the frame of the parent": '<actuator><motor jointinparent="a" ctrlrange="-2 2" gear="4 1"/></actuator>',
    "without a gear": '<actuator><motor joint="a" ctrlrange="-2 2" gear="0"/></actuator>',
}


def loaded(tmp_path, text):
    """Arm and MuJoCo's model of an MJCF."""
    path = tmp_path / "robot.xml"
    path.write_bytes(text.encode())
    return load_arm(path, frame="tip"), mujoco.MjModel.from_xml_path(str(path))


def place(model, data, arm, positions):
    """Set joints of an arm, the others to zero, and joints that follow them."""
    data.qpos[:] = model.qpos0
    for joint in range(model.njnt):
        if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_FREE:
            data.qpos[model.jnt_qposadr[joint]] = 0.0
    for name, position in zip(arm.joint_names, positions, strict=True):
        data.joint(name).qpos = position
    for _ in range(model.neq):  # as many as the longest chain
        for i in range(model.neq):
            if not model.eq_active0[i]:
                continue
            follower = model.jnt_qposadr[model.eq_obj1id[i]]
            shift = 0.0
            if model.eq_obj2id[i] >= 0:
                leader = model.jnt_qposadr[model.eq_obj2id[i]]
                shift = data.qpos[leader] - model.qpos0[leader]
            factors = model.eq_data[i][:5]
            data.qpos[follower] = model.qpos0[follower] + factors @ shift ** np.arange(5)


@pytest.mark.parametrize("case", CASES)
def test_kinematics_limits_and_masses_are_mujocos(tmp_path, case):
    arm, model = loaded(tmp_path, CASES[case])
    data = mujoco.MjData(model)
    for name, low, high in zip(arm.joint_names, arm.lower, arm.upper, strict=True):
        limited = model.joint(name).limited[0]
        expected = model.joint(name).range if limited else (-np.pi, np.pi)
        np.testing.assert_allclose((low, high), expected, atol=1e-9)
    assert arm.chain.inertia[:, 0, 0].sum() == pytest.approx(model.body_mass.sum())

    columns = [model.joint(name).dofadr[0] for name in arm.joint_names]
    for q in arm.sample(4, random_state=1):
        place(model, data, arm, q)
        mujoco.mj_forward(model, data)
        pose = arm.forward(q)
        np.testing.assert_allclose(pose[:3, 3], data.site("tip").xpos, atol=1e-9)
        np.testing.assert_allclose(pose[:3, :3].ravel(), data.site("tip").xmat, atol=1e-9)
        if not model.neq:
            torques = data.qfrc_bias[columns]
            np.testing.assert_allclose(arm.gravity_torques(q), torques, atol=1e-6)


@pytest.mark.parametrize("case", DRIVES)
def test_torque_limits_are_those_of_all_drives(tmp_path, case):
    arm, model = loaded(tmp_path, robot(after=DRIVES[case]))
    torques = []
    for controls in product((-1e6, 1e6), repeat=model.nu):
        data = mujoco.MjData(model)
        data.ctrl[:] = controls
        mujoco.mj_forward(model, data)
        torques.append(data.qfrc_actuator.copy())
    weaker = np.minimum(np.max(torques, axis=0), -np.min(torques, axis=0))
    unknown = (weaker == 0.0) | (weaker > 1e5)
    np.testing.assert_allclose(arm.chain.effort_limits, np.where(unknown, np.inf, weaker))


@pytest.mark.parametrize(
    "option", ['<option gravity="0 0 0"/>', '<option><flag gravity="disable"/></option>']
)
def test_a_simulation_without_gravity_is_of_a_robot_with_weight(tmp_path, option):
    arm, _ = loaded(tmp_path, robot(option))
    q = arm.sample(3, random_state=0)
    usual, _ = loaded(tmp_path, robot())
    np.testing.assert_array_equal(arm.gravity_torques(q), usual.gravity_torques(q))
    assert list(arm.chain.remarks["ignored-gravity"]) == ["r"]
    assert "ignored-gravity" not in usual.chain.remarks


def test_an_unknown_mass_makes_the_total_useless(tmp_path):
    text = robot('<compiler settotalmass="50"/>').replace(MASS, "", 1)
    arm, model = loaded(tmp_path, text)
    assert model.body_mass.sum() == pytest.approx(50)
    assert arm.chain.inertia is None
