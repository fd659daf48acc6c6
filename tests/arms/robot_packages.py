"""ArmGroup of robot packages, and MuJoCo as their reference, which shares no code with what reads them here."""

import re
from xml.etree import ElementTree

import numpy as np

_INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
_COMPILER = {
    "boundmass": "1e-3",
    "boundinertia": "1e-6",
    "fusestatic": "false",
    "strippath": "false",
}


def model_of(mujoco, path):
    """MuJoCo's model of a URDF or MJCF, without meshes and all else that does not move."""
    text = re.sub(r"\bdrake:", "", path.read_text(encoding="utf-8"))
    root = ElementTree.fromstring(text)
    if root.tag == "robot":
        root[:] = [*root.findall("link"), *root.findall("joint")]
        for link in root.findall("link"):
            link[:] = [ElementTree.fromstring(_INERTIAL)]
        ElementTree.SubElement(ElementTree.SubElement(root, "mujoco"), "compiler", _COMPILER)
    else:
        root[:] = [
            section
            for section in root
            if section.tag in ("compiler", "option", "default", "worldbody", "equality")
        ]
        for body in [root.find("worldbody"), *root.iter("body")]:
            body[:] = [part for part in body if part.tag in ("body", "joint", "freejoint", "site")]
            if body.tag == "body":
                ElementTree.SubElement(body, "geom", size="0.01", mass="1")
    return mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))


def farthest(mujoco, model, arm, count=4):
    """Largest difference of an arm's Jacobians and poses from MuJoCo's, both seen from the arm's base.

    The other joints are where the arm locks them, or at zero. The end effector is a body or a site.
    """
    data = mujoco.MjData(model)
    worst = 0.0
    is_site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, arm.frame) >= 0
    tip = data.site(arm.frame) if is_site else data.body(arm.frame)
    base = data.body(arm.chain.base or "world")
    bodies = int(model.site_bodyid[tip.id]) if is_site else tip.id, base.id
    columns = [model.joint(name).dofadr[0] for name in arm.joint_names]
    for q in arm.sample(count, random_state=0):
        data.qpos[:] = 0.0
        for name, value in [*arm.chain.locked.items(), *zip(arm.joint_names, q, strict=True)]:
            data.joint(name).qpos = value
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        jacobians = np.zeros((2, 6, model.nv))
        for jacobian, body in zip(jacobians, bodies, strict=True):
            mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], tip.xpos, body)
        turn = base.xmat.reshape(3, 3).T
        relative = (jacobians[0] - jacobians[1])[:, columns].reshape(2, 3, -1)
        pose = arm.forward(q)
        gaps = (
            arm.jacobian(q) - (turn @ relative).reshape(6, -1),
            pose[:3, 3] - turn @ (tip.xpos - base.xpos),
            pose[:3, :3] - turn @ tip.xmat.reshape(3, 3),
        )
        worst = max(worst, *(float(np.abs(gap).max()) for gap in gaps))
    return worst
