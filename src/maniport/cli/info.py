"""The command that describes an arm, a file or a folder of results."""

from pathlib import Path
from typing import Annotated

import typer

from maniport.cli.application import Height, Seed, Side, app, prints
from maniport.cli.recorded import Recorded, takes_recording
from maniport.cli.robots import Chain, takes_chain
from maniport.report.console import Console
from maniport.report.metrics import facts_of, warning
from maniport.report.renderings import PAGE, SUMMARY
from maniport.report.values import Metric, Report, Section
from maniport.util.defaults import AUTO, RECORDINGS


@app.command(
    epilog="Example: maniport info panda;  maniport info walk.bvh;  maniport info walk.c3d --markers roles.json"
)
@takes_chain
@takes_recording
@prints
def info(
    chain: Chain,
    recorded: Recorded,
    console: Console,
    what: Annotated[
        str,
        typer.Argument(help="Name of an arm, or a file: recording, robot, ellipsoids, adapter; a folder of results."),
    ],
    side: Side = AUTO,
    height: Height = None,
    seed: Seed = 0,
) -> None:
    """Describe an arm, a recording, a file of ellipsoids or a folder of results."""
    console.tell(_facts(what, chain, recorded, side, height))


def _facts(what: str, chain: Chain, recorded: Recorded, side: str, height: float | None) -> Report:
    """Describe what a name or a path stands for."""
    if all((Path(what) / name).is_file() for name in (SUMMARY, PAGE)):
        recorded.require_none(f"{what!r} holds results")
        chain.require_none(f"{what!r} holds results")
        return _of_results(Path(what))
    if _is_recording(what):
        chain.require_none(f"{what!r} is a recording")
        from maniport.report.recording import recording_facts

        return recording_facts(recorded.read(what), recorded.roles(), side, command=recorded.command(what))
    recorded.require_none(f"{what!r} is none")
    if Path(what).suffix.lower() != ".npz":
        return _of_robot(what, chain, side, height)
    chain.require_none(f"{what!r} is none")
    return _of_arrays(what)


def _is_recording(what: str) -> bool:
    """Whether it is a recording: of files, all are that are no robots and hold no ellipsoids."""
    from maniport.arms import READERS

    file = Path(what)
    suffix = file.suffix.lower()
    if suffix == ".npz":
        from maniport.util.files import array_names

        return not {"adapter", "manipulability", "path"} & set(array_names(what, "file"))
    if suffix in READERS:
        return False
    if file.is_file() or suffix in RECORDINGS or (file.is_dir() and any(file.glob("*.json"))):
        return True
    from maniport.mocap.readers import SHIPPED

    return what in SHIPPED


def _of_robot(what: str, chain: Chain, side: str, height: float | None) -> Report:
    """Tell of an arm and of the other ends that its robot has; of the ends alone where there are several to choose."""
    from maniport.arms.loaders import robot_limbs
    from maniport.report.robot import robot_facts

    limbs, default = robot_limbs(what)
    to_choose = limbs and default is None and chain.frame is None and chain.joints is None
    return robot_facts(what, limbs, None if to_choose else chain.load(what, side, height))


def _of_arrays(path: str) -> Report:
    from maniport.transfer import load_adapter
    from maniport.util.files import array_names, load_ellipsoids, load_path

    names = array_names(path, "file")
    if "adapter" in names:
        return facts_of(load_adapter(path))
    if "manipulability" in names:
        key, (values, time) = "ellipsoids", load_ellipsoids(path)
        n, d = values.shape[:2]
        facts = [
            Metric("Ellipsoids", f"{n} of {d} × {d}", key="count", value=n),
            Metric("", "", key="dimension", value=d),
        ]
    else:
        key, (values, time) = "path", load_path(path)
        facts = [Metric("Path", f"{len(values)} positions", key="count", value=len(values))]
    if time is not None:
        seconds = round(float(time[-1] - time[0]), 3)
        facts.append(Metric("Duration", f"{seconds:g} s", key="duration", value=seconds, unit="s"))
    return Report(path, "", (Section("", tuple(facts), key=key),))


def _of_results(folder: Path) -> Report:
    """Report the summary of a run, its warnings, and where its page is."""
    import json

    from maniport.errors import FileFormatError
    from maniport.util.input_limits import KEYPOINTS_BYTES, read_whole

    file = folder / SUMMARY
    text = read_whole(file, (), KEYPOINTS_BYTES)
    try:
        summary = json.loads(text)
        title, outcome = summary["title"], summary.get("summary", {})
        lead = " ".join(outcome[key] for key in ("title", "text") if outcome.get(key))
        status = str(summary.get("status") or "")
        quality_warnings = tuple(warning(str(one["key"]), str(one["text"])) for one in summary.get("warnings", []))
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise FileFormatError(f"{file}: is no summary of a run: {error}") from None
    page = str(folder / PAGE)
    facts = Metric("Status", status, key="status", value=status), Metric("Page", page, "For any browser.", "page", page)
    return Report(str(title), lead, (Section("", facts),), data_warnings=quality_warnings)
