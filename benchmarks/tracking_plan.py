"""Motions that a robot could run, of the two shipped recordings and the twelve motions, beside what is asked for."""

import time as clock
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
from joblib import Parallel, delayed

import maniport as mp
from maniport.arms import VELOCITY
from maniport.arms.chain import rotation_about
from maniport.errors import ManiportWarning
from maniport.feasibility import knowing
from maniport.mocap import fit_arm, read_recording, shipped_recording
from maniport.motion import (
    ArmMotion,
    MotionLimits,
    Placement,
    Planner,
    place_path,
    plan_motion,
    track,
)
from maniport.spd.kernels import congruence
from maniport.studies.paper.trajectories import robot_arm
from maniport.transfer import method_of
from maniport.util.defaults import STUDENT_SAMPLES, TEACHER_SAMPLES
from maniport.util.subsample import evenly_spaced

from .inputs import DAMPING, Array
from .measure import Row, duration
from .tracking_runs import RATE, Outcome, spread

FLANGE, TCP = "panda_link8", "panda_hand_tcp"
RIGID, LENGTHS = "parallel-transport", "length-field"
PLACE = (0.5957287745080231, 0.8210714629120759, (0.24048688894631762, 0.2749901927125456, 0.4524298103356931))
"""Scale, turn about the vertical [rad] and middle [m] of the ladder's path: one place before the flange for good."""
POINTS = 250
"""Of a path that its place is judged by."""
EXACT, ASKED_RATIO, ASKED_SECONDS = 2e-4, 1.05, 8.0
RESULT = "d, median / 95 %"


@dataclass(frozen=True)
class Asked:
    """Bounds; None where nothing is asked for. Limits, collisions and the pointwise optimum are always asked for.

    Attributes
    ----------
    d : (float, float)
        Median and 95 %.
    rms : float
    tip : (float, float)
        95 % and largest [m], the latter or None.
    lasts, seconds : float
        Of the motion, and of finding it [s].
    """

    d: tuple[float, float] | None = None
    rms: float | None = None
    tip: tuple[float, float | None] | None = None
    lasts: float | None = None
    seconds: float | None = None

    def verdict(self, plan: ArmMotion, seconds: float) -> tuple[str, list[str]]:
        """The bounds in words, and which of them are missed by how much."""
        error = _tip(plan)
        rms = float(np.sqrt(np.mean(plan.distance**2)))
        median, most = float(np.median(plan.distance)), float(np.percentile(plan.distance, 95))
        beside = (float(1e3 * np.percentile(error, 95)), float(1e3 * error.max()))
        d, tip = self.d or (None, None), [None if one is None else 1e3 * one for one in self.tip or (None, None)]
        shares = {name: plan.limit_use.largest[name][1] for name in ("position", "velocity", "acceleration", "jerk")}
        wanted = [
            ("d median", median, d[0], ".3f"),
            ("d 95 %", most, d[1], ".3f"),
            ("rms", rms, self.rms, ".3f"),
            ("tip 95 % in mm", beside[0], tip[0], ".1f"),
            ("tip at most in mm", beside[1], tip[1], ".1f"),
            ("length in s", float(plan.control_time[-1]), self.lasts, ".1f"),
            ("seconds to find it", seconds, self.seconds, ".1f"),
            ("rms over pointwise optimum", plan.pointwise_ratio, ASKED_RATIO, ".3f"),
            *((name, share, 1.0 + 1e-9, ".3f") for name, share in shares.items()),
            ("collisions", plan.clearance.share, 0.0, ".4f"),
        ]
        asked = [(name, got, bound, form) for name, got, bound, form in wanted if bound is not None]
        said = ", ".join(
            f"{name} ≤ {bound:{form}}" for name, _, bound, form in asked if name not in (*shares, "collisions")
        )
        missed = [f"{name} {got:{form}} > {bound:{form}}" for name, got, bound, form in asked if not got <= bound]
        return said + "; limits kept, no collision", missed


@dataclass(frozen=True)
class Case:
    """A recording, a tip, a place and a pace; at the flange the target is of the rigid map, else of the field."""

    name: str
    recording: str
    frame: str
    asked: Asked
    given: dict[str, Any] = field(default_factory=dict)
    fixed: bool = False
    control: dict[str, Any] = field(default_factory=dict)
    seed: int = 0


