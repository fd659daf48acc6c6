LIMIT = '<limit lower="-2" upper="2" effort="1" velocity="1"/>'

URDF = """<robot name="crane">
  <link name="base"><inertial><mass value="1"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="boom"><visual><geometry><capsule radius="0.04" length="0.2"/></geometry></visual></link>
  <link name="post"/><link name="trolley"/><link name="cable"/>
  <link name="hook"/><link name="camera"/><link name="swing"/>
  <joint name="turn" type="continuous"><parent link="base"/><child link="post"/>
    <origin xyz="0 0 0.4" rpy="0.1 0.2 0.3"/><axis xyz="0 0 1"/></joint>
  <joint name="raise" type="revolute"><parent link="post"/><child link="boom"/>
    <origin xyz="0.1 0 0.2"/><axis xyz="0 1 1"/><limit lower="-1" upper="1.5" effort="1" velocity="2"/></joint>
  <joint name="travel" type="prismatic"><parent link="boom"/><child link="trolley"/>
    <origin xyz="0.5 0.1 0"/><axis xyz="1 0 0"/><limit lower="0.1" upper="0.6" effort="1" velocity="0.5"/></joint>
  <joint name="level" type="revolute"><parent link="trolley"/><child link="cable"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/><mimic joint="raise" multiplier="-0.5" offset="0.2"/></joint>
  <joint name="weld" type="fixed"><parent link="cable"/><child link="camera"/><origin xyz="0 0.05 0.02"/></joint>
  <joint name="spin" type="revolute"><parent link="camera"/><child link="swing"/><origin rpy="0.3 0 0"/>
    <axis xyz="0 0 1"/><limit lower="0" upper="0" effort="1" velocity="0"/></joint>
  <joint name="end" type="fixed"><parent link="swing"/><child link="hook"/>
    <origin xyz="0.1 0 -0.3" rpy="0 1 0"/></joint>
</robot>
"""

WITH_MESHES = f"""<robot name="digger">
  <link name="base"><visual><origin xyz="0 0 0.05" rpy="0.1 0 0"/><geometry><box size="0.3 0.2 0.1"/></geometry>
    </visual>
    <collision><geometry><mesh filename="package://digger/none.stl"/></geometry></collision></link>
  <link name="boom"><visual><origin xyz="0.1 0 0"/><geometry><mesh filename="boom.stl" scale="2 1 1"/></geometry>
    </visual>
    <visual><geometry><cylinder radius="0.04" length="0.2"/></geometry></visual></link>
  <link name="flange"/>
  <link name="bucket"><visual><origin rpy="0 0.5 1"/><geometry><sphere radius="0.06"/></geometry></visual></link>
  <link name="tooth"><visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>
  <link name="lamp"><visual><geometry><box size="0.02 0.02 0.02"/></geometry></visual></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="boom"/><origin xyz="0 0 0.1" rpy="0.2 0 0.4"/>
    <axis xyz="0 1 1"/>{LIMIT}</joint>
  <joint name="weld" type="fixed"><parent link="boom"/><child link="lamp"/><origin xyz="0 0.1 0" rpy="1 0 0"/></joint>
  <joint name="push" type="prismatic"><parent link="boom"/><child link="flange"/><origin xyz="0.4 0 0" rpy="0 0.3 0"/>
    <axis xyz="1 0 0"/>{LIMIT}</joint>
  <joint name="hang" type="fixed"><parent link="flange"/><child link="bucket"/><origin xyz="0 0 0.1"/></joint>
  <joint name="bite" type="revolute"><parent link="bucket"/><child link="tooth"/>{LIMIT}</joint>
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
