"""Where plans hold and where they do not, over the parameters of families of worlds: `python -m validation.map`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from toolkit import cli
from toolkit.drafts import write_whole
from toolkit.report.console import make_console
from toolkit.robot.loader import load_robot
from validation import goals, map_families, map_scale, map_worlds, options
from validation.goals import Goal
from validation.growing import add_growing_options, growth_note, stamped, state_of, take_over
from validation.jobs import ERROR, Job, run_jobs
from validation.machine import source_fingerprint
from validation.map_families import FAMILIES, QUICK, SEEDS, Cell, cells_of
from validation.map_picture import draw_map
from validation.map_scale import mjcf_of
from validation.map_table import hole_table, summarise, table
from validation.map_trial import CANDIDATES, IMPOSSIBLE, completed, map_trial
from validation.tables import failure_section, show_results, write_results
from validation.trial_file import TrialFolder

DESCRIPTION = f"""\
Sweep families of worlds over their parameters (gaps, slopes, stairs, stones, beams, doors, turns, rubble, meshes, ...),
plan and execute each, and draw a map: one picture a family, and one table with rates and holes.

Every world is moved by up to 100 m and turned by any angle, and its lengths are to the scale of the robot's legs. The
planner chooses the timing of every transition; --timing passes one. A cell whose goal the planner proves to be out of
reach is impossible and counts in no rate. A hole is a cell that fails although a harder one of its family passes in all
seeds. A sweep that was stopped goes on where it was: --out has a small file for each cell.

  python -m validation.map --quick                {QUICK} worlds of all families
  python -m validation.map --families gap beam    two families, every value, {SEEDS} seeds
  python -m validation.map --add-results          everything, into validation/results
  python -m validation.map --add-results --grow --minutes 60
                                                  an hour more of it: the results that are there grow
  python -m validation.map --quick --robot g1     another robot, in worlds of its size
"""


def worlds_fingerprint(scale: float) -> str:
    """Twelve hex digits of the source that makes the worlds, and their scale where there is one."""
    makers = [map_families, map_worlds, *([] if scale == 1.0 else [map_scale])]
    digits = source_fingerprint(Path(module.__file__ or "") for module in makers)
    return digits if scale == 1.0 else f"{digits} scaled by {scale:g}"


def goals_of(rows: list[dict[str, Any]]) -> list[Goal]:
    """What is asked of the whole map."""
    holes, errors = sum(len(row["holes"]) for row in rows), sum(row["errors"] for row in rows)
    return [
        goals.at_most("holes: failures although a harder world passes in all seeds", float(holes), 0.0),
        goals.at_most("cells that ended in an error of the program", float(errors), 0.0),
    ]


def keep_worlds(folder: Path, cells: dict[str, Cell], scale: float, records: list[dict[str, Any]]) -> None:
    """Write the worlds of cells that did not pass, to run them again.

    Raises:
        InputError: They cannot be written.
    """
    for record in records:
        if not record["passed"] and record["stage"] != ERROR:
            write_whole(folder / f"{record['name']}.xml", mjcf_of(cells[record["name"]], scale).encode())


def scale_note(robot: str, scale: float) -> str:
    """What lengths mean where worlds are to scale."""
    if scale == 1.0:
        return ""
    return f"Lengths are for legs of 0.8 m, thigh and shin; the worlds of {robot} are {scale:g} times as large."


def main(argv: list[str] | None = None) -> int:
    """Run the experiment; returns the exit code."""
    parser = options.plain_parser("map", DESCRIPTION)
    parser.set_defaults(time_limit=60.0, timing="auto")
    parser.add_argument("--results", type=Path, metavar="DIR", help="where map.json, map.md and the pictures go")
    parser.add_argument(
        "--families",
        nargs="+",
        choices=tuple(FAMILIES),
        default=list(FAMILIES),
        metavar="FAMILY",
        help=f"default: all of {' '.join(FAMILIES)}",
    )
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} worlds in all, one seed each")
    parser.add_argument(
        "--seeds",
        type=cli.positive(int),
        metavar="N",
        help=f"seeds of each value (default: {SEEDS}, or 1 with --quick)",
    )
    parser.add_argument(
        "--add-results", action="store_true", help="that is validation/results; the default is OUT/results"
    )
    cli.add_execution_options(parser)
    add_growing_options(parser)
    parser.epilog = options.GOAL_CODES
    args = parser.parse_args(argv)
    console = make_console()
    settings = options.trial_settings(args)
    robot = load_robot(settings.robot, settings.robots)
    scale = robot.scale.length
    title = options.results_name("map", robot, args)
    families = list(dict.fromkeys(args.families))
    cells = {cell.name: cell for cell in cells_of(families, quick=args.quick, seeds=args.seeds, first=args.seed_offset)}
    results = args.results or (options.RESULTS if args.add_results else args.out / "results")
    worlds = worlds_fingerprint(scale)
    described = {
        **settings.described(),
        "candidates": CANDIDATES,
        "worlds": worlds,
        "quick": args.quick,
        "seeds": args.seeds,
        "seed_offset": args.seed_offset,
    }
    store = TrialFolder(args.out / "cells", settings.deciding() | {"worlds": worlds, "candidates": CANDIDATES})
    if args.grow:
        take_over(store, results / f"{title}.json", described, cells)
    jobs = [Job(name, map_trial, (settings, cell)) for name, cell in cells.items()]
    found = run_jobs(jobs, store, options.pool_of(args), console, "cells", args.minutes)
    records = stamped(completed(found, cells), state_of(settings))
    keep_worlds(args.out / "worlds", cells, scale, records)
    by_family = {name: [record for record in records if record["family"] == name] for name in families}
    for name, own in by_family.items():
        draw_map(results / title / f"{name}.png", FAMILIES[name], own)
    rows = [summarise(name, own) for name, own in by_family.items()]
    growth = growth_note(records, len(cells), state_of(settings))
    path = write_results(
        results,
        title,
        title="Where plans hold",
        sections=[
            ("Table", "\n\n".join(filter(None, (table(rows), growth, NOTE, scale_note(robot.name, scale))))),
            ("Holes", hole_table(rows)),
            ("Pictures", "\n\n".join(f"![{name}]({title}/{name}.png)" for name in families)),
            ("Failures", failure_section([record for record in records if record["outcome"] != IMPOSSIBLE])),
            ("Proven impossible", failure_section([record for record in records if record["outcome"] == IMPOSSIBLE])),
        ],
        content={"table": rows, "trials": records},
        goals=goals_of(rows),
        settings=described,
    )
    show_results(console, path)
    return options.goal_code(goals_of(rows))


NOTE = (
    "Every world is moved by up to 100 m and turned by any angle. A rate leaves out what the planner proves to be "
    "impossible; its interval is Wilson's. A hole is a cell that fails, or is called impossible, although a harder "
    "one of its family passes in all seeds."
)

if __name__ == "__main__":
    cli.run(main)
