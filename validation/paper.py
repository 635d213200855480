"""Everything that the paper reports, beside our own figures, on one page: `python -m validation.paper`."""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import Console

from toolkit import cli
from toolkit.contacts.category import Category
from toolkit.errors import InputError
from toolkit.prediction.networks import load_networks
from toolkit.report.console import make_console
from toolkit.report.files import read_json
from toolkit.robot.loader import load_robot
from validation import goals, options
from validation.cases import Case
from validation.growing import add_growing_options, growth_note, stamped, state_of, take_over
from validation.jobs import ERROR, Job, Record, run_jobs
from validation.machine import ROOT
from validation.options import TrialSettings
from validation.page.drawings import draw_models, draw_networks, draw_sums
from validation.page.friction import friction_section
from validation.page.known import category_section, network_section, transition_row
from validation.page.others import other_section
from validation.page.pictures import PICTURES, picture_trial
from validation.page.plans import PLANNERS, Section, plan_section, ratio_text, time_section
from validation.page.rivals import mixed_section, search_section
from validation.page.spread import HEADER, spread
from validation.plan_trial import plan_trial
from validation.pyramid_trial import PAPERS_TIMING, pyramid_trial
from validation.rivals.solvers import available, version
from validation.rivals.trial import OURS, SEARCHES, Mixed, rival_trial
from validation.tables import failure_section, markdown_table, show_results, values, write_results
from validation.trial_file import TrialFile

DESCRIPTION = """\
Make what the paper reports once more and set it beside the paper's figures: its tables, its times, its pictures, its
mixed-integer baseline, other rivals, and what its friction pyramid does to its plans. With --quick a few worlds and
short limits (15 minutes on 2 cores); without it 50 worlds each and an hour for the largest program. Trials are kept, so
that it goes on where it was stopped.
"""
FIELD, CORRIDOR, GAP, SLOPE = "rubble_field", "rubble_corridor", "wide_gap", "steep_slope_3m"
SLOPES = ("steep_slope_1m", "steep_slope_2m", "steep_slope_3m")
COUNTS = (12, 18, 24)
KNOWN, ABLATION = ("prediction", "centroidal", "calibration", "execution", "budgets"), "ablation"
QUICK_COMMAND, FULL_COMMAND = "python -m validation.paper --quick", "python -m validation.paper"


@dataclass(frozen=True)
class Size:
    """How much is run.

    Attributes:
        trials: Worlds of each kind, for the paper's table.
        rival_trials: Worlds for rivals, and for the cones.
        authored: Seeds of the gap and the slope.
        mixed_seconds: s; limit of a mixed-integer program.
        full_seconds: s; the same with full dynamics.
        search_seconds: s; limit of the other searches.
        simulate: Whether the rivals' plans are carried out.
    """

    trials: int = 50
    rival_trials: int = 10
    authored: int = 5
    mixed_seconds: float = 600.0
    full_seconds: float = 3600.0
    search_seconds: float = 60.0
    simulate: bool = True


QUICK = Size(3, 1, 1, 20.0, 60.0, 10.0, False)


