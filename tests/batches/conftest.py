"""Recordings, and a batch of them, that several tests look at."""

import shutil

import pytest
from small_batches import small

from maniport.demonstrations import shipped_recording


@pytest.fixture(scope="session")
def recordings(tmp_path_factory):
    """Six equal recordings in two folders."""
    folder = tmp_path_factory.mktemp("recordings")
    for name in ("anna/1.c3d", "anna/2.c3d", "anna/3.c3d", "ben/1.c3d", "ben/2.c3d", "ben/3.c3d"):
        (folder / name).parent.mkdir(exist_ok=True)
        shutil.copy(shipped_recording("freeform"), folder / name)
    return folder


@pytest.fixture(scope="session")
def whole(recordings, tmp_path_factory):
    """All of them on two robots, by one process."""
    folder = tmp_path_factory.mktemp("whole") / "dataset"
    return small([recordings], folder)
