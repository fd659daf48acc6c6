"""A ZIP archive with one recording is read; what else it holds is an error that names it."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maniport.errors import FileFormatError
from maniport.mocap import read_recording
from maniport.mocap.readers import archive as reader

CASES = Path(__file__).parent / "cases"
BVH = (CASES / "control.bvh").read_text()


def packed(path, members, compression=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def test_one_recording_is_read():
    expected = read_recording(CASES / "control.bvh")
    recording = read_recording(CASES / "one_recording.bvh.zip")
    assert_allclose(recording.positions, expected.positions)
    assert (recording.format, recording.source) == (".bvh", "control.bvh")
    assert any("archive" in note for note in recording.notes)


@pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
@pytest.mark.parametrize("name", ["data/walk.BVH", "walk.txt", "a b/walk.1.bvh"])
def test_folders_and_other_files_do_not_matter(tmp_path, compression, name):
    members = {name: BVH, "__MACOSX/._walk.bvh": "x", ".DS_Store": "x"}
    if name != "walk.txt":
        members["README.md"] = "about"
    file = packed(tmp_path / "a.zip", members, compression)
    part = read_recording(file, start=0.5, stop=1.0)
    whole = read_recording(CASES / "control.bvh").crop(0.5, 1.0)
    assert_allclose(part.positions, whole.positions)
    assert_allclose(part.time, whole.time)


def test_an_archive_without_an_ending_and_arrays_in_one(tmp_path):
    packed(tmp_path / "a.download", {"walk.bvh": BVH})
    assert read_recording(tmp_path / "a.download").format == ".bvh"
    recording = read_recording(CASES / "control.bvh")
    recording.save(tmp_path / "b.npz")
    (tmp_path / "b.npz").rename(tmp_path / "b.zip")
    assert_allclose(read_recording(tmp_path / "b.zip").positions, recording.positions)
    recording.save(tmp_path / "c.npz")
    packed(tmp_path / "c.zip", {"c.npz": (tmp_path / "c.npz").read_bytes()})
    assert_allclose(read_recording(tmp_path / "c.zip").positions, recording.positions)


@pytest.mark.parametrize(
    ("members", "words"),
    [
        ({"a.bvh": BVH, "b/c.trc": "x"}, r"2 recordings.*a\.bvh, b/c\.trc"),
        ({"a.txt": "x", "b.md": "y"}, r"no recording.*a\.txt, b\.md"),
        ({"a.zip": b"PK"}, r"no recording.*a\.zip"),
        ({}, "no file"),
        ({"a.bvh": BVH[:900]}, r"a\.bvh: the file is cut off"),
        ({"a.fbx": "Kaydara FBX Binary"}, r"a\.fbx.*Blender"),
    ],
)
def test_other_contents_are_named(tmp_path, members, words):
    file = packed(tmp_path / "data.zip", members)
    with pytest.raises(FileFormatError, match=rf"data\.zip: .*{words}") as caught:
        read_recording(file)
    assert str(tmp_path) not in str(caught.value).replace(str(file), "")


def test_no_more_is_unpacked_than_other_files_may_have(tmp_path, monkeypatch):
    monkeypatch.setattr(reader, "RECORDING_BYTES", 2**20)
    file = packed(tmp_path / "bomb.zip", {"a.bvh": bytes(3 * 2**20)})
    with pytest.raises(FileFormatError, match=r"a\.bvh.*3 MB.*1 MB"):
        read_recording(file)
    lying = bytearray(file.read_bytes())
    size = (3 * 2**20).to_bytes(4, "little")
    while size in lying:  # both headers declare a small file
        at = lying.index(size)
        lying[at : at + 4] = (1000).to_bytes(4, "little")
    file.write_bytes(lying)
    with pytest.raises(FileFormatError, match=r"bomb\.zip"):
        read_recording(file)


@pytest.mark.parametrize("size", [1, 30, 2000])
def test_damaged_archives_are_rejected(tmp_path, size):
    content = (CASES / "one_recording.bvh.zip").read_bytes()
    file = tmp_path / "a.zip"
    file.write_bytes(content[:size])
    with pytest.raises(FileFormatError, match=r"a\.zip"):
        read_recording(file)
    broken = bytearray(content)
    broken[200:400] = np.random.default_rng(0).bytes(200)
    file.write_bytes(broken)
    with pytest.raises(FileFormatError, match=r"a\.zip"):
        read_recording(file)


def test_an_encrypted_archive_is_rejected(tmp_path):
    content = bytearray((CASES / "one_recording.bvh.zip").read_bytes())
    content[6] |= 1
    content[content.index(b"PK\1\2") + 8] |= 1
    (tmp_path / "a.zip").write_bytes(content)
    with pytest.raises(FileFormatError, match="encrypted"):
        read_recording(tmp_path / "a.zip")
