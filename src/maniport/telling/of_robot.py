"""Facts of arms: the chain that is taken of a robot, in words and as the command line takes it."""

import shlex
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from maniport.bodies import PERSONS, Arm, Arms, load_arm
from maniport.bodies.chain import PRISMATIC
from maniport.bodies.collisions import Collisions
from maniport.bodies.readers import ROBOTS
from maniport.bodies.readers.packages import pair_of, places_of
from maniport.bodies.readers.tip import Limb
from maniport.errors import argument
from maniport.telling.facts import Fact, Facts, Section, Table, listed, told, warning
from maniport.tracking.motion_limits import QUANTITIES, MotionLimits

PER = ("", "/s", "/s²", "/s³")
"""Of the units of `QUANTITIES`."""


@told.register
def arm_facts(arm: Arm) -> Facts:
    """Tell what an arm is: its joints with their limits, what is held, and the frames that there are."""
    limits = {name: [low, high] for name, low, high in zip(arm.joint_names, arm.lower, arm.upper, strict=True)}
    rows = tuple(zip(arm.joint_names, map(_span, *_ranges(arm)), _speeds(arm), strict=True))
    known = (
        Fact("Arm", arm.name + (f", a person's {arm.side} arm" if arm.side else ""), key="arm", value=arm.name),
        Fact("Degrees of freedom", str(arm.dof), key="degrees_of_freedom", value=arm.dof),
        *chain_facts(arm),
        *_following(arm),
        Fact("Frames", listed(arm.frames), key="frames", value=list(arm.frames)),
        *([] if arm.side else assumed_limits(MotionLimits.of(arm, margin=0.0))),  # a person's motion is not planned
    )
    joints = Table(("joint", "limits", "largest speed"), rows, key="joints", value=limits)
    return Facts(arm.name, "", (Section("", known, (joints,)),))


@told.register
def pair_facts(arms: Arms) -> Facts:
    """Tell what a pair of arms is: what both share, and each of them."""
    known = (
        Fact("Arms", arms.name, key="arms", value=arms.name),
        Fact("Degrees of freedom", str(arms.dof), key="degrees_of_freedom", value=arms.dof),
        Fact("Shared", listed(arms.shared), "Joints that move both.", "shared", list(arms.shared)),
    )
    each = zip(("left", "right"), arms.each, strict=True)
    sections = [replace(arm_facts(arm).sections[0], title=side.capitalize(), key=side) for side, arm in each]
    return Facts(arms.name, "", (Section("", known), *sections))


def chain_facts(arm: Arm) -> list[Fact]:
    """Tell where a chain begins and ends, and what is held."""
    chain = arm.chain
    held = {name: float(value) for name, value in chain.locked.items()}
    texts = [f"{name} at {_position(arm, name, value)}" for name, value in held.items()]
    return [
        Fact("Base", base_of(arm), "The frame in which positions and directions are told.", "base", base_of(arm)),
        Fact("Tip", arm.frame, key="frame", value=arm.frame),
        Fact("Held", listed(texts), "Joints that could move.", "held", held),
    ]


def base_of(arm: Arm) -> str:
    """The frame in which an arm's positions are told; the first that stands there where none was chosen."""
    first = (
        name for name, place in arm.chain.frames.items() if not place.joint and np.allclose(place.placement, np.eye(4))
    )
    return arm.chain.base or next(first, "the base")


def limits_in_words(arm: Arm) -> str:
    """Joints and how far they may move, beside one another."""
    spans = (_short(low, high, unit) for low, high, unit in zip(*_ranges(arm), strict=True))
    return listed([f"{name} {span}" for name, span in zip(arm.joint_names, spans, strict=True)])


def typed(arm: Arm) -> str:
    """An arm as the command line takes it, with what differs from the default."""
    chain, name = arm.chain, arm.name if arm.name in ROBOTS else arm.chain.source or f"{arm.name}.urdf"
    words = [shlex.quote(name)]
    if name not in ROBOTS or arm.frame != load_arm(name).frame:
        words.append(f"--frame {shlex.quote(arm.frame)}")
    if chain.base is not None and chain.stand is None:
        words.append(f"--base {shlex.quote(chain.base)}")
    for joint, value in chain.locked.items():
        position = value if _slides(arm, joint) else np.degrees(value)
        words.append(f"--lock {shlex.quote(f'{joint}={position:.7g}')}")
    return " ".join(words)


def assumed_limits(limits: MotionLimits) -> list[Fact]:
    """Warn of limits that are assumed, with their values and how to give real ones."""
    arm, found, real = limits.arm, [], f"Give the real ones with {argument('motion_limits', option='--limits')}"
    units = dict(zip(arm.joint_names, arm.joint_units, strict=True))
    for order, quantity in enumerate(QUANTITIES):
        names, values = limits.assumed[quantity], list[str]()
        for name in names:
            i, unit = arm.joint_names.index(name), units[name] + PER[order]
            if quantity == "position":
                values.append(f"{limits.lower[i]:.3g} to {limits.upper[i]:.3g} {unit}")
            else:
                values.append(f"{getattr(limits, quantity)[i]:.4g} {unit}")
        if names:
            same = {text: [n for n, own in zip(names, values, strict=True) if own == text] for text in values}
            each = "; ".join(
                f"{text} for {listed(joints) if len(joints) < arm.dof else 'all joints'}"
                for text, joints in same.items()
            )
            found.append(warning(f"assumed-{quantity}-limits", f"{quantity} limits are assumed: {each}. {real}"))
    return found


