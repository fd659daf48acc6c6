"""ArmGroup of robot packages, and MuJoCo as their reference, which shares no code with what reads them here."""

import re
from xml.etree import ElementTree

import numpy as np

_INERTIA = {"ixx": "1", "iyy": "1", "izz": "1", "ixy": "0", "ixz": "0", "iyz": "0"}
_COMPILER = {"boundmass": "1e-3", "boundinertia": "1e-6", "fusestatic": "false", "strippath": "false"}


def model_of(mujoco, path):
    """MuJoCo's model of a URDF or MJCF, without meshes and all else that does not move."""
    text = re.sub(r"\bdrake:", "", path.read_text(encoding="utf-8"))
    root = ElementTree.fromstring(text)
    if root.tag == "robot":
        for link in root.findall("link"):
            for part in [*link.findall("visual"), *link.findall("collision"), *link.findall("inertial")]:
                link.remove(part)
            inertial = ElementTree.SubElement(link, "inertial")
            ElementTree.SubElement(inertial, "mass", value="1")
            ElementTree.SubElement(inertial, "inertia", dict(_INERTIA))
        for gone in [*root.findall("gazebo"), *root.findall("transmission"), *root.findall("mujoco")]:
            root.remove(gone)
        ElementTree.SubElement(ElementTree.SubElement(root, "mujoco"), "compiler", _COMPILER)
    else:
        for tag in ("asset", "actuator", "sensor", "tendon", "contact", "keyframe"):
            for gone in root.findall(tag):
                root.remove(gone)
        for floor in root.findall("worldbody/geom"):
            root.find("worldbody").remove(floor)
        for body in root.iter("body"):
            for part in [*body.findall("geom"), *body.findall("camera"), *body.findall("inertial")]:
                body.remove(part)
            ElementTree.SubElement(body, "geom", size="0.01", mass="1")
    return mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))


def farthest(mujoco, model, arm, count=4):
    """Largest difference of an arm's Jacobians and poses from MuJoCo's, both seen from the arm's base.

    The other joints stand where the arm holds them, or at zero.
    """
    data = mujoco.MjData(model)
    body = mujoco.mjtObj.mjOBJ_BODY
    tip, base = (mujoco.mj_name2id(model, body, name) if name else 0 for name in (arm.frame, arm.chain.base))
    worst = 0.0
    for q in arm.sample(count, random_state=0):
        data.qpos[:] = 0.0
        for name, value in [*arm.chain.locked.items(), *zip(arm.joint_names, q, strict=True)]:
            data.joint(name).qpos = value
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        jacobians = []
        for one in (tip, base):
            linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
            mujoco.mj_jac(model, data, linear, angular, data.xpos[tip], one)
            jacobians.append(np.vstack([linear, angular]))
        turn = data.xmat[base].reshape(3, 3).T
        columns = [model.joint(name).dofadr[0] for name in arm.joint_names]
        relative = (jacobians[0] - jacobians[1])[:, columns]
        expected = np.vstack([turn @ relative[:3], turn @ relative[3:]])
        pose = arm.forward(q)
        gaps = (
            arm.jacobian(q) - expected,
            pose[:3, 3] - turn @ (data.xpos[tip] - data.xpos[base]),
            pose[:3, :3] - turn @ data.xmat[tip].reshape(3, 3),
        )
        worst = max(worst, *(float(np.abs(gap).max()) for gap in gaps))
    return worst
