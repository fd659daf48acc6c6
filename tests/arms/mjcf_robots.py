"""Robots of an MJCF with geoms of every kind, and with rules of MuJoCo for their contacts."""

ASSETS = '<asset><mesh name="wedge" vertex="0 0 0 .2 0 0 0 .1 0 0 0 .15" refpos=".02 0 .01" scale="1 -1 1"/></asset>'
CLASSES = """<default><geom group="3"/><default class="seen"><geom contype="0" conaffinity="0" group="2"/></default>
  <default class="two"><geom contype="2" conaffinity="2"/></default></default>"""
LINKS = {
    "box": '<geom type="box" size=".05 .03 .08" euler="20 0 30"/>',
    "sphere": '<geom size=".09" pos="0 .02 .05"/>',
    "capsule": '<geom type="capsule" size=".04 .1" euler="0 40 0"/>',
    "cylinder": '<geom type="cylinder" size=".06" fromto="0 0 0 .1 0 .1"/>',
    "ellipsoid": '<geom type="ellipsoid" size=".05 .12 .07" euler="0 0 30"/>',
    "mesh": '<geom type="mesh" mesh="wedge" euler="10 20 0"/>',
    "several": '<geom size=".04" pos=".1 0 0"/><geom type="box" size=".02 .02 .1"/>'
    '<geom class="seen" type="box" size=".2 .2 .2"/>',
    "first bit": '<geom type="box" size=".08 .04 .04" contype="2" conaffinity="0"/>',
    "second bit": '<geom type="box" size=".08 .08 .04" contype="0" conaffinity="2"/>',
    "other class": '<geom class="two" type="capsule" size=".05 .1"/>',
}


def serial(links, world="", contact="", option=""):
    """A robot with a fixed base and bodies b1, b2, … of some links, each with a welded body that has no geom."""
    bodies = ""
    for i, link in enumerate(links, 1):
        axis = ("0 0 1", "0 1 0", "1 0 0")[i % 3]
        named = LINKS[link].replace("<geom ", f'<geom name="g{i}" ', 1)
        bodies += (
            f'<body name="b{i}" pos=".02 0 .17"><joint name="j{i}" axis="{axis}" range="-130 130"/>'
            f'{named}<body name="weld{i}"/>'
        )
    return (
        f'<mujoco model="r">{option}{CLASSES}{ASSETS}<worldbody>{world}<body name="base"><geom size=".05"/>'
        f"{bodies}{'</body>' * len(links)}</body></worldbody><contact>{contact}</contact></mujoco>"
    )


FLOOR = '<geom type="plane" size="0 0 1" pos="0 0 -.05" euler="12 0 0"/>'
ROBOTS = {
    "solids": serial(["capsule", "box", "sphere", "cylinder", "ellipsoid", "mesh"]),
    "several geoms": serial(["capsule", "several", "box", "several", "mesh"]),
    "bits": serial(["first bit", "box", "second bit", "other class", "second bit", "box"]),
    "floor": serial(["capsule", "capsule", "mesh", "ellipsoid"], world=FLOOR),
    "wall": serial(
        ["capsule", "capsule", "box", "capsule"],
        world='<geom type="box" size=".02 .5 .5" pos=".25 0 .3" contype="2"/>',
    ),
    "exclude": serial(
        ["capsule", "capsule", "box", "sphere", "box"],
        contact='<exclude body1="base" body2="b3"/><exclude body1="b2" body2="b4"/>',
    ),
    "pair": serial(
        ["capsule", "capsule", "box", "sphere", "box"],
        contact='<exclude body1="b1" body2="b4"/><pair geom1="g1" geom2="g4"/><pair geom1="g2" geom2="g3"/>',
    ),
    "neighbors": serial(
        ["capsule", "cylinder", "sphere", "box"],
        option='<option><flag filterparent="disable"/></option>',
    ),
}
