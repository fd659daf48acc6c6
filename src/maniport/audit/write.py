"""Files of an audit: tables of episodes and frames, numbers for programs, and a page."""

import json
import os
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from maniport.audit.audit import Audit, EpisodeResult, Finding
from maniport.audit.checks import COLLISION, KINDS, SHARES, FrameTable
from maniport.audit.curves import Curves
from maniport.util.optional import arrow_of_datasets, parquet_of_datasets
from maniport.util.parts import WrittenInParts
from maniport.version import __version__

if TYPE_CHECKING:
    import pyarrow.parquet

PAGE = "audit.html"
NUMBERS = "audit.json"
KEPT = "keep.json"
EPISODES = "episodes.parquet"
FRAMES = "frames.parquet"
AUDIT_FILES = frozenset({PAGE, NUMBERS, KEPT, EPISODES, FRAMES})
"""Files of an audit. A folder with other files is not replaced."""


class FrameFile(WrittenInParts):
    """``frames.parquet``, to which the frames of episodes are written one after the other; a context manager.

    Parameters
    ----------
    path : Path
    joint_names : tuple of str
    """

    def __init__(self, path: Path, joint_names: tuple[str, ...]):
        self._arrow = arrow_of_datasets()
        self._parquet = parquet_of_datasets()
        self._path = path
        self._joints = joint_names
        self._writer: pyarrow.parquet.ParquetWriter | None = None
        self._waiting: list[object] = []
        self._rows = 0

    def finish(self) -> None:
        """Write the frames that wait."""
        self._flush()

    def close(self) -> None:
        """Close the file."""
        if self._writer is not None:
            self._writer.close()

    def write(self, episode: int, table: FrameTable) -> None:
        """Append the frames of an episode."""
        count = len(table.time)
        arrow = self._arrow
        columns: dict[str, object] = {
            "episode": np.full(count, episode),
            "frame": np.arange(count),
            "time_s": table.time,
        }
        for kind in SHARES:
            columns[f"{kind}_share"] = table.shares[kind].astype(np.float32)
            joints = table.joints[kind].astype(np.int32)
            columns[f"{kind}_joint"] = arrow.DictionaryArray.from_arrays(joints, list(self._joints))
        for kind in KINDS:
            columns[f"{kind}_exceeded"] = table.exceeded[kind]
        columns["singular_value"] = table.singular_value.astype(np.float32)
        columns["speed_m_s"] = table.speed.astype(np.float32)
        columns["speed_share"] = table.speed_share.astype(np.float32)
        columns["force_n"] = table.force.astype(np.float32)
        self._waiting.append(arrow.table(columns))
        self._rows += count
        if self._rows > 100_000:
            self._flush()

    def _flush(self) -> None:
        """Write the frames that wait as one group of rows."""
        if not self._waiting:
            return
        whole = self._arrow.concat_tables(self._waiting)
        if self._writer is None:
            self._writer = self._parquet.ParquetWriter(self._path, whole.schema, compression="zstd")
        self._writer.write_table(whole)
        self._waiting = []
        self._rows = 0


def write_audit(folder: Path, audit: Audit) -> None:
    """Write all files of an audit but ``frames.parquet`` to an existing folder."""
    arrow = arrow_of_datasets()
    rows = [episode_row(one) for one in audit.episodes]
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    parquet_of_datasets().write_table(arrow.table(columns), folder / EPISODES, compression="zstd")
    _write_json(folder / NUMBERS, as_numbers(audit))
    _write_json(folder / KEPT, {"episodes": list(audit.kept)})
    (folder / PAGE).write_text(page(audit), encoding="utf-8")


def episode_row(result: EpisodeResult) -> dict[str, object]:
    """Return the row of an episode; None where a quantity is not checked."""
    row: dict[str, object] = {
        "episode": result.episode,
        "name": result.name,
        "frames": result.frames,
        "duration_s": result.duration,
        "failed": ",".join(result.failed),
    }
    for kind, finding in result.findings.items():
        if kind != COLLISION:
            row[f"{kind}_share"] = _or_none(finding.share)
        row[f"{kind}_{'pair' if kind == COLLISION else 'joint'}"] = finding.joint or None
        row[f"{kind}_time_s"] = _or_none(finding.time)
        row[f"{kind}_frames"] = finding.frames
    row["singular_value"] = _or_none(result.singular_value)
    row["speed_m_s"] = _or_none(result.speed)
    row["speed_share"] = _or_none(result.speed_share)
    row["force_n"] = _or_none(result.force)
    return row


