"""Facts of a run: of the main job, and of a robot's motion along given ellipsoids."""

import platform
from dataclasses import replace
from importlib import metadata
from pathlib import Path

import numpy as np

from maniport.bodies import Arm
from maniport.pipeline import TransferResult
from maniport.pipeline.execution import Execution
from maniport.telling.answer import rounded_sum
from maniport.telling.facts import Fact, Facts, Section, at_moment, listed, numbers, told, warning, warnings_of
from maniport.telling.of_evaluation import evaluation_section
from maniport.telling.of_motion import gap_facts, gap_warnings, motion_section, plan_facts
from maniport.telling.of_people import FIT, person_section
from maniport.telling.of_placement import placement_section
from maniport.telling.of_recording import RECORDING, recording_section
from maniport.telling.of_robot import chain_facts, limits_in_words
from maniport.telling.of_transfer import adapter_section, mounting_in_words
from maniport.telling.verdict import unmoved, verdict_of
from maniport.transfer import DomainAdapter
from maniport.transfer.rigid_adapter import RigidAdapter, transport_rotation
from maniport.transfer.rotation_group import rotation_angle
from maniport.validation import Array
from maniport.version import __version__
from maniport.wording import argument

QUESTIONS = {
    ("velocity", "translation"): ("fast it can move", "where can the hand move easily?"),
    ("velocity", "rotation"): ("fast it can turn", "where can the hand turn easily?"),
    ("force", "translation"): ("strongly it can push", "where can the hand push strongly?"),
    ("force", "rotation"): ("strongly it can twist", "where can the hand twist strongly?"),
}
"""What an ellipsoid tells of a hand, and what a robot is asked, by kind and part."""

STEP = "step"
"""Key of warnings that a step of the run gave."""

SOFTWARE = {"numpy": "NumPy", "scipy": "SciPy", "pin": "Pinocchio", "pin-pink": "Pink"}


@told.register
def run_facts(result: TransferResult) -> Facts:
    """Tell what became of a person's motion, what matters most first."""
    robot, execution = result.robot, result.execution
    source = Path(result.recording.source).stem or "A recording"
    does, asked = QUESTIONS.get(
        (result.spec.kind, result.spec.part), ("well it can move and turn", "where can the hand move and turn easily?")
    )
    followed = "" if execution is None else f", and moves in {np.ptp(execution.motion.control_time):.1f} s"
    facts = Facts(
        f"{source[:1].upper()}{source[1:]} → {robot.name}: {asked}",
        f"A person moves the {result.fit.arm.side} arm for {np.ptp(result.time):.1f} s. At each of {len(result.time)} "
        f"moments the ellipsoid at the hand tells how {does} in each direction. {robot.name} is asked for the same, "
        f"fitted to what it can do by {result.method}{followed}.",
        (
            *([_not_moved(result)] if execution is None else motion_sections(execution, result.time)),
            *_judged(result),
            *(
                replace(section, folded=True)
                for section in (
                    _adapter(result),
                    person_section(result.fit),
                    recording_section(result.recording),
                    _settings(result),
                )
            ),
        ),
        doubts=(*warnings_of(RECORDING, result.recording.doubts), *warnings_of(FIT, result.fit.doubts)),
    )
    if execution is None:
        return replace(facts, verdict=unmoved(result))
    return replace(facts, verdict=verdict_of(execution, result.time, facts.warning_keys, result))


@told.register
def execution_facts(execution: Execution) -> Facts:
    """Tell what a robot was asked for and what it achieves."""
    motion, robot = execution.motion, execution.robot
    files = Fact("Files", listed(execution.sources), "The target ellipsoids, and the path where there is one.",
                 "sources", list(execution.sources))  # fmt: skip
    settings = files, *robot_facts(robot, execution), *software(execution.random_state)
    done = Section("What was done", settings, key="run", folded=True)
    lead = f"{len(motion.time)} target ellipsoids, followed by {robot.name} in {np.ptp(motion.control_time):.1f} s."
    title = f"{Path(execution.sources[0]).stem} → {robot.name}" if execution.sources else f"The motion of {robot.name}"
    facts = Facts(title, lead, (*motion_sections(execution), done))
    return replace(facts, verdict=verdict_of(execution, motion.time, facts.warning_keys))


