"""What a name or a file is, in facts: arms, recordings, ellipsoids, adapters."""

from pathlib import Path
from typing import Any


def describe(what: str, frame: str | None = None) -> dict[str, Any]:
    """Find out what a name or file is, by its suffix, and tell the facts about it.

    Parameters
    ----------
    what : str
        Name of an arm, or a file: recording, ellipsoids, adapter, URDF or MJCF.
    frame : str, optional
        Frame at the tip of an arm.

    Returns
    -------
    dict
        Ready for JSON.

    Raises
    ------
    ManiportError
        When there is no such thing or it cannot be read.
    """
    suffix = Path(what).suffix.lower()
    if suffix == ".npz":
        return _npz_facts(what)
    if suffix in (".bvh", ".c3d"):
        from maniport.demonstrations import read_recording

        motion = read_recording(what)
        missing = {name: round(float(m), 3) for name, m in zip(motion.names, motion.missing, strict=True) if m}
        return {
            "recording": what,
            "frames": len(motion),
            "seconds": round(motion.duration, 3),
            "rate_hz": round(motion.rate, 3),
            "up": motion.up,
            "points": list(motion.names),
            "missing": missing,
            "notes": list(motion.notes),
        }
    from maniport.bodies import load_arm

    body = load_arm(what, frame=frame)
    limits = zip(body.joint_names, body.lower.tolist(), body.upper.tolist(), strict=True)
    return {
        "arm": body.name,
        "frame": body.frame,
        "joints": {name: [round(low, 4), round(high, 4)] for name, low, high in limits},
        "frames": list(body.frames),
    }


def _npz_facts(path: str) -> dict[str, Any]:
    from maniport.files import load_arrays, load_ellipsoids
    from maniport.transfer import load_adapter

    if "adapter" in load_arrays(path, "file"):
        return {"adapter": path, **adapter_facts(load_adapter(path))}
    points, time = load_ellipsoids(path)
    facts: dict[str, Any] = {"ellipsoids": path, "count": len(points), "size": f"{points.shape[1]}×{points.shape[2]}"}
    return facts if time is None else {**facts, "seconds": round(float(time[-1] - time[0]), 3)}


def adapter_facts(adapter: Any) -> dict[str, Any]:
    """Tell what a fitted adapter is, how its fit went, and what the clouds say about its rotation."""
    found = getattr(adapter, "identifiability_", None)
    knowledge = {} if found is None else {"identifiability": found.in_words(), "spread_deg": round(found.spread_deg, 3)}
    return {
        "method": type(adapter).__name__,
        "damping": adapter.damping,
        "floor": adapter.floor,
        "dispersion_ratio": float(adapter.dispersion_ratio_),
        "rotation": adapter.rotation_.round(6).tolist(),
        "iterations": int(adapter.n_iter_),
        "converged": bool(adapter.converged_),
        "stop_reason": adapter.stop_reason_,
        "cost": float(adapter.cost_),
        **knowledge,
    }


def as_lines(facts: dict[str, Any]) -> str:
    """Write facts for a reader, one line each."""
    return "\n".join(f"{key}: {_readable(value)}" for key, value in facts.items())


def _readable(value: Any) -> str:
    if isinstance(value, dict):
        return "".join(f"\n  {key}: {_readable(one)}" for key, one in value.items()) or "none"
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)