SLOW: dict[str, Any] = {"speed_scale": 0.25, "position_tolerance": EXACT}
LEAN: dict[str, Any] = {"tilt": "free"}
CASES = (
    Case("ladder, flange, fixed place, 1/4 of the pace", "ladder", FLANGE,
         Asked((0.95, 2.30), 1.24, (1e-3, 1e-3), seconds=10.0), fixed=True, control=SLOW),
    Case("ladder, flange, free place, 1/4 of the pace", "ladder", FLANGE,
         Asked((0.92, 1.95), 1.13, (1e-3, 1e-3)), control=SLOW),
    Case("ladder, flange, as a whole", "ladder", FLANGE,
         Asked((0.95, 1.95), None, (12e-3, 40e-3), 46.0), control={"position_tolerance": 12e-3}),
    Case("ladder, hand, 1/4 of the pace", "ladder", TCP,
         Asked((0.60, 1.70), 0.83, (1e-3, 1e-3)), control=SLOW),
    Case("ladder, hand, leaning base, 1/4 of the pace", "ladder", TCP, Asked(None, 0.82), LEAN, control=SLOW),
    Case("ladder, hand, as a whole", "ladder", TCP,
         Asked((0.65, 1.75), None, (12e-3, None), 45.0), control={"position_tolerance": 12e-3}),
    Case("ladder, hand, as the demo does it", "ladder", TCP, Asked(seconds=ASKED_SECONDS, tip=(5e-3, None))),
    Case("freeform, flange, 1/4 of the pace", "freeform", FLANGE,
         Asked((0.40, 1.30), 0.65, (EXACT, None)), control=SLOW),
    Case("freeform, flange, as a whole", "freeform", FLANGE, Asked(None, None, (5e-3, None), 15.5)),
    Case("freeform, hand, 1/4 of the pace", "freeform", TCP,
         Asked((0.33, 0.86), 0.47, (1e-3, 1e-3)), control=SLOW),
    Case("freeform, hand, leaning base, 1/4 of the pace", "freeform", TCP, Asked((0.28, 0.92)), LEAN, control=SLOW),
    Case("freeform, hand, as a whole", "freeform", TCP, Asked((0.38, 1.05), None, (5e-3, None), 15.5)),
)  # fmt: skip
QUICK = ("freeform, hand, as a whole",)


@dataclass(frozen=True)
class Found:
    """A motion, and the seconds of a core: of planner, place and plan, or of planner and of all that was searched."""

    plan: ArmMotion
    seconds: tuple[float, ...]
    where: str


@cache
def recorded(name: str) -> tuple[Array, Array, Any]:
    """Times, hand positions and the fit of a shipped recording."""
    fit = fit_arm(read_recording(shipped_recording(name)), "myoarm")
    return fit.time, fit.arm.forward(fit.joint_angles)[:, :3, 3], fit


def found(case: Case) -> Found:
    """Adapt, place, plan, as the main job does."""
    time, hand, fit = recorded(case.recording)
    robot = mp.load_arm("panda", frame=case.frame)
    made = -clock.process_time()
    planner = Planner.of(MotionLimits.of(robot), VELOCITY)
    made += clock.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ManiportWarning)  # of a rotation that the clouds leave open
        domains = mp.sample_domain(fit.arm, TEACHER_SAMPLES, 0), mp.sample_domain(robot, STUDENT_SAMPLES, 1)
        adapter = method_of(RIGID if case.frame == FLANGE else LENGTHS, damping=DAMPING, base_rotation=np.eye(3))
        adapter = knowing(adapter, robot, VELOCITY, planner.arms[0].bank, 0).fit(*domains)
    target, damping = adapter.transform(fit.arm.manipulability(fit.joint_angles)), adapter.student_regularization

    every = [_there(case, robot, planner, time, hand, target, damping, False)]
    if every[0].plan.clearance.share > 0.0 and not case.fixed:  # once more, with all points in reach
        every.append(_there(case, robot, planner, time, hand, target, damping, True))
    best = min(every, key=lambda one: one.plan.clearance.share)
    return replace(best, seconds=(made, *np.sum([one.seconds for one in every], axis=0)))


def _where(placed: Placement | None) -> str:
    """Where a path was placed, in words."""
    assert placed is not None
    return f"scale {placed.scale:.2f}, tilt {np.degrees(placed.tilt):.0f}°"


def _there(
    case: Case,
    robot: mp.Arm,
    planner: Planner,
    time: Array,
    hand: Array,
    target: Array,
    damping: Any,
    reaching: bool,
) -> Found:
    """Place, with all points in reach where that is asked for, and plan."""
    begin = [clock.process_time()]
    if case.fixed:
        scale, yaw, middle = PLACE
        turn = rotation_about(2, yaw)
        profile = congruence(turn, target)
        path, where = scale * (hand - hand.mean(axis=0)) @ turn.T + np.array(middle), f"scale {scale:.2f}"
    else:
        rows = evenly_spaced(len(time), POINTS)
        placed = place_path(
            hand[rows],
            target[rows],
            planner.limits.arm,
            time=time[rows],
            whole=hand if reaching else None,
            reachability_map=planner.arms[0].reachability_map,
            bank=planner.arms[0].bank,
            damping=damping,
            random_state=case.seed,
            **case.given,
        )
        profile, path, where = placed.turned(target), placed.apply(hand), _where(placed)
    begin.append(clock.process_time())
    (plan,) = plan_motion(
        robot, profile, time=time, paths=path, damping=damping, planner=planner, random_state=case.seed, **case.control
    ).arms
    begin.append(clock.process_time())
    return Found(plan, tuple(np.diff(begin)), where)