def motion_sections(execution: Execution, clock: Array | None = None) -> list[Section]:
    """Tell of the motion, and of the place of its path; `clock` as in `motion_section`."""
    time = execution.motion.time if clock is None else clock
    motion, placed = execution.motion, execution.placement
    nearness = [
        *plan_facts(execution.plan, execution.motion, execution.room, clock, execution.collisions),
        *_lowest(execution, time),
        *_parts(execution),
        *_price(execution),
        *gap_facts(execution.gap, time),
    ]
    moved = motion_section(motion, nearness, clock)
    where = (
        []
        if placed is None
        else [placement_section(placed, np.interp(execution.placed_time, execution.motion.time, time))]
    )
    return [moved, *where]


def _lowest(execution: Execution, time: Array) -> list[Fact]:
    """Report the lowest point of each moving link; warn where it is below the base plane and no table is given."""
    lowest, collisions = execution.lowest, execution.collisions
    if lowest is None:
        return [warning("unchecked-floor", "the height above the base plane is unknown: no link has a known shape")]
    when = {
        point.link: float(np.interp(point.time, execution.motion.time, time)) for point in execution.lowest_of_links
    }
    value = {p.link: {"height_mm": 1e3 * p.height, "at_s": when[p.link]} for p in execution.lowest_of_links}
    text = f"{1e3 * lowest.height:.0f} mm, {lowest.link} {at_moment(when[lowest.link])}"
    fact = Fact("Lowest point", text, "Of the moving links, above the base plane.", "lowest_points", value)
    if lowest.height >= 0.0 or (collisions is not None and collisions.table is not None):
        return [fact]
    below = (
        f"{lowest.link} is up to {-1e3 * lowest.height:.0f} mm below the base plane ({at_moment(when[lowest.link])})"
    )
    return [warning("below-base-plane", f"{below}. {argument('table', 0)} keeps the robot above it"), fact]


def _parts(execution: Execution) -> list[Fact]:
    """Return the mean distance as the sum of its parts."""
    parts, mean = execution.parts, float(np.mean(execution.motion.distance))
    total, (infeasible, path, motion) = rounded_sum(parts)
    return [Fact("Mean distance", f"{total} = infeasible {infeasible} + path {path} + motion {motion}",
                 "Infeasible: distance of the target to the feasible set. Path: what keeping the tip on its path adds. "
                 "Motion: what limits and smoothness add.",
                 "mean_distance", {"mean": mean, **parts._asdict()})]  # fmt: skip


def _price(execution: Execution) -> list[Fact]:
    """Tell what the orientation of the tip costs."""
    if execution.free is None:
        return []
    kept, free = (float(np.mean(one.distance)) for one in (execution.plan, execution.free))
    text = f"{kept - free:+.2f} in the mean distance: {kept:.2f}; {free:.2f} with the tip turned freely"
    return [Fact("Price of the orientation", text, "Both planned alike.", "orientation_price",
                 {"kept": kept, "free": free})]  # fmt: skip


