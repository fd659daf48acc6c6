"""The cache of compiled functions: damaged, emptied, foreign, full or not to be written, it costs time and a line."""

import ast
import errno
import importlib.util
import logging
import sys
from pathlib import Path

import numpy as np
import pytest

import maniport
from maniport import compiling

SOURCE = "def twice(x):\n    return 2.0 * x\n"


@pytest.fixture
def compiled(tmp_path, monkeypatch, caplog):
    """Compile a function of a module of its own, anew at each call; the cache is beside the module."""
    file = tmp_path / "twice.py"
    file.write_text(SOURCE)
    caplog.set_level(logging.WARNING, "maniport.compiling")

    def compiled():
        monkeypatch.setattr(compiling, "_told", False)
        caplog.clear()
        spec = importlib.util.spec_from_file_location("twice", file)
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, "twice", module)  # as of modules that are imported; Numba looks for it there
        spec.loader.exec_module(module)
        return compiling.njit(cache=True)(module.twice)

    return compiled


def hits(kernel):
    """How often a compiled function came out of the cache."""
    return sum(kernel.stats.cache_hits.values())


def test_what_was_compiled_is_there_next_time(compiled, caplog):
    """The second time nothing is compiled and nothing said."""
    assert (compiled()(1.5), hits(compiled())) == (3.0, 0)
    kernel = compiled()
    assert (kernel(1.5), hits(kernel)) == (3.0, 1)
    assert not caplog.records


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("change", ["emptied", "cut", "written over", "one bit", "a folder"])
def test_damage_is_mended_with_a_line(compiled, caplog, tmp_path, suffix, change):
    """The result is right, one line says what was damaged, and the run after has its cache again."""
    compiled()(1.5)
    (file,) = tmp_path.rglob(f"*.{suffix}")
    content = file.read_bytes()
    if change == "a folder":
        file.unlink()
        file.mkdir()
    else:
        flipped = content[:-200] + bytes([content[-200] ^ 1]) + content[-199:]
        noise = np.random.default_rng(0).bytes(len(content))
        file.write_bytes({"emptied": b"", "cut": content[:-9], "written over": noise, "one bit": flipped}[change])
    kernel = compiled()
    assert (kernel(1.5), hits(kernel)) == (3.0, 0)
    assert len([record for record in caplog.records if "compiling anew" in record.getMessage()]) == 1
    if change != "a folder":
        kernel = compiled()
        assert (kernel(1.5), hits(kernel), caplog.records) == (3.0, 1, [])


def test_a_cache_of_another_version_is_left_alone(compiled, caplog, monkeypatch):
    """It is no damage: what another Numba compiled is compiled anew without a word."""
    compiled()(1.5)
    first = compiled()
    monkeypatch.setattr(first._cache._cache_file, "_version", "another")
    assert (first(1.5), hits(first), caplog.records) == (3.0, 0, [])


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS])
def test_a_full_disk_costs_the_cache_only(compiled, caplog, monkeypatch, number):
    """The function is compiled and works, and a line says that it was not kept."""

    def fail(self, path, stored):
        raise OSError(number, "no room")

    monkeypatch.setattr(compiling._CheckedFiles, "_write", fail)
    assert compiled()(1.5) == 3.0
    assert [record.levelname for record in caplog.records] == ["WARNING"]


def test_without_any_folder_there_is_no_cache(compiled, caplog, monkeypatch):
    """Where nothing can be written at all, everything works."""

    def fail(self, function):
        raise RuntimeError("cannot cache function 'twice': no locator available")

    monkeypatch.setattr(compiling._SoundCache, "__init__", fail)
    assert compiled()(1.5) == 3.0
    assert len(caplog.records) == 1


def test_every_kernel_is_compiled_here():
    """No module takes Numba's own decorator, whose cache does not survive."""
    home = Path(maniport.__file__).parent
    found = [
        str(file.relative_to(home))
        for file in home.rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.ImportFrom) and node.module == "numba" and any(one.name == "njit" for one in node.names)
    ]
    assert found == []
