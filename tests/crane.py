"""A small robot: a crane with an eye beside its hook, a joint without limits and a slide."""

CRANE = """<robot name="crane"><link name="base"/><link name="post"/><link name="lift"/><link name="hook"/>
  <link name="eye"/>
  <joint name="turn" type="continuous"><parent link="base"/><child link="post"/><axis xyz="0 0 1"/></joint>
  <joint name="up" type="prismatic"><parent link="post"/><child link="lift"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="0.5" effort="1" velocity="0.2"/></joint>
  <joint name="nod" type="revolute"><parent link="lift"/><child link="hook"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="look" type="revolute"><parent link="post"/><child link="eye"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>
"""
