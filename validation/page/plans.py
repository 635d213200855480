"""The paper's table of fields and corridors, and the times of its text, with ours beside every figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from validation.jobs import Record
from validation.page.spread import HEADER, Compared, rate, spread, worse_first
from validation.planning import BASELINE, PAPER, summarise
from validation.tables import markdown_table, number, values


class Column(NamedTuple):
    """A column from (3) on: its name, where a record has it, whether more is better, and why it differs."""

    name: str
    path: tuple[str, ...]
    better: int
    why: str


_OURS = "Our robot weighs and measures other than theirs"
COLUMNS = (
    Column(
        "(3) sequences optimised for each feasible one",
        ("tested",),
        -1,
        "The search asks the optimiser before it ends, so what it returns is feasible.",
    ),
    Column(
        "(4) dynamics objective",
        ("paper_objective",),
        -1,
        f"{_OURS}, joint and cone limits are exact, and plans are chosen by cost with a price per second.",
    ),
    Column(
        "(5) linear momentum [kg m/s]",
        ("figures", "linear_momentum"),
        -1,
        f"{_OURS}; fewer steps of 2 s go the same way faster.",
    ),
    Column(
        "(6) linear momentum rate [N]",
        ("figures", "linear_momentum_rate"),
        -1,
        "Fewer and longer steps accelerate the CoM more.",
    ),
    Column(
        "(7) angular momentum [kg m²/s]",
        ("figures", "angular_momentum"),
        -1,
        "Ours weighs it twenty times as much, so that a body can follow.",
    ),
    Column("(8) angular momentum rate [N m]", ("figures", "angular_momentum_rate"), -1, "As (7)."),
    Column(
        "(9) RMS contact force [weights]", ("figures", "force"), -1, "It falls with palms, and with double support."
    ),
    Column(
        "(10) contact torque [N m]",
        ("figures", "torque"),
        -1,
        "Angular momentum weighs more in ours, and torques about the normal keep it low.",
    ),
    Column(
        "(11) lateral force [weights]",
        ("figures", "lateral_force"),
        -1,
        "Plans stay inside two thirds of the exact cone; on tilted tiles gravity alone sets most of it.",
    ),
    Column(
        "(12) CoP to the edge [m]",
        ("figures", "cop_distance"),
        1,
        "Ours wants a margin of 5.5 cm to the edge of a sole, the paper's plans have none.",
    ),
)
PLANNED = "Our moves shift and draw footholds beside the table's, so that hardly any field has no way."
PLANNERS = (BASELINE, "learned")
_PAPERS_LINES: dict[str, int] = dict(zip(PLANNERS, (0, 1), strict=True))


def compared(kind: str, planner: str, records: Sequence[Record]) -> list[Compared]:
    """The twelve columns of a kind of world and a planner."""
    published = PAPER[kind][_PAPERS_LINES[planner]].split()
    row = summarise(kind, planner, records)
    feasible = [record for record in records if record["feasible"]]
    found = [
        _rate("(1) planned", published[0], row["found"], row["trials"], PLANNED),
        _rate("(2) dynamically feasible", published[1], row["feasible"], row["found"], "Exact cones on both sides."),
    ]
    for column, text in zip(COLUMNS, published[2:], strict=True):
        numbers = values(feasible, *column.path)
        middle = float(np.mean(numbers)) if numbers else None
        ours = "-" if middle is None else f"{middle:.4g}, {spread(numbers)}"
        found.append(Compared(column.name, text, ours, middle, float(text), column.better, column.why))
    return found


def _rate(name: str, paper: str, successes: int, trials: int, why: str) -> Compared:
    """A rate beside the paper's."""
    good, of = map(int, paper.split("/"))
    value = successes / trials if trials else None
    return Compared(name, paper, rate(successes, trials), value, good / of, 1, why)


class Section(NamedTuple):
    """A part of the page.

    Attributes:
        title: Its heading.
        text: In Markdown.
        worse: A line for each figure in which ours is worse.
        content: For the JSON file.
    """

    title: str
    text: str
    worse: list[str]
    content: Any


def plan_section(groups: dict[tuple[str, str], list[Record]]) -> Section:
    """The tables of fields and corridors, for records by kind of world and planner."""
    parts, worse, content = [NOTE], [], {}
    for (kind, planner), records in groups.items():
        if kind not in PAPER:
            continue
        rows = compared(kind, planner, records)
        where = f"{kind.replace('_', ' ')}, {planner}"
        parts += [f"### {where[0].upper()}{where[1:]}", markdown_table(HEADER, (row.cells for row in rows))]
        worse += worse_first(where, rows)
        content[f"{kind} {planner}"] = [row.record for row in rows]
    return Section("Fields and corridors: the twelve columns", "\n\n".join(parts), worse, content)


