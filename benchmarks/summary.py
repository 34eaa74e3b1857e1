"""The short programme: all goals for Grebe's speed, measured in one run, in one table.

Its figures come from the functions that print the other benchmarks' tables. Timed rows come first,
before two processes at a time search for optima.
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np

from benchmarks import agreement, commands, missions, routes, steps, thrift
from benchmarks.common import median_p95_max
from benchmarks.programme import Row, run
from grebe.control.rules.lookahead import Lookahead

# Missions in the time of the baseline's steps, as measured in one run before plans passed their
# costates on, and before the search for a fault of the boat stopped early where there is none.
BEFORE = {commands.CALM: 8.0, commands.MOVING: 0.95}
# Its C code beside the same baseline on another computer, before the first version, for the same
# 100 cells with a slack at each stage (docs/benchmarks.md); no package index has it.
ACADOS = "23 / 21 / 3.9 x; with three real-time iterations 30 / 31 / 31 x"


def summary() -> None:
    """Measure every row."""
    run("What is wanted, and what is measured", ROWS)


def step(name: str) -> str:
    """A controller's steps: the baseline's time over theirs, and theirs."""
    ratios = " / ".join(f"{ratio:.1f}" for ratio in steps.ratios(name))
    ms = " / ".join(f"{one:.2f}" for one in median_p95_max(steps.flight(name).step_ms))
    return f"{ratios} x ({ms} ms)"


def pace(weather: str) -> str:
    """Missions a second, and over the old rate; the baseline makes computers comparable."""
    a_second = commands.pace(weather).a_second
    of_baseline = a_second * commands.baseline_s()
    return f"{of_baseline / BEFORE[weather]:.1f} x ({a_second:.2f} a second)"


def command_s(name: str) -> str:
    """CPU seconds of a whole `grebe plan`."""
    return f"{commands.planned(name).cpu_s:.1f} s"


def wide_length() -> str:
    """Length of the large lake's order over the bound."""
    return f"{1 + commands.planned(commands.WIDE).gap:.3f}"


def minutes_used() -> str:
    """CPU seconds of `grebe plan --minutes`, and the share of the time that the plan uses."""
    planned = commands.planned(commands.MINUTES)
    return f"{planned.cpu_s:.1f} s, {planned.used:.2f}"


def first_run() -> str:
    """CPU seconds of the first `grebe run` after installation."""
    return str(commands.of_a_new_copy())


@cache
def thousand() -> routes.Waters:
    """The lake on which orders are compared."""
    return routes.Waters(1_000)


def order(method: str) -> str:
    """Length of a method's order over the bound, and the time to find it."""
    found = routes.ordered(thousand(), method)
    return f"{found.over:.4f} in {found.took_s:.1f} s"


def over_optimum(scene: str) -> str:
    """A mission's time over the optimum's."""
    flight, best = missions.flight(scene), missions.best(scene)
    if not flight.complete:
        return f"{flight.arrivals} sets reached"
    caveat = "" if best.counts else ", an optimum that did not converge"
    return f"{flight.duration_s / best.duration_s:.3f} of {best.duration_s:.1f} s{caveat}"


def over_optimum_in_currents(scene: str) -> str:
    """Missions in unknown currents over the optima that know them: mean and worst of all."""
    over: list[float] = []
    caveats: list[str] = []
    for towards, moving in missions.towards_each(missions.task(scene)).items():
        best = missions.best_in_currents(scene)[towards]
        if best is None:
            caveats.append(f"no optimum found towards {towards}")
            continue
        if not best.counts:
            caveats.append(f"the optimum towards {towards} not converged")
        flights = missions.noisy(moving, Lookahead())
        complete = [flight for flight in flights if flight.complete]
        if lost := len(flights) - len(complete):
            caveats.append(f"{lost} missions towards {towards} not complete")
        over += [flight.duration_s / best.duration_s for flight in complete]
    if not over:
        return "; ".join(caveats)
    return "; ".join(
        [f"mean {np.mean(over):.3f}, worst {max(over):.3f} of {len(over)} missions", *caveats]
    )


def agreed(sample: int) -> str:
    """Share of first inputs that are those of the oracle's best local minimum."""
    rule, seed = agreement.SAMPLES[sample]
    return f"{100 * agreement.agreed(rule, seed).best_found:.1f} % of {agreement.INSTANCES}"