def as_numbers(audit: Audit) -> dict[str, object]:
    """Return the result of an audit for programs."""
    findings = {}
    for kind in KINDS:
        worst = audit.worst_of(kind)
        findings[kind] = {
            "counts": kind in audit.fail_on,
            "episodes": audit.count(kind),
            "worst": None if worst is None else _finding(worst, worst.findings[kind]),
        }
    return {
        "maniport": __version__,
        "dataset": os.path.abspath(audit.dataset),
        "format": audit.kind,
        "robot": audit.robot.name,
        "clean": not audit.failed,
        "episodes": len(audit.episodes),
        "frames": audit.frames,
        "failed": [one.episode for one in audit.failed],
        "fail_on": list(audit.fail_on),
        "tolerance": audit.options.tolerance,
        "unit": audit.options.unit,
        "columns": audit.columns,
        "ignored_columns": list(audit.ignored),
        "findings": findings,
        "not_checked": [vars(one) for one in audit.not_checked],
        "notes": list(audit.notes),
    }


def verdict(audit: Audit) -> str:
    """Return the result in one sentence."""
    count = len(audit.failed)
    if not audit.fail_on:
        return f"Nothing could be checked of {len(audit.episodes)} motions."
    if not count:
        return f"No findings in {len(audit.episodes)} motions."
    return f"{count} of {len(audit.episodes)} motions have findings."


def lines(audit: Audit) -> list[str]:
    """Return the result in lines of text, for a terminal."""
    texts = [verdict(audit)]
    for kind in audit.fail_on:
        worst = audit.worst_of(kind)
        if worst is not None and audit.count(kind):
            texts.append(f"  {kind}: {audit.count(kind)} motions; worst: {_sentence(worst, kind)}")
    unchecked = [one for one in audit.not_checked if one.complete]
    texts += [f"  not checked: {one.kind}: {one.reason}" for one in unchecked]
    return texts


def page(audit: Audit) -> str:
    """Return the page of an audit."""
    from jinja2 import Environment, PackageLoader  # slow to load

    from maniport.report.page import document

    environment = Environment(
        loader=PackageLoader(__package__, "assets"), autoescape=True, trim_blocks=True
    )
    kinds = []
    for kind in KINDS:
        worst = audit.worst_of(kind)
        text = "" if worst is None else _sentence(worst, kind)
        checked = not any(one.kind == kind and one.complete for one in audit.not_checked)
        kinds.append((kind, checked, kind in audit.fail_on, audit.count(kind), text))
    title = f"Audit of {Path(audit.dataset).name} for {audit.robot.name}"
    body = environment.get_template("audit.html").render(
        title=title,
        verdict=verdict(audit),
        clean=not audit.failed,
        audit=audit,
        kinds=kinds,
        worst=[(one, Curves.of(table), _texts(one)) for one, table in audit.worst],
        files=(EPISODES, FRAMES, NUMBERS, KEPT),
    )
    style = files(__package__).joinpath("assets", "audit.css").read_text(encoding="utf-8")
    return document(title, body, "", style)


def _texts(result: EpisodeResult) -> list[str]:
    return [_sentence(result, kind, with_name=False) for kind in result.failed]


def _sentence(result: EpisodeResult, kind: str, with_name: bool = True) -> str:
    """Describe the finding of one kind in an episode."""
    finding = result.findings[kind]
    where = f" in {result.name}" if with_name else ""
    if kind == COLLISION:
        return f"{finding.joint} collide at {finding.time:.2f} s, {finding.frames} frames{where}"
    return (
        f"{finding.joint} {100.0 * finding.share:.4g} % of its {kind} limit at {finding.time:.2f} s, "
        f"{finding.frames} frames beyond it{where}"
    )


def _finding(result: EpisodeResult, finding: Finding) -> Mapping[str, object]:
    values = {name: _or_none(value) for name, value in vars(finding).items()}
    return {"episode": result.episode, **values}


def _or_none(value: object) -> object:
    """Return a value, None for nan."""
    if isinstance(value, float) and np.isnan(value):
        return None
    return value


def _write_json(path: Path, content: object) -> None:
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")
