"""Live: commands keep the limits over the time of this machine, whatever times the frames of a sender have."""

import gc

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher
from toy import FakeClock, require_limits

import maniport as mp

TICK = 0.01


@pytest.fixture(scope="module")
def led(small_result, second):
    """A function that makes a robot led by an arm of a person, and positions of its points, shape (300, p, 3).

    The person moves three times as slowly as recorded, at 100 Hz.
    """
    result, plan = small_result, small_result.arm.motion
    limits = plan.limits
    options = {
        "path": result.arm.placement, "motion_limits": limits, "collisions": result.arm.collisions,
        "reference": plan.joint_positions, "start": 0.5 * (limits.lower + limits.upper),
    }  # fmt: skip

    def make(clock):
        return mp.Live(result.arm.fit, result.arm.adapter, result.arm.robot, clock=clock, **options)

    shown = second.select(make(None).points)
    time, flat = np.linspace(shown.time[0], shown.time[-1], 300), shown.positions.reshape(len(shown.time), -1)
    columns = [np.interp(time, shown.time, column) for column in flat.T]
    return make, np.stack(columns, axis=1).reshape(300, -1, 3)


def senders():
    """Times of frames [s] by the sender and on this machine, shape (2, n)."""
    even = TICK * np.arange(300)
    draw = np.random.default_rng(0)
    stalled = np.where(even % 0.5 < 0.3, np.ceil(even / 0.5) * 0.5 + 1e-4 * np.arange(300), even)
    cases = {"3 × the frame rate": (even / 3, even)}
    cases |= {"bursts after stalls": (even, np.maximum.accumulate(stalled))}
    cases |= {"noise": (even, np.sort(even + draw.uniform(-TICK, TICK, 300)))}
    return cases


@pytest.mark.parametrize("name", senders())
def test_commands_keep_the_limits_over_the_time_here(small_result, led, name):
    """Fast and slow clocks, wrong frame rates, no pauses, bursts: each command is judged when it is returned.

    The far start lets the robot move at its limits.
    """
    clock, limits, (make, frames) = FakeClock(), small_result.arm.motion.limits, led
    live, times, moved, q = make(clock), [], [], []
    for points, sent, came in zip(frames, *senders()[name], strict=True):
        clock.now = 1000.0 + came
        moment = live.step(points, sent)
        times.append(clock.now)
        moved.append(moment.time)
        q.append(moment.joint_positions)
    require_limits(limits, times, q)
    require_limits(limits, moved, q)
    assert np.abs(np.diff(q, axis=0)).max() > 0.0


def test_a_long_step_is_not_made_up_for(small_result, led):
    """After a step that took 80 ms, the next command comes soon, and is near: at most 2 ms of motion are ahead."""
    clock, limits, (make, frames) = FakeClock(), small_result.arm.motion.limits, led
    live, sent, q = make(clock), [], []
    for i, points in enumerate(frames[:100]):
        clock.delays = [0.0, 0.08] if i % 10 == 5 else []
        moment = live.step(points, TICK * i)
        sent.append(clock.now)
        q.append(moment.joint_positions)
        clock.now += 1e-3 if i % 10 == 5 else TICK
    far = np.abs(np.diff(q, axis=0)) / limits.velocity
    assert (far <= np.diff(sent)[:, None] + 2e-3 + 1e-9).all()


def test_a_clock_that_goes_back_stops_the_robot(small_result, led):
    """It moves on when the clock is where it was."""
    clock, (make, frames) = FakeClock(), led
    live, q, times = make(clock), [], []
    for i, back in enumerate(np.where(np.arange(100) % 20 == 9, 5.0, 0.0)):
        clock.now = 1000.0 + TICK * i - back
        moment = live.step(frames[i], TICK * i)
        times.append(moment.time)
        q.append(moment.joint_positions)
        if back:
            np.testing.assert_array_equal(q[-1], q[-2])
    require_limits(small_result.arm.motion.limits, times, q)


def test_frames_need_no_times(led):
    """Without a time a frame is of now; a step without a frame needs none. A robot that sees nobody rests in time."""
    clock, (make, frames) = FakeClock(), led
    live = make(clock)
    for points in frames[:30]:
        clock.now += TICK
        live.step(points)
    for _ in range(60):
        clock.now += TICK
        moment = live.step(None)
    assert moment.state == "holding"
    assert not moment.joint_velocities.any()
    assert moment.time == pytest.approx(clock.now)


def compiled():
    """Signatures of all numba functions of the package, and of others, by their names."""
    gc.collect()
    found = [one for one in gc.get_objects() if isinstance(one, Dispatcher)]
    return {(one.py_func.__module__, one.py_func.__qualname__, str(one.signatures)) for one in found}


def test_nothing_is_compiled_after_preparation(led):
    """Whatever arrays frames are: read-only, of other types or orders, lists, mappings, hidden, jumping, none."""
    make, frames = led
    clock = FakeClock()
    live = make(clock)
    before = compiled()
    locked = frames[2].copy()
    locked.flags.writeable = False
    hidden = frames[3].copy()
    hidden[::2] = np.nan
    rows = dict(zip(live.points, frames[4], strict=True))
    given = [
        frames[0], frames[1].tolist(), locked, hidden, rows, frames[5].astype("f4"), frames[6].astype(">f8"),
        np.asfortranarray(frames[7]), np.repeat(frames[8], 2, axis=0)[::2], (1e3 * frames[9]).astype(int), None,
        frames[10][::-1], np.ma.masked_array(frames[11], mask=hidden != hidden), np.zeros_like(locked),
        frames[12].astype(object),
    ]  # fmt: skip
    for i, points in enumerate(given * 3):
        clock.now += 0.3 if i == 20 else TICK
        live.step(points, TICK * i)
    for _ in range(30):
        clock.now += TICK
        live.step(None)
    live.step(frames[0], 100.0)
    assert compiled() == before
