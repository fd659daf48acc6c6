"""Small files that use much of what their formats have."""

LIMIT = '<limit lower="-2" upper="2" effort="1" velocity="1"/>'

URDF = f"""<?xml version="1.0"?>
<robot name="small">
  <link name="base"><inertial><mass value="1"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="upper"><visual><origin xyz="0 0 0.1" rpy="0.1 0 0"/>
    <geometry><box size="0.3 0.2 0.1"/></geometry></visual>
  </link>
  <link name="fore"><visual><geometry><cylinder radius="0.04" length="0.2"/></geometry></visual></link>
  <link name="left"/><link name="right"/><link name="tool0"/>
  <joint name="turn" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 1"/></joint>
  <joint name="bend" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0 0 0.3" rpy="0.2 0 0.4"/>
    <axis xyz="0 1 0"/>{LIMIT}</joint>
  <joint name="push" type="prismatic"><parent link="fore"/><child link="tool0"/><axis xyz="1 0 0"/>{LIMIT}</joint>
  <joint name="open" type="prismatic"><parent link="tool0"/><child link="left"/>{LIMIT}</joint>
  <joint name="shut" type="prismatic"><parent link="tool0"/><child link="right"/>{LIMIT}
    <mimic joint="open" multiplier="-1" offset="0.1"/></joint>
</robot>
"""

WITH_MESHES = f"""<robot name="digger">
  <link name="base"/>
  <link name="boom"><visual><origin xyz="0.1 0 0"/>
    <geometry><mesh filename="boom.stl" scale="2 1 1"/></geometry></visual>
    <visual><geometry><capsule radius="0.04" length="0.2"/></geometry></visual></link>
  <link name="bucket"><visual><geometry><mesh filename="package://digger/boom.stl"/></geometry></visual></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="boom"/>{LIMIT}</joint>
  <joint name="hang" type="fixed"><parent link="boom"/><child link="bucket"/><origin xyz="0 0 0.1"/></joint>
</robot>
"""

MJCF = """<mujoco model="small">
  <compiler angle="radian" meshdir="." eulerseq="xyz"/>
  <default><joint range="-2 2" damping="1"/>
    <default class="slide"><joint type="slide" range="0 0.4"/></default></default>
  <asset><mesh name="wedge" file="boom.stl" scale="1 2 -1"/><mesh name="own" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>
  <worldbody><geom type="plane" size="1 1 1"/>
    <body name="upper" pos="0.2 0 0"><joint name="a" axis="0 0 1" range="-1 1"/>
      <joint name="b" axis="0 1 0" pos="0.1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
      <geom type="mesh" mesh="wedge" contype="0" conaffinity="0" pos="0.1 0 0" euler="0.3 0 1"/>
      <geom type="capsule" fromto="0 0 0 0.1 0 0.2" size="0.05"/><site name="mark" pos="0 0 0.1" quat="1 0 0 0"/>
      <body name="fore" pos="0.3 0 0.1" quat="0.7 0.7 0 0"><joint name="c" class="slide" axis="1 0 0"/>
        <geom type="ellipsoid" size="0.1 0.02 0.03"/><geom type="mesh" mesh="own" contype="0" conaffinity="0"/>
        <body name="finger"><joint name="d" type="hinge" axis="0 1 0" ref="0.1"/>
          <geom type="sphere" size="0.02"/></body>
      </body>
    </body>
  </worldbody>
  <equality><joint joint1="d" joint2="b" polycoef="0.1 0.5 0 0 0"/></equality>
</mujoco>
"""

SRDF = """<?xml version="1.0"?>
<robot name="panda">
  <group name="arm"><chain base_link="panda_link0" tip_link="panda_link8"/></group>
  <disable_collisions link1="panda_link0" link2="panda_link1" reason="Adjacent"/>
  <disable_collisions link1="panda_link1" link2="panda_link2" reason="Adjacent"/>
  <disable_collisions link1="panda_hand" link2="panda_leftfinger" reason="Never"/>
</robot>
"""
