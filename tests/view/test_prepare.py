"""What the live view begins with."""

import numpy as np

from maniport.view import prepare
from maniport.view.state import Wish


def test_the_view_begins_with_the_length_field(monkeypatch):
    """Parallel transport is shown until the length field, which `maniport transfer` mostly chooses, is fitted."""
    for name, size in {"TEACHER_SAMPLES": 128, "STUDENT_SAMPLES": 256, "BANK_SIZE": 512}.items():
        monkeypatch.setattr(prepare, name, size)
    state, method, turn = prepare.prepare("rhuman", "panda")
    try:
        assert method == "lengths-field"
        joints = 0.5 * (state.teacher.lower + state.teacher.upper)
        asked = state.ask(Wish(joints, method, turn))
        assert np.all(np.linalg.eigvalsh(asked.target) > 0)
        assert "lengths-field" in asked.note
        assert "parallel-transport" in asked.note
    finally:
        state.refitting.close()