def robot_facts(robot: Arm, execution: Execution | None = None) -> list[Fact]:
    """Name the robot, and the settings of its motion."""
    chain = chain_facts(robot)
    known = {"name": robot.name, "joints": robot.dof, **{fact.key: fact.value for fact in chain}}
    base, _, held = (fact.text for fact in chain)
    facts = [
        Fact("Robot", f"{robot.name}, {robot.dof} joints, from {base} to its tip, {robot.frame}", key="robot",
             value=known),
        Fact("Joints", limits_in_words(robot), "How far each of them may move.", "joint_limits",
             {name: [low, high] for name, low, high in zip(robot.joint_names, robot.lower, robot.upper, strict=True)}),
        Fact("Held", held, "Joints that could move."),
    ]  # fmt: skip
    if execution is None:
        return facts
    motion = execution.motion
    rate = float((len(motion.control_time) - 1) / np.ptp(motion.control_time))
    return [
        *facts,
        Fact("Control rate", f"{rate:.4g} Hz", "", "control_rate", rate, "Hz"),
        Fact("Damping", f"{motion.damping.epsilon:.3g}", "Added to all eigenvalues before ellipsoids are compared.",
             "damping", motion.damping.epsilon),
    ]  # fmt: skip


def software(seed: int | None) -> list[Fact]:
    """Tell what it takes to make a result again: the seed and the software."""
    versions = {"maniport": __version__, "Python": platform.python_version()}
    for package, name in SOFTWARE.items():
        try:
            versions[name] = metadata.version(package)
        except metadata.PackageNotFoundError:  # installed by other means than a package
            versions[name] = "of unknown version"
    text = listed([f"{name} {version}" for name, version in versions.items()])
    return [
        Fact(
            "Seed",
            "none" if seed is None else str(seed),
            "The same seed and versions give the same numbers.",
            "random_state",
            seed,
        ),
        Fact("Versions", text, key="versions", value=versions),
    ]


def _judged(result: TransferResult) -> list[Section]:
    """Tell of the transfer beside simpler ways, where it was judged."""
    judged = result.evaluation
    return [] if judged is None else [evaluation_section(judged, choice=result.choice, time=result.time)]


def _not_moved(result: TransferResult) -> Section:
    gaps = None if result.evaluation is None else result.evaluation.adapter.feasibility_gap
    facts = [] if gaps is None else gap_warnings(gaps.median)
    return Section("The target", tuple(facts), key="motion", text="The robot was not moved.")


def _adapter(result: TransferResult) -> Section:
    """Tell of the fit, with what a run knows beside the adapter."""
    adapter, sizes = result.adapter, (len(result.teacher_domain), len(result.student_domain))
    started = "Time to fit" if result.choice is None else "Time to choose and fit"
    return adapter_section(
        adapter,
        Fact("Domains", f"{sizes[0]} samples of the person, {sizes[1]} of the robot",
             key="samples", value={"teacher": sizes[0], "student": sizes[1]}),
        *_beside_transport(adapter),
        Fact(started, f"{result.seconds_to_fit:.2f} s"),  # not for JSON: the same seed gives the same bytes
        mounted=True,
    )  # fmt: skip


def _beside_transport(adapter: DomainAdapter) -> list[Fact]:
    """Tell how far a rigid map is turned from parallel transport; nothing of others, which turn nothing."""
    if not isinstance(adapter, RigidAdapter):
        return []
    start = transport_rotation(adapter.teacher_mean_, adapter.student_mean_)
    away = float(np.degrees(rotation_angle(adapter.rotation_, start)))
    return [Fact("Beside parallel transport", f"{away:.2f}°", "How far the rotation is from that of the closed form.",
                 "rotation_from_transport", away, "°")]  # fmt: skip


def _settings(result: TransferResult) -> Section:
    spec = result.spec
    facts = (
        *warnings_of(STEP, result.warnings),
        *robot_facts(result.robot, result.execution),
        Fact("Ellipsoids", f"{len(result.time)}, {spec.kind}, {spec.part}",
             "The person's are in the trunk frame (x forward, y left, z up), the robot's in its base frame.",
             "ellipsoids", {"kind": spec.kind, "part": spec.part, "count": len(result.time)}),
        Fact("Mounting", mounting_in_words(result.mounting), "From the person's trunk frame to the robot's base.",
             "mounting", result.mounting.round(6).tolist()),
        *numbers(method=result.method),
        *software(result.random_state),
    )  # fmt: skip
    return Section("What was done", facts, key="run")
