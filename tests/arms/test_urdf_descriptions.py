"""Unusual but valid URDF: poses, limits, masses and gravity torques are Pinocchio's."""

from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest

from fuzz.mesh_examples import stl
from maniport.arms import load_arm
from maniport.arms.collisions import Collisions
from maniport.errors import FileFormatError, InvalidInputError

MASS = (
    '<inertial><origin xyz=".02 .01 .03" rpy=".1 .2 .3"/><mass value="1.5"/>'
    '<inertia ixx=".01" iyy=".012" izz=".015" ixy=".001" ixz="-.002" iyz="0"/></inertial>'
)
LIMIT = '<limit lower="-1" upper="1.5" effort="10" velocity="2"/>'
ORIGIN = '<origin xyz="0 .1 .2" rpy=".1 .2 .3"/>'


def link(name, content=MASS):
    return f'<link name="{name}">{content}</link>'


def joint(name, parent, child, axis="0 0 1", kind="revolute", limit=LIMIT, origin=ORIGIN, more=""):
    return (
        f'<joint name="{name}" type="{kind}">{origin}<parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="{axis}"/>{limit}{more}</joint>'
    )


def follows(leader, multiplier, offset):
    return f'<mimic joint="{leader}" multiplier="{multiplier}" offset="{offset}"/>'


def robot(*, a="", b="", c="", more="", links=MASS, attributes=""):
    """Links base, l1, l2 and tip; a joint that is given replaces its own."""
    joints = (
        a or joint("a", "base", "l1"),
        b or joint("b", "l1", "l2", "0 1 0"),
        c or joint("c", "l2", "tip", "1 0 0"),
    )
    names = ("base", "l1", "l2", "tip")
    listed = "".join(link(name, links) for name in names)
    return f'<robot name="r" {attributes}>{listed}{"".join(joints)}{more}</robot>'


def b(**options):
    return robot(b=joint("b", "l1", "l2", **({"axis": "0 1 0"} | options)))


def c(more):
    return robot(c=joint("c", "l2", "tip", "1 0 0", more=more))


def rigid(name, parent, child, origin=ORIGIN, kind="fixed"):
    return joint(name, parent, child, kind=kind, limit="", origin=origin)


CASES = {
    "plain": robot(),
    "without an origin": b(origin=""),
    "origin with a position": b(origin='<origin xyz="0 .1 .2"/>'),
    "quaternion": b(origin='<origin xyz="0 1e-1 +.2" quat_xyzw=".1 .2 -.3 .9"/>').replace(
        'name="r"', 'name="r" version="1.1"'
    ),
    "long axis": b(axis="0 -3 4"),
    "continuous": b(kind="continuous", limit='<limit effort="7" velocity="3"/>'),
    "prismatic": b(kind="prismatic", axis="1 1 0"),
    "one limit": b(limit='<limit upper="1" effort="3" velocity="1"/>'),
    "limits without zero": b(limit='<limit lower=".5" upper="1.5" effort="3" velocity="1"/>'),
    "follower with an offset": c(follows("b", -0.5, 0.3)),
    "follower of a follower": robot(
        b=joint("b", "l1", "l2", "0 1 0", more=follows("a", 2, -0.1)),
        c=joint("c", "l2", "tip", "1 0 0", more=follows("b", -0.5, 0.3)),
    ),
    "follower before its leader": robot(a=joint("a", "base", "l1", more=follows("c", 1.2, 0.1))),
    "follower that slides": robot(
        c=joint("c", "l2", "tip", kind="prismatic", more=follows("b", 0.1, 0))
    ),
    "follower without a factor": c(follows("b", 0, 0.4)),
    "follower of another branch": c(follows("x", 2, 0.1)).replace(
        "</robot>", link("side") + joint("x", "base", "side") + "</robot>"
    ),
    "follower of a continuous joint": robot(
        b=joint("b", "l1", "l2", kind="continuous", limit=""),
        c=joint("c", "l2", "tip", more=follows("b", -1, 0.1)),
    ),
    "fixed joints in a row": robot(
        b=rigid("f1", "l1", "m1")
        + rigid("f2", "m1", "m2", '<origin xyz="1 2 3" rpy="3.14159 -1.5708 2"/>')
        + link("m1")
        + link("m2")
        + joint("b", "m2", "l2", "0 1 0"),
    ),
    "floating base": robot(more=link("world") + rigid("w", "world", "base", kind="floating")),
    "mobile base": robot(more=link("world") + rigid("w", "world", "base", kind="planar")),
    "without masses": robot(links=""),
    "masses of zero": robot(links=MASS.replace("1.5", "0")),
    "names": robot().replace('"l1"', '"link 1 ä"').replace('name="b"', 'name=" 关节 b"'),
    "equal names of joints and links": robot().replace('name="b"', 'name="l2"'),
    "namespaces": robot(
        attributes='xmlns="http://www.ros.org" xmlns:gz="http://gz"', more='<gz:x y="1"/><gazebo/>'
    ),
    "mark of the byte order": "\ufeff" + robot().replace("><", ">\r\n<"),
    "comments": robot().replace("<axis", "<!-- <limit lower='9'/> --><axis"),
    "Latin 1": '<?xml version="1.0" encoding="ISO-8859-1"?>' + robot().replace('"r"', '"Händ"'),
}