def jobs_of(settings: TrialSettings, size: Size, solvers: Sequence[str], pictures: Path, first: int) -> list[Job]:
    """All trials; names say what they are of."""
    papers = replace(settings, planning=replace(settings.planning, timing=(PAPERS_TIMING,)))
    jobs = []
    for kind in (FIELD, CORRIDOR):
        for case in (Case(kind, first + index) for index in range(size.trials)):
            jobs += [Job(f"plan-{p}-{case.name}", plan_trial, (papers, case, p, False)) for p in PLANNERS]
    for kind in (GAP, SLOPE):
        for case in (Case(kind, first + index) for index in range(size.authored)):
            jobs += [Job(f"plan-{p}-{case.name}", plan_trial, (settings, case, p, False)) for p in PLANNERS]
    fields = [Case(FIELD, first + index) for index in range(size.rival_trials)]
    mixed = [Mixed(solver, count, size.mixed_seconds) for solver in solvers for count in COUNTS]
    mixed += [Mixed(solver, COUNTS[0], size.full_seconds, full=True) for solver in solvers]
    for rival in mixed:
        for case in fields[:1] if rival.full else fields:
            name = f"{rival.name}-{rival.seconds:g}s-{case.name}"
            jobs.append(Job(name, rival_trial, (settings, case, rival, rival.seconds, size.simulate)))
    for case in [*fields, *(Case(CORRIDOR, case.seed) for case in fields)]:
        for rival in SEARCHES:
            name = f"{rival}-{size.search_seconds:g}s-{case.name}"
            jobs.append(Job(name, rival_trial, (settings, case, rival, size.search_seconds, size.simulate)))
    cones = [*(Case(kind, first) for kind in SLOPES), *fields, *(Case(CORRIDOR, case.seed) for case in fields)]
    jobs += [Job(f"cone-{case.name}", pyramid_trial, (settings, case, True)) for case in cones]
    for picture in PICTURES:
        jobs.append(Job(f"picture-{picture.name}", picture_trial, (settings, picture, pictures)))
    return jobs


def groups_of(records: Sequence[Record]) -> dict[tuple[str, str], list[Record]]:
    """Records of plans by kind of world and planner."""
    groups: dict[tuple[str, str], list[Record]] = {}
    for record in records:
        groups.setdefault((record["kind"], record["planner"]), []).append(record)
    return groups


def sections_of(records: dict[str, Record], known: dict[str, dict[str, Any]]) -> list[Section]:
    """The parts of the page that are tables.

    Args:
        records: By name of the trial.
        known: Results of other programs by their name: `KNOWN`, and `ABLATION` where it is committed.
    """

    def of(prefix: str) -> list[Record]:
        whole = [record for name, record in records.items() if name.startswith(prefix)]
        return [record for record in whole if record.get("stage") != ERROR]

    groups = groups_of(of("plan-"))
    plans, networks = plan_section(groups), network_section(known["prediction"])
    transition = transition_row(known["centroidal"])
    networks = networks._replace(text=f"{networks.text}\n\n{markdown_table(HEADER, [transition.cells])}")
    searches = [record for name in SEARCHES for record in of(f"{name}-")]
    ours = [record for record in searches if record["rival"] == OURS and record["kind"] == FIELD]
    found = [
        plans._replace(text=f"{plans.text}\n\n{ratio_text(groups)}"),
        time_section(groups),
        mixed_section([record for record in of("MIP ") if "full" not in record["rival"]], ours),
        full_section([record for record in of("MIP full")]),
        search_section(searches),
        friction_section(of("cone-")),
        category_section(),
        networks,
        other_section(known),
    ]
    return found


def without_folders(record: Record) -> Record:
    """The record with reasons that name no folder of this machine: results are published."""
    return record | {"reason": str(record.get("reason", "")).replace(f"{ROOT}/", "")}


def full_section(records: Sequence[Record]) -> Section:
    """The mixed-integer program with full dynamics: its size, and what happens within the limit."""
    section = mixed_section(records, [])
    rows = section.content[1:]
    table = markdown_table(tuple(rows[0]), (tuple(row.values()) for row in rows)) if rows else "No solver is installed."
    return Section("Mixed-integer baseline, full dynamics", f"{FULL}\n\n{table}", [], rows)


FULL = (
    "The same with a CoP that moves on the sole, a yaw torque, steps of 0.2 s, and envelopes in two parts with a "
    "binary choice each. The paper found no plan in 7 hours with the momentum relaxation of its optimiser, a "
    "second-order cone program in every node; ours stays linear, so a plan here is one of an easier program, and says "
    "nothing of theirs."
)


