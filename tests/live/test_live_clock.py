"""Live: commands keep the limits over the time of this machine, whatever times the frames of a sender have."""

import gc

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher
from toy import FakeClock, require_limits

import maniport as mp

TICK = 0.01
EVEN = TICK * np.arange(300)
STALLED = np.where(EVEN % 0.5 < 0.3, np.ceil(EVEN / 0.5) * 0.5 + 1e-4 * np.arange(300), EVEN)
NOISE = np.random.default_rng(0).uniform(-TICK, TICK, 300)
SENDERS = {  # times of frames [s] by the sender and on this machine
    "3 × the frame rate": (EVEN / 3, EVEN),
    "bursts after stalls": (EVEN, np.maximum.accumulate(STALLED)),
    "noise": (EVEN, np.sort(EVEN + NOISE)),
}


@pytest.fixture(scope="module")
def led(small_result, second):
    """A function that makes a robot, from the middle of its range, and frames of a slow person, shape (300, p, 3)."""
    limits = small_result.arm.motion.limits

    def make(clock):
        return mp.Live.of(
            small_result,
            clock=clock,
            auto_engage=True,
            start=0.5 * (limits.arm.lower + limits.arm.upper),
        )

    shown = second.select(make(None).points)
    time = np.linspace(shown.time[0], shown.time[-1], 300)
    flat = shown.positions.reshape(len(shown.time), -1)
    columns = [np.interp(time, shown.time, column) for column in flat.T]
    return make, np.stack(columns, axis=1).reshape(300, -1, 3)


@pytest.mark.parametrize("name", SENDERS)
def test_commands_keep_the_limits_over_the_time_here(small_result, led, name):
    """Fast and slow clocks, wrong frame rates, no pauses, bursts: each command is judged when it is returned."""
    clock = FakeClock()
    limits = small_result.arm.motion.limits
    (make, frames) = led
    live = make(clock)
    times = []
    states = []
    for points, sent, came in zip(frames, *SENDERS[name], strict=True):
        clock.now = 1000.0 + came
        states.append(live.step(points, sent))
        times.append(clock.now)
    q = [state.joint_positions for state in states]
    require_limits(limits, times, q)
    require_limits(limits, [state.time for state in states], q)
    assert np.abs(np.diff(q, axis=0)).max() > 0.0


def test_a_long_step_is_not_made_up_for(small_result, led):
    """After a step that took 80 ms, the next command comes soon, and is near: at most 2 ms of motion are ahead."""
    clock = FakeClock()
    limits = small_result.arm.motion.limits
    (make, frames) = led
    live = make(clock)
    sent = []
    q = []
    for i, points in enumerate(frames[:100]):
        clock.delays = [0.0, 0.08] if i % 10 == 5 else []
        q.append(live.step(points, TICK * i).joint_positions)
        sent.append(clock.now)
        clock.now += 1e-3 if i % 10 == 5 else TICK
    far = np.abs(np.diff(q, axis=0)) / limits.velocity
    assert (far <= np.diff(sent)[:, None] + 2e-3 + 1e-9).all()


def test_a_clock_that_goes_back_stops_the_robot(small_result, led):
    clock = FakeClock()
    (make, frames) = led
    live = make(clock)
    states = []
    back = np.where(np.arange(100) % 20 == 9, 5.0, 0.0)
    for i, points in enumerate(frames[:100]):
        clock.now = 1000.0 + TICK * i - back[i]
        states.append(live.step(points, TICK * i))
    q = np.array([state.joint_positions for state in states])
    assert not np.diff(q, axis=0)[back[1:] > 0.0].any()
    require_limits(small_result.arm.motion.limits, [state.time for state in states], q)


def test_frames_need_no_times(led):
    clock = FakeClock()
    (make, frames) = led
    live = make(clock)
    for points in [*frames[:30], *[None] * 60]:
        clock.now += TICK
        state = live.step(points)
    assert state.state == "holding"
    assert not state.joint_velocities.any()
    assert state.time == pytest.approx(clock.now)


def compiled():
    """Signatures of all numba functions of the package, and of others, by their names."""
    gc.collect()
    # `type`, since some objects of other packages fail on `isinstance`
    functions = [item for item in gc.get_objects() if issubclass(type(item), Dispatcher)]
    return {
        (item.py_func.__module__, item.py_func.__qualname__, str(item.signatures))
        for item in functions
    }


def test_nothing_is_compiled_after_preparation(led):
    """Whatever arrays frames are: read-only, of other types or orders, lists, mappings, hidden, jumping, none."""
    (make, frames), clock = led, FakeClock()
    live = make(clock)
    before = compiled()
    locked = frames[2].copy()
    locked.flags.writeable = False
    hidden = frames[3].copy()
    hidden[::2] = np.nan
    shown = [
        frames[0],
        frames[1].tolist(),
        locked,
        hidden,
        dict(zip(live.points, frames[4], strict=True)),
        frames[5].astype("f4"),
        frames[6].astype(">f8"),
        np.asfortranarray(frames[7]),
        np.repeat(frames[8], 2, axis=0)[::2],
        (1e3 * frames[9]).astype(int),
        None,
        frames[10][::-1],
        np.ma.masked_array(frames[11], mask=hidden != hidden),
        np.zeros_like(locked),
        frames[12].astype(object),
    ]
    for i, points in enumerate(shown * 3):
        clock.now += 0.3 if i == 20 else TICK
        live.step(points, TICK * i)
    for _ in range(30):
        clock.now += TICK
        live.step(None)
    live.step(frames[0], 100.0)
    assert compiled() == before