def encoded(text):
    return text.encode("latin-1" if "ISO-8859-1" in text else "utf-8")


def followers(text):
    """Leader, factor and offset of each joint that follows another."""
    rules = {}
    for element in ElementTree.fromstring(encoded(text)).iter():
        mimic = next((part for part in element if part.tag.endswith("mimic")), None)
        if mimic is not None:
            rules[element.get("name")] = (
                mimic.get("joint"),
                float(mimic.get("multiplier", "1")),
                float(mimic.get("offset", "0")),
            )
    return rules


def positions_of(model, arm, q, rules):
    """Positions of all joints with one axis by their names."""
    at = dict.fromkeys(model.names, 0.0) | dict(zip(arm.joint_names, q, strict=True))
    for _ in rules:  # as many as the longest chain
        for name, (leader, factor, offset) in rules.items():
            at[name] = factor * at[leader] + offset
    return at


def configuration(model, at):
    """Return Pinocchio's configuration."""
    q = pin.neutral(model)
    for name, joint_model in zip(model.names, model.joints, strict=True):
        if name == "universe" or joint_model.nv != 1:
            continue
        values = [at[name]]
        if joint_model.nq == 2:
            values = [np.cos(at[name]), np.sin(at[name])]
        q[joint_model.idx_q : joint_model.idx_q + joint_model.nq] = values
    return q


@pytest.mark.parametrize("case", CASES)
def test_kinematics_limits_and_gravity_are_pinocchios(tmp_path, case):
    text = CASES[case]
    path = tmp_path / "robot.urdf"
    path.write_bytes(encoded(text))
    arm = load_arm(path, frame="tip")
    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    rules = followers(text)
    assert set(arm.joint_names) == set(model.names) - rules.keys() - {"universe", "w", "x"}

    for i, name in enumerate(arm.joint_names):
        joint_model = model.joints[model.getJointId(name)]
        expected = (-np.pi, np.pi)
        if joint_model.nq == 1:
            row = joint_model.idx_q
            expected = (model.lowerPositionLimit[row], model.upperPositionLimit[row])
        np.testing.assert_allclose((arm.lower[i], arm.upper[i]), expected)
        known = model.effortLimit[joint_model.idx_v] > 0
        assert not known or arm.effort_limits[i] == model.effortLimit[joint_model.idx_v]
        assert not known or arm.velocity_limits[i] == model.velocityLimit[joint_model.idx_v]

    for q in arm.sample(4, random_state=1):
        full = configuration(model, positions_of(model, arm, q, rules))
        pin.framesForwardKinematics(model, data, full)
        pose = data.oMf[model.getFrameId("tip")].homogeneous
        np.testing.assert_allclose(arm.forward(q), pose, atol=1e-9)
        if not any(inertia.mass for inertia in model.inertias):
            assert arm.chain.inertia is None or arm.chain.inertia[1:, 0, 0].sum() == 0.0
            continue
        gravity = pin.computeGeneralizedGravity(model, data, full)
        torques = np.zeros(arm.dof)
        for one, share in zip(arm.chain.joints, arm.chain.coupling, strict=True):
            torques += share * gravity[model.joints[model.getJointId(one.name)].idx_v]
        np.testing.assert_allclose(arm.gravity_torques(q), torques, atol=1e-9)