def missing_meshes(links: Sequence[str]) -> list[Fact]:
    """Warn of links that are checked by their collision shapes because their meshes are missing."""
    text = f"meshes of {listed(links)} are missing; the collision shapes of these links are checked instead"
    return [warning("missing-meshes", text)] if links else []


def unchecked_links(links: Sequence[str]) -> list[Fact]:
    """Warn of links without a shape, and of pairs of links, that are not checked for collisions."""
    text = f"not checked for collisions: {listed(links)}; their shapes are unknown or convex hulls always meet"
    return [warning("unchecked-links", text)] if links else []


def _shape_facts(arm: Arm) -> list[Fact]:
    """Warn of what collision checking of a robot leaves out."""
    collisions = Collisions.of(arm)
    if not collisions.known:
        return [warning("unchecked-collisions", f"collisions are not checked: {collisions.why}")]
    return [*missing_meshes(collisions.stand_ins), *unchecked_links(collisions.unchecked)]


def robot_facts(name: str, limbs: Sequence[Limb], arm: Arm | None) -> Facts:
    """Tell what a robot's file holds: the chain that is taken, if one is, and the other ends that one may name."""
    others = [limb for limb in limbs if arm is None or limb.tip != arm.frame]
    rows = tuple((limb.tip, str(len(limb.joints)), _way(limb.joints), limb.fork or "") for limb in others)
    value = {limb.tip: {"joints": list(limb.joints), "fork": limb.fork} for limb in others}
    table = Table(("--frame", "joints", "from … to", "--base"), rows, key="ends", value=value)
    text = "Fingers are left out. With --base the chain begins where two limbs part."
    ends = Section("Other ends" if arm is not None else "Ends", (), (table,), text=text) if others else None
    places = () if name in (*ROBOTS, *PERSONS) else places_of(name)
    known = [Fact("From", listed(places), "The first one is taken." if places[1:] else "", "from", list(places))]
    if arm is not None:
        own, *more = arm_facts(arm).sections
        unchecked = [] if arm.side else _shape_facts(arm)
        own = replace(own, facts=(*(known if places else ()), *own.facts, *unchecked))
        return Facts(arm.name, "", (own, *more, *([] if ends is None else [ends])))
    arms = " or ".join(pair_of(name))
    lead = f"Several limbs are as long as one another: choose one with --frame{f', or name {arms}' if arms else ''}."
    return Facts(name, lead, (Section("", tuple(known)), *([] if ends is None else [ends])))


def _ranges(arm: Arm) -> tuple[Sequence[float], Sequence[float], Sequence[str]]:
    return arm.lower.tolist(), arm.upper.tolist(), arm.joint_units


def _span(low: float, high: float, unit: str) -> str:
    span = f"{low:.3f} to {high:.3f} {unit}"
    return f"{span} ({np.degrees(low):.0f}° to {np.degrees(high):.0f}°)" if unit == "rad" else span  # as people think


def _short(low: float, high: float, unit: str) -> str:
    return f"{np.degrees(low):.0f}° to {np.degrees(high):.0f}°" if unit == "rad" else f"{low:.3g} to {high:.3g} m"


def _speeds(arm: Arm) -> list[str]:
    speeds = np.full(arm.dof, np.inf) if arm.velocity_limits is None else arm.velocity_limits
    return [
        f"{speed:.3g} {unit}/s" if speed < np.inf else "not known"
        for speed, unit in zip(speeds, arm.joint_units, strict=True)
    ]


def _following(arm: Arm) -> list[Fact]:
    """Tell which joints follow others."""
    chain = arm.chain
    found = {}
    for joint, row, offset in zip(chain.joints, chain.coupling, chain.offset, strict=True):
        if joint.name not in (*chain.coordinates, *chain.locked):
            terms = [f"{factor:g} · {name}" for factor, name in zip(row, chain.coordinates, strict=True) if factor]
            found[joint.name] = " + ".join([*terms, *([f"{offset:.3g}"] if offset or not terms else [])])
    return [Fact("Following", listed([f"{name} = {rule}" for name, rule in found.items()]),
                 "Joints that others move.", "following", found)]  # fmt: skip


def _way(joints: Sequence[str]) -> str:
    return joints[0] if len(joints) == 1 else f"{joints[0]} … {joints[-1]}"


def _slides(arm: Arm, name: str) -> bool:
    return any(joint.name == name and joint.kind == PRISMATIC for joint in arm.chain.joints)


def _position(arm: Arm, name: str, value: float) -> str:
    return f"{value:.3g} m" if _slides(arm, name) else f"{np.degrees(value):.3g}°"