def rows(quick: bool) -> Iterator[Row]:
    """A row for each case."""
    cases = [case for case in CASES if not quick or case.name in QUICK]
    done: list[Found] = Parallel(n_jobs=-1)(delayed(found)(case) for case in cases)
    for case, one in zip(cases, done, strict=True):
        yield _case(case, one)


def _case(case: Case, found: Found) -> Row:
    plan, seconds = found.plan, sum(found.seconds)
    wanted, missed = case.asked.verdict(plan, seconds)
    error = 1e3 * _tip(plan)
    person = float(np.ptp(plan.demonstrated_time))
    use = ", ".join(f"{name} {share:.3f}" for name, (_, share, _) in plan.limit_use.largest.items())
    note = "; ".join(
        [
            f"missed: {', '.join(missed) or 'nothing'}",
            f"largest d {plan.distance.max():.2f}, pointwise optimum {spread(plan.pointwise_best)}",
            f"tip {np.median(error):.2f} / {np.percentile(error, 95):.2f} / {error.max():.2f} mm",
            f"{plan.control_time[-1]:.1f} s long, the person's {person:.1f} s",
            f"of its limit: {use}",
            f"collisions {plan.clearance.share:.2%}, clearance {1e3 * plan.clearance.distance:.0f} mm",
            found.where,
            f"planner, place and plan {', '.join(duration(one) for one in found.seconds)} of one core",
        ]
    )
    figure = (
        f"{spread(plan.distance)}, rms {_rms(plan.distance):.3f}, {plan.pointwise_ratio:.3f} of the pointwise optimum"
    )
    return Row(f"planned: {case.name}: {RESULT}", figure, "", figure, wanted, not missed, note)


def twelve(outcomes: list[Outcome]) -> Iterator[Row]:
    """The motions that the tracker follows, planned at the same place in the same time."""
    here = [one for one in outcomes if one.placement == "free"]
    plans, alike = zip(*Parallel(n_jobs=-1)(delayed(_planned)(one) for one in here), strict=True)
    planned, tracked = (np.concatenate([plan.distance for plan in some]) for some in (plans, [o.tracked for o in here]))
    ratios, beyond = (
        {o.motion: _rms(p.distance) / _rms(t.distance) for p, o, t in zip(plans, here, some, strict=True)}
        for some in (alike, [o.tracked for o in here])
    )
    error = 1e3 * np.concatenate([_tip(plan) for plan in plans])
    limits = max(float(plan.limit_use.shares.max()) for plan in plans)
    yield Row(
        f"planned: {len(plans)} motions at half the pace: rms of d",
        f"{_rms(planned):.3f}",
        f"tracker: {_rms(tracked):.3f}",
        f"{_rms(planned):.3f}",
        "≤ 0.70",
        _rms(planned) <= 0.70,
        f"d {spread(planned)}, the tracker's {spread(tracked)}; tip {np.percentile(error, 95):.2f} mm (95 %), "
        f"{error.max():.2f} mm (largest); of a limit at most {limits:.3f}; longer than the tracker's by "
        f"{np.mean([p.control_time[-1] / np.ptp(o.tracked.time) for p, o in zip(plans, here, strict=True)]) - 1:.0%}",
    )
    worst = max(ratios, key=lambda name: ratios[name])
    yield Row(
        "planned, against tracked: rms of d, the worst motion",
        f"{ratios[worst] - 1.0:+.1%}",
        "",
        f"{ratios[worst] - 1.0:+.1%}",
        "≤ 0 %",
        ratios[worst] <= 1.0,
        "the tracker with the same margin of the joints' limits: "
        + ", ".join(f"{name} {ratio - 1.0:+.1%}" for name, ratio in ratios.items())
        + f"; without margin at most {max(beyond.values()) - 1.0:+.1%}",
    )
    floors = {o.motion: plan.pointwise_ratio for plan, o in zip(plans, here, strict=True)}
    most = max(floors, key=lambda name: floors[name])
    yield Row(
        "planned: rms of d over that of the pointwise optimum, the worst motion",
        f"{floors[most]:.3f}",
        "",
        f"{floors[most]:.3f}",
        f"≤ {ASKED_RATIO}",
        floors[most] <= ASKED_RATIO,
        ", ".join(f"{name} {ratio:.3f}" for name, ratio in floors.items()),
    )


def _planned(outcome: Outcome) -> tuple[ArmMotion, ArmMotion]:
    """The plan, and what the tracker does with the same margin of the joints' limits."""
    placed, first = outcome.placed, outcome.tracked
    planner = Planner.of(MotionLimits.of(robot_arm()), VELOCITY)
    same = {"time": first.time, "path": placed.path, "damping": first.damping}
    planned = {"planner": planner, "paths": placed.path, "position_tolerance": 1e-3}
    (plan,) = plan_motion(robot_arm(), placed.profile, time=first.time, damping=first.damping, **planned).arms
    return plan, track(planner.limits.arm, placed.profile, bank=planner.arms[0].bank, rate=RATE, **same).arms[0]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _tip(plan: ArmMotion) -> Array:
    assert plan.position_error is not None
    return plan.position_error
