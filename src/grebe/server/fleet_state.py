"""The state of a fleet: that of each boat, and one for the whole survey."""

from __future__ import annotations

from typing import Any

# The entries of a boat's state that come from the live boat, not from the file.
LIVE = ("estimate", "thrusts", "horizon", "current", "wind", "status")
# If boats are in different states, the survey's state is the first of these.
STATES = ("running", "returning", "paused", "interrupted", "stopped", "complete")


def part_of(state: dict[str, Any], boat: int | None) -> dict[str, Any]:
    """Return the state of a fleet's boat by its number; the whole state if `boat` is None."""
    if boat is None:
        return state
    return next(one for one in state["boats"] if one["boat"] == boat)


def carried_on(old: dict[str, Any], new: dict[str, Any]) -> None:
    """Copy the live entries of each boat from the old state into one just read from the file."""
    was = {one["boat"]: one for one in old.get("boats", ())}
    for one in new["boats"]:
        if one["boat"] in was:
            one |= {name: was[one["boat"]][name] for name in LIVE}


def together(boats: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the status of a fleet from those of the boats heard so far. Times are the largest of
    any boat: to the end of the slowest, and since the oldest message.
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