def picture_text(records: dict[str, Record], pictures: Path, folder: Path, drawn: Sequence[tuple[str, str]]) -> str:
    """The pictures, copied beside the page."""
    parts = [f"{words}\n\n![{words}](paper/{name}.png)" for name, words in drawn]
    for picture in PICTURES:
        record = records.get(f"picture-{picture.name}", {"passed": False})
        verdict = "every wanted stage passed" if record["passed"] else record.get("reason") or "it was not drawn"
        for name, words in picture.files:
            drawn_now, kept = pictures / f"{name}.png", folder / f"{name}.png"
            if drawn_now.is_file():
                shutil.copyfile(drawn_now, kept)
            if kept.is_file() and record.get("stage") == "done":
                count = record.get("transitions")
                parts.append(f"{words} {count} transitions; {verdict}.\n\n![{words}](paper/{name}.png)")
            else:
                parts.append(f"{words} No picture: {verdict}.")
    return "\n\n".join(parts)


def draw(robot_name: str, robots: Path, calibration: dict[str, Any], folder: Path) -> list[tuple[str, str]]:
    """Draw the figures that need no run into a folder: names and words."""
    robot = load_robot(robot_name, robots)
    draw_models(robot, folder / "transition_models.png")
    draw_networks(load_networks(robot)[Category.MOVE_FOOT], folder / "networks.png")
    sums = draw_sums(calibration, folder / "sums.png")
    slope, intercept = sums.line
    return [
        ("transition_models", "Transition models: data collection, experiments, palms."),
        ("networks", "Networks, as they are loaded; the hidden layers are the same for all categories."),
        (
            "sums",
            f"Sum of predictions against the objective of the whole sequence, {len(sums.actual)} sequences of "
            f"calibration.json ({calibration['date']}): correlation {sums.pearson:.2f}, robust line {slope:.2f} x + "
            f"{intercept:.0f}. The paper's sum is far from the objective, since each transition is optimised alone; "
            "labels of ours are what a transition adds to a whole sequence.",
        ),
    ]


def run_text(size: Size, quick: bool, solvers: Sequence[str], loads: Sequence[float]) -> str:
    """How the page was made; `loads` are those of the machine at the beginning of the trials."""
    named = ", ".join(f"{name} (package {version(name)})" for name in solvers)
    kind = (
        f"**This is the quick run** (`{QUICK_COMMAND}`): few worlds and short limits, so intervals are wide. "
        f"`{FULL_COMMAND} --workers N` makes the full one and goes on where it was stopped."
        if quick
        else f"This is the full run (`{FULL_COMMAND}`)."
    )
    return (
        f"{kind} {size.trials} worlds of each kind for the paper's table, {size.rival_trials} for the rivals; limits: "
        f"{size.mixed_seconds:g} s a mixed-integer program, {size.full_seconds:g} s with full dynamics, "
        f"{size.search_seconds:g} s the other searches. Solvers: {named or 'none installed'}; Gurobi "
        "takes part where a licence is found. Figures of the networks and of their sums are those of prediction.json "
        "and calibration.json, with their dates. Every plan, whoever made it, is optimised and judged by the same "
        "independent residual check, and carried out in MuJoCo where the table says so. "
        f"Load of the machine during the trials: {spread(loads, '.0f')}; above the number of its cores, "
        "wall-clock times and limits tell more of other programs than of these."
    )


def arguments(argv: list[str] | None) -> argparse.Namespace:
    """The options; those that are not given are of the quick or of the full size."""
    parser = options.plain_parser("paper", DESCRIPTION)
    parser.epilog = "exit codes: 0 the page is written, 2 bad input"
    parser.set_defaults(planner="learned", expansions=None)
    parser.add_argument("--quick", action="store_true", help="few worlds, short limits")
    add_growing_options(parser)
    parser.add_argument("--trials", type=cli.positive(int), metavar="N", help="worlds of each kind")
    parser.add_argument("--rival-trials", type=cli.positive(int), metavar="N", help="worlds for the rivals")
    parser.add_argument("--mixed-seconds", type=cli.positive(float), metavar="S", help="limit of an integer program")
    parser.add_argument("--full-seconds", type=cli.positive(float), metavar="S", help="the same with full dynamics")
    return parser.parse_args(argv)