def saved(weather: str) -> str:
    """What a price of thrust saves within a tenth more time, boat by boat."""
    shares = {boat: thrift.most_saved(boat, weather) for boat in thrift.SURVEYS}
    return ", ".join(f"{boat} {100 * share:.0f} %" for boat, share in shares.items())


OVER_IPOPT = "step, median / p95 / max over Opti + IPOPT rebuilt at each"
KNOWS = f"over the optimum that knows the {missions.CURRENT_MPS} m/s of current, by noisy estimates"
ROWS = (
    Row(
        what=f"`lookahead`: {OVER_IPOPT}", measure=partial(step, steps.LOOKAHEAD),
        at_least="40 / 25 / 25 x", aim="80 / 50 / 40 x", minutes=0.5,
    ),
    Row(
        what="the same of `dual`, which solves the baseline's problem",
        measure=partial(step, steps.DUAL),
    ),
    Row(what="the same of `dual` by FATROP", measure=partial(step, steps.FATROP), minutes=0.2),
    Row(what="the same of do-mpc", measure=partial(step, steps.DO_MPC), minutes=0.2),
    Row(what="the same of acados, stated and not measured here", measure=lambda: ACADOS),
    Row(
        what="missions a second and core over what they were, calm",
        measure=partial(pace, commands.CALM), at_least="3 x", aim="6 x", minutes=0.3,
    ),
    Row(
        what="the same in 0.28 m/s of unknown current with noise",
        measure=partial(pace, commands.MOVING), at_least="3 x", aim="6 x", minutes=0.2,
    ),
    Row(
        what="`grebe plan`, 1,000 cells", measure=partial(command_s, commands.K1000),
        at_least="1.3 s", aim="0.8 s", minutes=0.2,
    ),
    Row(
        what="`grebe plan`, 100,000 cells", measure=partial(command_s, commands.K100000),
        at_least="15 s", aim="8 s", minutes=0.6,
    ),
    Row(
        what="`grebe plan`, 1,564 ha with 8 islands, cells of 50 m",
        measure=partial(command_s, commands.WIDE), at_least="8 s", aim="4 s", minutes=0.2,
    ),
    Row(what="its length over the bound", measure=wide_length, at_least="1.02", aim="1.01"),
    Row(
        what="`grebe plan --minutes 30`, and the share of them that it uses", measure=minutes_used,
        at_least="4 s, 0.97", aim="2 s, 0.99", minutes=0.2,
    ),
    Row(
        what="first `grebe run` after installation, with its compilation", measure=first_run,
        at_least="10 s", aim="3 s", minutes=0.7,
    ),
    Row(
        what="an order of 1,053 cells, length over the bound", measure=partial(order, routes.GREBE),
        minutes=0.5,
    ),
    Row(what="the same by OR-tools", measure=partial(order, routes.OR_TOOLS), minutes=0.5),
    Row(
        what="energy saved for a tenth more time, calm", measure=partial(saved, thrift.CALM),
        at_least="20 %", aim="35 %", minutes=0.7,
    ),
    Row(
        what="the same in 0.22 m/s of unknown current with noise",
        measure=partial(saved, thrift.MOVING), at_least="20 %", aim="35 %", minutes=0.7,
    ),
    Row(
        what="first input within 1 % of the oracle's best local minimum, `lookahead`",
        measure=partial(agreed, 2), at_least="99 %", aim="99.9 %", minutes=2,
    ),
    Row(
        what="the same, `dual`, the sample it was not tuned on", measure=partial(agreed, 1),
        at_least="99 %", aim="99.9 %", minutes=1.5,
    ),
    Row(
        what="mission over the optimum, 100 cells",
        measure=partial(over_optimum, missions.CELLS_100),
        at_least="1.015", aim="1.01", minutes=0.8,
    ),
    Row(
        what="the same, Fig. 7", measure=partial(over_optimum, missions.FIGURE),
        at_least="1.02", aim="1.01", minutes=2,
    ),
    Row(
        what="the same, a concave lake with islands", measure=partial(over_optimum, missions.LAKE),
        at_least="1.03", aim="1.01", minutes=3,
    ),
    Row(
        what=f"100 cells {KNOWS}", measure=partial(over_optimum_in_currents, missions.CELLS_100),
        at_least="1.06", aim="1.03", minutes=4,
    ),
    Row(
        what=f"the lake {KNOWS}", measure=partial(over_optimum_in_currents, missions.LAKE),
        at_least="1.06", aim="1.03", minutes=9,
    ),
)  # fmt: skip
