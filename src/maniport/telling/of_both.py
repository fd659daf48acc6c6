"""Facts of a run with both arms: what concerns the pair, and of each arm what is told of a run of one."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from maniport.pipeline import BothResult
from maniport.telling.answer import Answer
from maniport.telling.facts import INFO, Fact, Facts, Section, Table, numbers, spread, told, warnings_of
from maniport.telling.of_motion import room_facts
from maniport.telling.of_people import FIT
from maniport.telling.of_recording import RECORDING
from maniport.telling.of_run import QUESTIONS, STEP, run_facts
from maniport.telling.status import GREEN, status_of

SIDES = "left", "right"
CARDS = 2
"""So many figures of each arm stand in the verdict: more do not fit beside one another."""
COLLIDE = (
    "The arms collide, with themselves or one another. Place the bases farther apart, or keep only the way from tip to "
    "tip (--tips relative)."
)
SHARED = "recording"
"""The section that is the same for both arms."""


@told.register
def both_facts(result: BothResult) -> Facts:
    """Tell what became of the motions of both arms, what matters most first."""
    each = [run_facts(one) for one in result.each]
    source = Path(result.recording.source).stem or "A recording"
    spec, count = result.left.spec, len(result.fits)
    _, asked = QUESTIONS.get((spec.kind, spec.part), ("", "where can the hands move and turn easily?"))
    motion = result.motion
    followed = "" if motion is None else f", and moves in {np.ptp(motion.control_time):.1f} s"
    shared = next(section for section in each[0].sections if section.key == SHARED)
    facts = Facts(
        f"{source[:1].upper()}{source[1:]} → {result.robot.name}, both arms: {asked}",
        f"A person moves both arms for {np.ptp(result.fits.time):.1f} s, {count} moments. {result.robot.name} is asked "
        f"for the same with its two arms, the left one by {result.left.method}, the right one by {result.right.method}"
        f"{followed}. The folders left and right hold what is known of each arm.",
        (
            _pair(result),
            *(section for side, facts in zip(SIDES, each, strict=True) for section in _of_one(side, facts)),
            shared,
        ),
        doubts=(*warnings_of(RECORDING, result.recording.doubts), *warnings_of(FIT, result.fits.doubts)),
    )
    return replace(facts, verdict=_verdict(result, each, facts.warning_keys))


def _pair(result: BothResult) -> Section:
    """Tell of both arms together."""
    facts = [*warnings_of(STEP, result.warnings)]
    motion = result.motion
    if motion is not None:
        how = "refined together" if motion.together else "those of each arm alone: the arms do not meet"
        facts += [
            *room_facts(motion.room, float(np.interp(motion.room.time, motion.time, result.fits.time)),
                        None if result.left.execution is None else result.left.execution.collisions),
            Fact("Postures", how, "", "together", motion.together),
            *([] if motion.beside_way is None else [
                spread("Way from tip to tip", "beside_way", 1e3 * motion.beside_way, result.fits.time, "mm",
                       role="achieved", meaning="Beside the one from hand to hand, scaled and turned, which alone is "
                       "kept of the paths: node floors and what the path costs are those of this way."),
            ]),
            Fact("Ratio to the best pointwise solutions found", f"{motion.certificate:.2f}",
                 "Root mean square of both distances over that of the node floors.", "certificate", motion.certificate),
        ]  # fmt: skip
    shared = ", ".join(result.robot.shared)
    facts += [
        Fact("Robot", f"{result.robot.name}, {result.robot.dof} joints, tips {result.robot.left.frame} and "
             f"{result.robot.right.frame}" + (f"; both arms share {shared}" if shared else ""),
             key="robot", value={"name": result.robot.name, "joints": list(result.robot.joint_names),
                                 "shared": list(result.robot.shared)}),
        *numbers(duration_s=float(np.ptp(result.fits.time))),
    ]  # fmt: skip
    return Section("Both arms", tuple(facts), _table(result), key="pair")


def _table(result: BothResult) -> tuple[Table, ...]:
    """Compare the arms; nothing where they were not moved."""
    rows, values = [], {}
    for side, one in zip(SIDES, result.each, strict=True):
        if one.execution is None:
            return ()
        motion, plan = one.execution.motion, one.execution.plan
        rms, floor = (float(np.sqrt(np.mean(of**2))) for of in (motion.distance, plan.node_floor))
        value = {"method": one.method, "rms": rms, "node_floor_rms": floor, "gap": float(np.mean(one.execution.gap))}
        tip = "–"
        if motion.position_error is not None:
            value["tip_p95_mm"] = 1e3 * float(np.percentile(motion.position_error, 95))
            tip = f"{value['tip_p95_mm']:.1f} mm"
        values[side] = value
        rows.append((side, one.method, f"{rms:.2f}", f"{floor:.2f}", f"{value['gap']:.2f}", tip))
    caption = "Distances from target to achieved ellipsoids, and the tip beside its path."
    columns = "arm", "method", "rms", "node floor, rms", "gap, mean", "tip, 95 %"
    return (Table(columns, tuple(rows), caption, "arms", values),)


def _of_one(side: str, facts: Facts) -> list[Section]:
    """The sections of one arm, with whose they are; warnings and notes, which stand elsewhere, too, say it as well."""
    whose = f"{side.capitalize()} arm"
    return [
        replace(
            section,
            title=f"{whose}: {section.title[:1].lower()}{section.title[1:]}",
            key=f"{side}_{section.key}" if section.key else "",
            facts=tuple(
                fact if fact.severity == INFO or not fact.text else replace(fact, text=f"{whose}: {fact.text}")
                for fact in section.facts
            ),
        )
        for section in facts.sections
        if section.key != SHARED
    ]


def _verdict(result: BothResult, each: list[Facts], reasons: Sequence[str]) -> Answer:
    """Summarize both arms, each as a run of one arm does; `reasons` are the keys of all warnings."""
    told_of = {side: facts.verdict for side, facts in zip(SIDES, each, strict=True) if facts.verdict is not None}
    room = None if result.motion is None else result.motion.room
    collides = room is not None and room.known and room.share > 0.0
    status = "" if result.motion is None else status_of(reasons)
    cards = [
        replace(card, name=f"{side}, {card.name}")
        for k in range(CARDS)
        for side, one in told_of.items()
        for card in one.cards[k : k + 1]
    ]
    tried = " ".join(_said(side, one.advice) for side, one in told_of.items() if one.advice and one.status != GREEN)
    return Answer(
        " ".join(_said(side, one.title) for side, one in told_of.items()),
        " ".join(
            [
                *([COLLIDE] if collides else []),
                *(_said(side, one.text) for side, one in told_of.items() if one.text),
            ]
        ),
        " ".join(_said(side, one.doubts) for side, one in told_of.items() if one.doubts),
        "Run it: joints.csv has the motion of both arms." if status == GREEN else tried,
        "",
        status,
        tuple(reasons) if status else (),
        tuple(cards),
    )


def _said(side: str, text: str) -> str:
    return f"{side.capitalize()}: {text[:1].lower()}{text[1:]}"