def size_of(args: argparse.Namespace) -> Size:
    """The size that the options ask for."""
    size = QUICK if args.quick else Size()
    asked = ("trials", "rival_trials", "mixed_seconds", "full_seconds")
    given = {name: getattr(args, name) for name in asked}
    return replace(size, **{name: value for name, value in given.items() if value is not None})


def main(argv: list[str] | None = None) -> int:
    """Run what is missing and write the page; returns the exit code."""
    args, console = arguments(argv), make_console()
    size = size_of(args)
    args.expansions = args.expansions or (300 if args.quick else 1000)
    settings, solvers = options.trial_settings(args), available()
    if settings.planner != "learned":
        raise InputError(f"--planner {settings.planner}: the page is of the learned planner; leave the option out")
    known = {name: _results(name) for name in KNOWN}
    if (options.RESULTS / f"{ABLATION}.json").is_file():
        known[ABLATION] = _results(ABLATION)
    pictures, folder = args.out / "pictures", args.results / "paper"
    jobs = jobs_of(settings, size, solvers, pictures.resolve(), args.seed_offset)
    store = TrialFile(args.out / "trials.jsonl", settings.deciding())
    for picture in PICTURES:  # those that were lost are drawn again
        name = f"picture-{picture.name}"
        if store.records.get(name, {}).get("stage") == "done" and not (pictures / f"{picture.name}.png").is_file():
            del store.records[name]
    described = {
        **settings.described(),
        "trials": size.trials,
        "quick": args.quick,
        "seed_offset": args.seed_offset,
    }
    if args.grow:
        take_over(store, args.results / "paper.json", described, [job.name for job in jobs])
    found = stamped(run_jobs(jobs, store, options.pool_of(args), console, "trials", args.minutes), state_of(settings))
    records = {record["name"]: without_folders(record) for record in found}
    _write(args, size, settings, described, solvers, records, len(jobs), known, folder, console)
    return 0


def _write(
    args: argparse.Namespace,
    size: Size,
    settings: TrialSettings,
    described: dict[str, Any],
    solvers: Sequence[str],
    records: dict[str, Record],
    wanted: int,
    known: dict[str, dict[str, Any]],
    folder: Path,
    console: Console,
) -> None:
    """Write the page, its pictures and the JSON behind it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror}); choose another --results") from error
    drawn = draw(settings.robot, settings.robots, known["calibration"], folder)
    sections = sections_of(records, known)
    worse = [line for section in sections for line in section.worse]
    compared = [row for section in sections for row in _rows(section.content)]
    bad = sum(row["worse"] for row in compared)
    made = [run_text(size, args.quick, solvers, values(records.values(), "load"))]
    made.append(growth_note(list(records.values()), wanted, state_of(settings)))
    path = write_results(
        args.results,
        "paper",
        title="The paper on one page",
        sections=[
            ("Where ours is worse", "\n".join(worse) or "Nowhere."),
            ("How this page was made", "\n\n".join(filter(None, made))),
            *((section.title, section.text) for section in sections),
            ("Figures", picture_text(records, args.out / "pictures", folder, drawn)),
            ("Trials that failed", failure_section(list(records.values()))),
        ],
        content={"worse": worse, **{section.title: section.content for section in sections}, "trials": records},
        goals=[goals.every("figures of the paper that ours are no worse than", len(compared) - bad, len(compared))],
        settings=described,
    )
    show_results(console, path)


def _rows(content: Any) -> list[dict[str, Any]]:
    """All figures of a section that stand beside one of the paper's, with whether ours is worse."""
    if isinstance(content, dict) and "published" in content:
        return [content]
    parts = content.values() if isinstance(content, dict) else content if isinstance(content, list) else ()
    return [row for part in parts for row in _rows(part)]


def _results(name: str) -> dict[str, Any]:
    """Results of another program that are committed.

    Raises:
        InputError: They are missing.
    """
    path = options.RESULTS / f"{name}.json"
    if not path.is_file():
        raise InputError(f"{path}: is missing; make it with python -m validation.{name}")
    return read_json(path)


if __name__ == "__main__":
    cli.run(main)