NOTE = (
    "Rates with Wilson's interval at 95 %. From (3) on: mean over the feasible trials as in the paper, then median "
    "with quartiles. (4) is J with the paper's weights. Steps take 1 s + 1 s and friction is 0.5, as in the paper; "
    "tiles and walls are drawn as it describes them."
)


def time_section(groups: dict[tuple[str, str], list[Record]]) -> Section:
    """The times that the paper's text tells, for records by kind of world and planner."""
    rows = [
        _time(groups, "rubble_field", "first feasible sequence [ms]", "98 ± 37", _first, 98.0, FIELD),
        _time(groups, "rubble_field", "the same, processor time [ms]", "98 ± 37", _first_worked, 98.0, FIELD),
        _time(groups, "wide_gap", "first feasible sequence [ms]", "143", _first, 143.0, GAP),
        _time(groups, "wide_gap", "the same, processor time [ms]", "143", _first_worked, 143.0, GAP),
        _time(groups, "wide_gap", "optimisation of its sequence [ms]", "1230", _optimiser, 1230.0, SOLVER),
        _time(groups, "steep_slope_3m", "first feasible sequence [ms]", "702", _first, 702.0, SLOPE),
        _time(groups, "steep_slope_3m", "the same, processor time [ms]", "702", _first_worked, 702.0, SLOPE),
        _time(groups, "steep_slope_3m", "sequence that is shown [ms]", "10617", _whole, 10617.0, SLOPE),
        _time(groups, "steep_slope_3m", "optimisation of its sequence [ms]", "6320", _optimiser, 6320.0, SOLVER),
        _time(groups, "steep_slope_3m", "transitions", "31", _transitions, 31.0, STRIDES, 0),
    ]
    table = markdown_table(HEADER, (row.cells for row in rows))
    return Section(
        "Times of the text", f"{CLOCKS}\n\n{table}", worse_first("times", rows), [row.record for row in rows]
    )


CLOCKS = "Medians with quartiles; processor time leaves out what other programs took. The paper's: i7-6700 at 3.4 GHz."
FIELD = "Ours includes the optimisation of the sequence, theirs is the search alone."
GAP = "As the line above; longer steps are drawn from the surfaces in place of a table for this test."
SOLVER = "A stage-structured interior-point solver in place of Ipopt."
SLOPE = "With the exact cone nothing rests on the slope, so the robot runs down it, which has to be searched."
STRIDES = "No walk of 2 s steps exists with the exact cone; see below."


def _time(
    groups: dict[tuple[str, str], list[Record]],
    kind: str,
    name: str,
    paper: str,
    get: Callable[[Record], float | None],
    published: float,
    why: str,
    better: int = -1,
) -> Compared:
    """A row: a figure of the learned planner in a kind of world."""
    found = [get(record) for record in groups.get((kind, "learned"), []) if record["feasible"]]
    known = [value for value in found if value is not None]
    middle = float(np.median(known)) if known else None
    title = f"{kind.replace('_', ' ')}: {name}"
    return Compared(title, paper, spread(known), middle, published, better, why)


def _first(record: Record) -> float | None:
    seconds = record.get("first_seconds")
    return None if seconds is None else 1e3 * seconds


def _first_worked(record: Record) -> float | None:
    seconds = record.get("first_processor_seconds")
    return None if seconds is None else 1e3 * seconds


def _whole(record: Record) -> float | None:
    return 1e3 * (record["heuristic_seconds"] + record["search_seconds"])


def _optimiser(record: Record) -> float | None:
    return 1e3 * record["optimiser_seconds"]


def _transitions(record: Record) -> float | None:
    return float(record["transitions"])


def ratio_text(groups: dict[tuple[str, str], list[Record]]) -> str:
    """Sentences on learned against quasi-static plans, as the paper tells them."""
    lines = []
    for kind in PAPER:
        both = [values([r for r in groups.get((kind, p), []) if r["feasible"]], "paper_objective") for p in PLANNERS]
        if all(both):
            ours = float(np.mean(both[1]) / np.mean(both[0]))
            base, learned = (float(PAPER[kind][line].split()[3]) for line in (0, 1))
            words = "less" if ours < 1 else "more"
            lines.append(
                f"- {kind.replace('_', ' ')}: the learned plans' mean objective is {number(ours, '.2f')} times the "
                f"quasi-static ones', {words} than it; in the paper {learned / base:.2f} times."
            )
    return "\n".join(lines)
