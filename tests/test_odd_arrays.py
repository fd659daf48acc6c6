"""Damaged and odd members of every kind of ``.npz`` file: a `ManiportError`, never another one."""

import io
import zipfile

import numpy as np
import pytest

from maniport import load_adapter, load_arm
from maniport.demonstrations import read_recording
from maniport.errors import FileFormatError, ManiportError
from maniport.files import load_ellipsoids, load_path, save_ellipsoids, save_path
from maniport.profiles import ProfileGMM
from maniport.tracking import StartBank
from maniport.transfer import RawCopy

TIMES = np.arange(24) / 10
ARM = np.broadcast_to([[0.0, 0.0, 1.4], [0.0, 0.0, 1.1], [0.0, 0.0, 0.85]], (24, 3, 3))


def ellipsoids():
    """Draw positive-definite matrices (24, 3, 3)."""
    factors = np.random.default_rng(0).normal(size=(24, 3, 3))
    return factors @ factors.transpose(0, 2, 1) + 0.1 * np.eye(3)


def load_bank(path):
    """Load a start bank of the Panda."""
    return StartBank.load(path, load_arm("panda"))


WRITERS = {
    "ellipsoids": (lambda path: save_ellipsoids(path, ellipsoids(), TIMES), load_ellipsoids),
    "path": (lambda path: save_path(path, ARM[:, 2], TIMES), load_path),
    "recording": (
        lambda path: np.savez(path, names=["RSHO", "RELB", "RWRA"], positions=ARM, time=TIMES, unit="m", up="z"),
        read_recording,
    ),
    "recording with a rate": (
        lambda path: np.savez(path, names=["RSHO", "RELB", "RWRA"], positions=ARM, rate=10.0),
        read_recording,
    ),
    "poses": (
        lambda path: np.savez(path, poses=np.zeros((24, 66)), trans=np.zeros((24, 3)), mocap_framerate=10.0),
        read_recording,
    ),
    "adapter": (lambda path: RawCopy().fit(ellipsoids(), ellipsoids()).save(path), load_adapter),
    "profile model": (
        lambda path: ProfileGMM(n_components=1, random_state=0).fit(TIMES, ellipsoids()).save(path),
        ProfileGMM.load,
    ),
    "start bank": (lambda path: StartBank.build(load_arm("panda"), 64, random_state=0).save(path), load_bank),
}


def npy(array):
    """Write an array in NumPy's format."""
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.asarray(array))
    return stream.getvalue()


def headed(descr, shape, content=b""):
    """Write what claims to be an array of any type and shape."""
    header = repr({"descr": descr, "fortran_order": False, "shape": shape}).encode()
    header += b" " * (-(len(header) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + content


DAMAGED = {
    "text": b"hello",
    "nothing": b"",
    "half a header": npy(np.eye(3))[:20],
    "half": npy(np.eye(3))[:-8],
    "larger than any integer": headed("<f8", (10**22, 0)),
    "huge, of no bytes": headed("|S0", (10**13,)),
    "negative": headed("<f8", (-1,)),
    "objects": headed("|O", (1,), b"\x80\x04N."),
    "no Unicode": headed("<U1", (), b"\xff" * 4),
}
ODD = {
    "0-d": npy(1.0),
    "0-d integer": npy(3),
    "empty": npy(np.zeros(0)),
    "one": npy(np.ones(1)),
    "complex": npy(1j * np.ones(24)),
    "dates": npy(np.arange(24).astype("M8[s]")),
    "fields": npy(np.zeros(24, [("a", "f8")])),
    "words": npy(["a", "b"]),
    "bytes": npy([b"\xff"]),
    "long text": npy("[" * 20_000),
}


@pytest.fixture(scope="module", params=WRITERS)
def file(request, tmp_path_factory):
    """Write a sound file of each kind; its members, and what loads it."""
    write, load = WRITERS[request.param]
    path = tmp_path_factory.mktemp("sound") / "sound.npz"
    write(path)
    load(path)
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}, load


def pack(path, members, compression=zipfile.ZIP_STORED):
    """Write members to an archive."""
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(name, content)


@pytest.mark.parametrize("content", [*DAMAGED.values(), *ODD.values()], ids=[*DAMAGED, *ODD])
def test_a_member_of_another_content(file, content, tmp_path):
    """Each member in turn is replaced: a damaged one is a `FileFormatError`, an odd one is read or refused."""
    members, load = file
    for name in members:
        pack(tmp_path / "odd.npz", members | {name: content})
        try:
            load(tmp_path / "odd.npz")
        except ManiportError as error:
            assert isinstance(error, FileFormatError) or content not in DAMAGED.values()  # noqa: PT017 - odd is allowed
        else:
            assert content not in DAMAGED.values()


@pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_members_of_every_compression(file, compression, tmp_path):
    """All compressions are read; a file with a changed byte is read or refused with a `ManiportError`."""
    members, load = file
    path = tmp_path / "packed.npz"
    pack(path, members, compression)
    load(path)
    content = path.read_bytes()
    for place in np.random.default_rng(0).integers(len(content), size=12):
        path.write_bytes(content[:place] + bytes([content[place] ^ 0xFF]) + content[place + 1 :])
        try:
            load(path)
        except ManiportError as error:
            assert len(str(error)) < 4096  # noqa: PT017 - reading well is allowed
    path.write_bytes(content.replace(b"\x05\x00\x5d", b"\x05\x00\xff"))  # properties of LZMA that do not exist
    if compression == zipfile.ZIP_LZMA:
        with pytest.raises(FileFormatError):
            load(path)


def test_two_members_of_one_array(file, tmp_path):
    """The member with NumPy's ending is the array, whatever else has its name."""
    members, load = file
    pack(tmp_path / "twice.npz", members | {name.removesuffix(".npy"): b"x" for name in members})
    load(tmp_path / "twice.npz")
