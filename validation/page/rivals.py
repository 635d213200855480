"""The rivals' rows: mixed-integer programs by their number of contacts, and other searches on the same worlds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from validation.jobs import Record
from validation.page.plans import Section
from validation.page.spread import rate, spread
from validation.rivals.trial import OURS, SEARCHES
from validation.tables import markdown_table, values

PAPER = {12: "85.93 ± 56.41", 18: "33.93 ± 18.54", 24: "46.40 ± 20.30"}
PAPERS_OURS = "0.098 ± 0.037"


def mixed_section(records: Sequence[Record], ours: Sequence[Record]) -> Section:
    """The paper's table of the simplified mixed-integer baseline, and what becomes of its plans."""
    lines = [_line_of_ours(ours)]
    names = dict.fromkeys(record["rival"] for record in records)
    lines += [_mixed_line(name, [record for record in records if record["rival"] == name]) for name in names]
    header = (
        "planner",
        "steps",
        "plan found",
        "first plan [s]",
        "the same, processor time [s]",
        "the paper [s]",
        "5 % gap proved",
        "until 5 % [s]",
    )
    header += (
        "limit [s]",
        "variables",
        "whole numbers",
        "rows",
        "optimiser accepts",
        "simulation accepts",
        "true cost",
    )
    content = [dict(zip(header, line, strict=True)) for line in lines]
    text = f"{MIXED}\n\n{markdown_table(header, lines)}"
    return Section("Mixed-integer baseline, simplified dynamics", text, _mixed_worse(records, ours), content)


MIXED = (
    "Point contacts in convex regions that hold a whole sole, heading fixed, friction pyramid inside the cone, momenta "
    "by McCormick's envelopes, absolute values in place of squares, 2 time steps a phase. One thread; the paper: "
    "Gurobi 8.0 with 8 threads. The paper's model is quadratic; ours is linear, which is easier, and so are solvers "
    "of today: both make the rival faster than the paper tells. Its number of steps has to be given; ours finds it. "
    "The time is that of the first plan, the true cost that of the last one within the limit; both lines end at an "
    "optimised motion, which only ours counts into its time."
)


def _line_of_ours(ours: Sequence[Record]) -> tuple[str, ...]:
    """Our planner's line, until the first sequence that the optimiser accepts."""
    found = [record for record in ours if record["found"]]
    simulated = [record for record in found if "executed" in record]
    held = rate(sum(record["executed"] for record in simulated), len(simulated)) if simulated else "-"
    seconds, processor = (spread(values(found, name)) for name in ("seconds", "processor_seconds"))
    costs = spread(values(found, "true_cost"), ".0f")
    steps = spread(values(found, "transitions"), ".0f")
    accepted = rate(sum(record["feasible"] for record in found), len(found))
    empty = ("-",) * 6
    return ("ours", steps, rate(len(found), len(ours)), seconds, processor, PAPERS_OURS, *empty, accepted, held, costs)


def _mixed_line(name: str, records: Sequence[Record]) -> tuple[str, ...]:
    found = [record for record in records if record["found"]]
    proved = [seconds for record in records for seconds in values([record], "solution", "gap_seconds")]
    simulated = [record for record in found if "executed" in record]
    count = int(name.rsplit(" ", 1)[1])
    paper = PAPER.get(count, "-") if "full" not in name else "none in 7 h"
    size = records[0]
    held = rate(sum(record["executed"] for record in simulated), len(simulated)) if simulated else "-"
    return (
        name,
        str(count),
        rate(len(found), len(records)),
        spread(values(found, "solution", "first_seconds")),
        spread(values(found, "processor_seconds")),
        paper,
        rate(len(proved), len(records)),
        spread(proved),
        f"{size['limit']:g}" if "limit" in size else "-",
        *(str(size.get(key, "-")) for key in ("variables", "integers", "rows")),
        rate(sum(record["feasible"] for record in found), len(found)),
        held,
        spread(values(found, "true_cost"), ".0f"),
    )


def _mixed_worse(records: Sequence[Record], ours: Sequence[Record]) -> list[str]:
    """A line where a program's plans are cheaper or sooner than ours."""
    return _beaten(ours, {name: [r for r in records if r["rival"] == name] for name in _names(records)})


def search_section(records: Sequence[Record]) -> Section:
    """Other searches on the same worlds, with the same moves and checks."""
    header = (
        "world",
        "planner",
        "plan found",
        "until it [s]",
        "the same, processor time [s]",
        "expansions",
        "all transitions pass the screens",
    )
    header += ("optimiser accepts", "simulation accepts", "transitions", "true cost", "why not")
    lines, worse = [], []
    for kind in dict.fromkeys(record["kind"] for record in records):
        same = [record for record in records if record["kind"] == kind]
        groups = {name: [record for record in same if record["rival"] == name] for name in SEARCHES}
        lines += [_search_line(kind, name, group) for name, group in groups.items() if group]
        rivals = {name: group for name, group in groups.items() if name != OURS}
        worse += [f"{line} ({kind.replace('_', ' ')})" for line in _beaten(groups[OURS], rivals)]
    content = [dict(zip(header, line, strict=True)) for line in lines]
    return Section("Other searches", f"{SEARCH}\n\n{markdown_table(header, lines)}", worse, content)


SEARCH = (
    "A* and RRT search the planner's own graph: the same moves, judges, costs and optimiser, the same limits on time "
    "and expansions; the difference to the first line is ANA*'s share. A* with h times 3 is not optimal. SL1M chooses "
    "surfaces by a linear program and knows neither dynamics nor obstacles; it tries 6, 7, ... steps. All end with the "
    "first plan that the optimiser accepts, but for SL1M, which does not ask it."
)


def _search_line(kind: str, name: str, group: Sequence[Record]) -> tuple[str, ...]:
    found = [record for record in group if record["found"]]
    simulated = [record for record in found if "executed" in record]
    whole = sum(record["screened"] == record["transitions"] for record in found)
    held = rate(sum(record["executed"] for record in simulated), len(simulated)) if simulated else "-"
    reasons = dict.fromkeys(record["reason"] for record in group if not record["found"])
    return (
        kind,
        name,
        rate(len(found), len(group)),
        spread(values(found, "seconds")),
        spread(values(found, "processor_seconds")),
        spread(values(group, "expansions"), ".0f"),
        rate(whole, len(found)),
        rate(sum(record["feasible"] for record in found), len(found)),
        held,
        spread(values(found, "transitions"), ".0f"),
        spread(values(found, "true_cost"), ".0f"),
        "; ".join(reasons),
    )


def _names(records: Sequence[Record]) -> list[str]:
    return list(dict.fromkeys(record["rival"] for record in records))


def _beaten(ours: Sequence[Record], rivals: dict[str, list[Record]]) -> list[str]:
    """A line for every rival that is sooner or cheaper than our first plan, median of the worlds with both."""
    lines = []
    mine = {record["seed"]: record for record in ours if record["found"] and record["feasible"]}
    for name, group in rivals.items():
        pairs = [(mine[r["seed"]], r) for r in group if r["found"] and r["feasible"] and r["seed"] in mine]
        for key, words in (
            ("processor_seconds", "processor time to the first plan"),
            ("true_cost", "true cost of the first plan"),
        ):
            if not pairs:
                continue
            ratio = float(np.median([own[key] / other[key] for own, other in pairs]))
            if ratio > 1.0:
                lines.append(f"- {words}: ours is {ratio:.2f} times that of {name}, median of {len(pairs)} worlds")
    return lines
