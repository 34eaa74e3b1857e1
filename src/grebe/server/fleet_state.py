"""What the boats of a fleet tell, each for itself, and what their survey is told of as one."""

from __future__ import annotations

from typing import Any

# What is known of one boat as it is now, and not only in the file.
LIVE = ("estimate", "thrusts", "horizon", "current", "wind", "status")
# Where boats do different things, the first of these is the survey's state.
STATES = ("running", "returning", "paused", "interrupted", "stopped", "complete")


def part_of(state: dict[str, Any], boat: int | None) -> dict[str, Any]:
    """Return what is known of a boat: a fleet's by its number, or all of it where there is one."""
    if boat is None:
        return state
    return next(one for one in state["boats"] if one["boat"] == boat)


def carried_on(old: dict[str, Any], new: dict[str, Any]) -> None:
    """Keep in a state that was read anew what no file holds of boats that are heard."""
    was = {one["boat"]: one for one in old.get("boats", ())}
    for one in new["boats"]:
        if one["boat"] in was:
            one |= {name: was[one["boat"]][name] for name in LIVE}


def together(boats: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the status of a fleet from those of its boats that have been heard: how long the
    slowest still takes, and the oldest word.
    """
    heard = [one["status"] for one in boats if one["status"].get("state")]
    states = {one["state"] for one in heard}
    doing = sorted({one.get("doing") or one["state"] for one in heard})
    return {
        "state": next((word for word in STATES if word in states), "planned"),
        "doing": ", ".join(doing),
        **{name: _most(heard, name) for name in ("eta_s", "link_age_s", "solve_ms")},
    }


def _most(heard: list[dict[str, Any]], name: str) -> float | None:
    return max((one[name] for one in heard if one.get(name) is not None), default=None)