def loaded(tmp_path, text, **options):
    path = tmp_path / "robot.urdf"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return load_arm(path, **options)


def test_a_follower_of_a_fixed_joint_is_constant(tmp_path):
    side = link("side") + rigid("x", "base", "side")
    arm = loaded(tmp_path, c(follows("x", 2, 0.1)).replace("</robot>", side + "</robot>"))
    assert arm.joint_names == ("a", "b")
    fixed_at = loaded(tmp_path, robot(), lock={"c": 0.1})
    q = arm.sample(3, random_state=0)
    np.testing.assert_allclose(arm.forward(q), fixed_at.forward(q), atol=1e-12)


def test_a_joint_with_equal_limits_is_constant(tmp_path):
    text = b(limit='<limit lower="0.5" upper="0.5" effort="3" velocity="1"/>')
    arm = loaded(tmp_path, text)
    assert arm.joint_names == ("a", "c")
    fixed_at = loaded(tmp_path, robot(), lock={"b": 0.5})
    q = arm.sample(3, random_state=0)
    np.testing.assert_allclose(arm.forward(q), fixed_at.forward(q), atol=1e-12)
    with pytest.raises(InvalidInputError, match=r"'b'.*constant"):
        loaded(tmp_path, text, joints=["b"])


def test_a_planar_joint_within_a_chain_is_refused(tmp_path):
    text = robot(b=rigid("b", "l1", "l2", kind="planar"))
    with pytest.raises(FileFormatError, match=r"robot\.urdf.*'l2'.*planar"):
        loaded(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (b(axis="0 0 0"), "'b' must have an axis"),
        (b(origin='<origin rpy="0 0 1" quat_xyzw="0 0 0 1"/>'), "'b'.*quat_xyzw"),
        (b(origin='<origin quat_xyzw="0 0 0 0"/>'), "'b'.*quat_xyzw"),
        (b'<?xml version="1.0" encoding="punycode"?><robot name="\xe4"/>', "not a text file"),
        (b'<?xml version="1.0" encoding="gb-none"?><robot name="\xe4"/>', "gb-none"),
        ("version https://git-lfs.github.com/spec/v1\nsize 9", "git lfs pull"),
    ],
)
def test_faults_name_the_file_and_the_place(tmp_path, text, found):
    with pytest.raises(FileFormatError, match=rf"robot\.urdf.*{found}"):
        loaded(tmp_path, text)


@pytest.mark.parametrize("encoding", ["utf-16", "gb2312", "windows-1252", "iso-8859-15"])
def test_encodings_that_a_file_declares_are_read(tmp_path, encoding):
    name = "关节" if encoding == "gb2312" else "Gelenk_é"
    text = f'<?xml version="1.0" encoding="{encoding}"?>' + robot().replace('"b"', f'"{name}"')
    assert loaded(tmp_path, text.encode(encoding)).joint_names[1] == name


@pytest.mark.parametrize(
    "name",
    [
        "package://acme/meshes/a b.stl",
        "package://acme/meshes/a%20b.stl",
        "file://$(find acme)/meshes/a b.stl",
        "$(find acme)/meshes/a b.stl",
        "model://acme//meshes/a b.stl",
        "..\\..\\meshes\\a b.stl",
    ],
)
def test_meshes_are_found_by_any_name_of_their_package(tmp_path, name):
    folder = tmp_path / "acme-main"
    (folder / "urdf" / "v2").mkdir(parents=True)
    (folder / "meshes").mkdir()
    (folder / "package.xml").write_text("<package><name>acme</name></package>")
    (folder / "meshes" / "a b.stl").write_bytes(stl())
    shape = f'<collision><geometry><mesh filename="{name}"/></geometry></collision>'
    collisions = Collisions.of(loaded(folder / "urdf" / "v2", robot(links=shape)))
    assert collisions.shapes.missing == {}
    assert "tip" in collisions.shapes.collision


def test_a_mesh_that_is_a_pointer_of_git_lfs_is_named(tmp_path):
    (tmp_path / "a.stl").write_text("version https://git-lfs.github.com/spec/v1\nsize 9")
    shape = '<collision><geometry><mesh filename="a.stl"/></geometry></collision>'
    with pytest.raises(FileFormatError, match=r"a\.stl.*git lfs"):
        loaded(tmp_path, robot(links=shape)).surfaces()
