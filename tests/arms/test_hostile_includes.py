"""Robots' files that include others: what would never end, or would break native readers, is refused before."""

import os

import pytest

from maniport.arms import load_arm
from maniport.errors import FileFormatError

ROBOT = '<mujoco><worldbody><body name="a"><joint name="j"/>{}</body></worldbody></mujoco>'


def part(folder, name, content):
    """A file to be included."""
    (folder / name).write_text(f"<mujocoinclude>{content}</mujocoinclude>")
    return f'<include file="{name}"/>'


def test_bodies_in_bodies_count_over_all_files(tmp_path):
    """A row of files that are each flat enough is refused as one that is as deep as all of them."""
    inner = ""
    for k in range(40):
        inner = part(tmp_path, f"{k}.xml", "<body>" * 100 + inner + "</body>" * 100)
    (tmp_path / "a.xml").write_text(ROBOT.format(inner))
    with pytest.raises(FileFormatError, match="levels of elements within elements, with the files that it includes"):
        load_arm(tmp_path / "a.xml")


XACRO = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r"><link name="base"/>{}</robot>'
DOUBLING = "".join(
    f'<xacro:macro name="m{k}" params=""><xacro:m{k + 1}/><xacro:m{k + 1}/></xacro:macro>' for k in range(40)
)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ('<xacro:include filename="/dev/zero"/>', "/dev/zero: this is a pipe, a socket or a device"),
        ('<xacro:include filename="pipe.xacro"/>', "this is a pipe, a socket or a device"),
        ("<link name=\"${load_yaml('/dev/zero')}\"/>", "/dev/zero: this is a pipe, a socket or a device"),
        (DOUBLING + '<xacro:macro name="m40" params=""/><xacro:m0/>', "it takes more than 2 s"),
        ("<link name=\"${'x' * 10**10}\"/>", r"when evaluating expression ''x' \* 10\*\*10'"),
    ],
    ids=["device", "pipe", "settings", "doubling macros", "memory"],
)
def test_xacro_files_that_never_end(tmp_path, monkeypatch, content, told):
    """Macros that double, a name of 10 GB, devices and pipes among included files and settings end with a message."""
    pytest.importorskip("xacrodoc")
    monkeypatch.setattr("maniport.arms.loaders.document.LONGEST_XACRO", 2.0 if "2 s" in told else 30.0)
    os.mkfifo(tmp_path / "pipe.xacro")
    (tmp_path / "a.xacro").write_text(XACRO.format(content))
    with pytest.raises(FileFormatError, match=rf"a\.xacro: xacro cannot expand it: .*{told}"):
        load_arm(tmp_path / "a.xacro")
