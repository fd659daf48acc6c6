import importlib

import pytest


@pytest.mark.parametrize("name", ["", ".spd", ".transfer", ".learning", ".motion", ".evaluation", ".mocap", ".arms"])
def test_every_public_name_exists(name):
    module = importlib.import_module(f"maniport{name}")
    assert set(module.__all__) <= set(dir(module))
    assert all(getattr(module, public, None) is not None for public in module.__all__)
    assert not hasattr(module, "no_such_name")
