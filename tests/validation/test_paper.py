"""The page of the paper: its statistics, its comparisons, its drawings, and a page of made-up records."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from tests.validation.three_surfaces import three_surfaces
from toolkit.errors import InputError
from toolkit.pipeline import make_planner
from toolkit.robot.loader import load_robot
from validation import options, paper
from validation.machine import ROOT
from validation.page import plans
from validation.page.drawings import draw_models, draw_networks, draw_sums
from validation.page.friction import slope_figures, slope_text
from validation.page.known import category_section, network_section
from validation.page.others import other_section
from validation.page.rivals import mixed_section, search_section
from validation.page.spread import Compared, rate, spread, worse_first
from validation.planning import PAPER
from validation.rivals.even_steps import even_steps
from validation.rivals.footsteps import footsteps_of
from validation.rivals.sl1m import relax
from validation.rivals.solvers import available
from validation.trial_file import TrialFile

FIGURES = ("linear_momentum", "linear_momentum_rate", "angular_momentum", "angular_momentum_rate", "force", "torque")
FIGURES += ("lateral_force", "cop_distance", "foot_cop_distance")


def test_rates_have_wilsons_interval_and_times_quartiles():
    assert rate(50, 50) == "50/50 (93 to 100 %)"
    assert rate(0, 0) == "0/0"
    assert spread([1.0, 2.0, 3.0, 4.0, 5.0], ".0f", 1e3) == "3000 [2000, 4000]"
    assert spread([]) == "-"


@pytest.mark.parametrize(
    ("value", "published", "better", "worse"),
    [(1.0, 2.0, -1, False), (3.0, 2.0, -1, True), (1.0, 2.0, 1, True), (2.0, 2.0, 1, False), (None, 2.0, 1, True)]
    + [(9.0, 2.0, 0, False), (9.0, None, -1, False)],
)
def test_what_is_worse_is_said(value, published, better, worse):
    row = Compared("figure", "2", "ours", value, published, better, "Because.")
    assert row.worse is worse
    assert row.record["worse"] is worse
    assert len(worse_first("here", [row])) == worse


def plan_record(kind, planner, seed, **changes):
    figures = dict.fromkeys(FIGURES, 0.5) | {"duration": 10.0}
    record = {"name": f"plan-{planner}-{kind}-{seed}", "kind": kind, "planner": planner, "seed": seed}
    record |= {"stage": "done", "passed": True, "found": True, "feasible": True, "tested": 1.0, "objective": 3000.0}
    record |= {"paper_objective": 2000.0 + seed, "figures": figures, "palm_contacts": 0, "transitions": 9}
    record |= {"first_seconds": 0.05, "search_seconds": 1.0, "heuristic_seconds": 0.01, "optimiser_seconds": 0.1}
    return record | {"peak_memory": 1.0, "reason": ""} | changes


def test_every_column_of_the_papers_table_has_ours_beside_it():
    groups = {
        (kind, planner): [plan_record(kind, planner, seed) for seed in range(4)]
        for kind in PAPER
        for planner in plans.PLANNERS
    }
    section = plans.plan_section(groups)
    for name, rows in section.content.items():
        assert len(rows) == 12, name
        assert [row["name"].split()[0] for row in rows] == [f"({number})" for number in range(1, 13)]
        assert all(row["value"] is not None and row["why"] for row in rows)
    kind, line = "rubble_field", PAPER["rubble_field"][1].split()
    row = section.content[f"{kind} learned"][3]
    assert row["value"] == pytest.approx(2001.5) and row["published"] == float(line[3])
    assert any("CoP" not in text and "linear momentum" not in text for text in section.worse)
    assert all(text.startswith("- rubble") for text in section.worse)
    groups["rubble_field", "learned"] = [plan_record(kind, "learned", 0, found=False, feasible=False)]
    assert "planned" in "\n".join(plans.plan_section(groups).worse)


def rival_record(rival, seed, seconds, cost, **changes):
    record = {"rival": rival, "kind": "rubble_field", "seed": seed, "stage": "done", "found": True, "feasible": True}
    record |= {
        "seconds": seconds,
        "processor_seconds": seconds,
        "true_cost": cost,
        "transitions": 12,
        "screened": 12,
        "expansions": 5,
        "reason": "",
    }
    return record | {"passed": True} | changes


def test_rivals_that_beat_us_are_told_first():
    ours = [rival_record("ANA*", seed, 1.0, 900.0) for seed in range(3)]
    solution = {"first_seconds": 0.5, "gap_seconds": None}
    size = {"variables": 10, "integers": 4, "rows": 7, "limit": 20.0}
    mixed = [rival_record("MIP HiGHS 12", seed, 0.5, 1000.0, solution=solution, **size) for seed in range(3)]
    section = mixed_section(mixed, ours)
    assert section.worse == [
        "- processor time to the first plan: ours is 2.00 times that of MIP HiGHS 12, median of 3 worlds"
    ]
    assert section.content[1]["the paper [s]"] == "85.93 ± 56.41"
    assert section.content[1]["5 % gap proved"].startswith("0/3")
    other = [rival_record("SL1M", seed, 2.0, 600.0) for seed in range(3)]
    assert "true cost" in search_section([*ours, *other]).worse[0]
    refused = [rival_record("A*", 0, 1.0, 1.0, found=False, feasible=False, reason="stopped by expansions")]
    assert "stopped by expansions" in search_section([*ours, *refused]).text


def test_the_slope_is_worked_out():
    found = slope_figures()
    assert found["cone_angle"] < 30.0 < found["pyramid_angle"]
    assert found["acceleration"] == pytest.approx(0.657, abs=1e-3)
    assert found["seconds"] == pytest.approx(3.02, abs=0.01)
    assert found["speed"] == pytest.approx(found["acceleration"] * found["seconds"])
    assert slope_figures(angle=20.0)["seconds"] == math.inf
    assert "62 s" in slope_text()


def test_known_results_fill_the_tables_of_categories_and_networks():
    assert len(category_section().content) == 10
    prediction = json.loads((options.RESULTS / "prediction.json").read_text())
    section = network_section(prediction)
    assert len(section.content) == 10
    assert all(len(rows) == 5 for rows in section.content.values())
    # Worse figures are told: those of networks that predict nothing are all worse.
    for row in prediction["scores"]["1 s + 1 s, friction 0.5"].values():
        for figures in [row, *(part for part in row.values() if isinstance(part, dict))]:
            figures |= {"accuracy": 0.5, "objective_error": 1e6, "com_error": 1.0, "velocity_error": 1.0}
    assert len(network_section(prediction).worse) == 40


def test_rows_of_other_results_are_read(tmp_path):
    known = {name: json.loads((options.RESULTS / f"{name}.json").read_text()) for name in ("execution", "budgets")}
    assert "execution.json" in other_section(known).text and "ablation" not in other_section(known).text
    row = {"kind": "any_gap", "planner": "learned", "variant": "raw", "feasible": 9, "trials": 10}
    row |= {"true cost": 500.0, "J, paper's weights": None}
    known["ablation"] = {"date": "today", "code": "0", "table": [row]}
    assert "| any_gap | learned | raw | 9/10 (60 to 98 %) | 500 | - |" in other_section(known).text


def test_drawings_are_of_what_is_loaded(tmp_path):
    robot = load_robot(None)
    from toolkit.prediction.networks import load_networks

    draw_models(robot, tmp_path / "models.png")
    draw_networks(next(iter(load_networks(robot).values())), tmp_path / "networks.png")
    calibration = json.loads((options.RESULTS / "calibration.json").read_text())
    relation = draw_sums(calibration, tmp_path / "sums.png")
    assert len(relation.actual) > 100 and relation.pearson > 0.5
    assert all((tmp_path / f"{name}.png").stat().st_size > 5000 for name in ("models", "networks", "sums"))


def test_sizes_jobs_and_refusals(tmp_path):
    args = paper.arguments(["--quick", "--trials", "3"])
    size = paper.size_of(args)
    assert size.trials == 3 and size.mixed_seconds == paper.QUICK.mixed_seconds
    args = paper.arguments([])
    assert paper.size_of(args) == paper.Size()
    args.expansions = 10
    settings = options.trial_settings(args)
    jobs = paper.jobs_of(settings, paper.QUICK, ["HiGHS"], Path("pictures"), 0)
    names = [job.name for job in jobs]
    assert len(set(names)) == len(names)
    assert sum(name.startswith("MIP full") for name in names) == 1
    assert sum(name.startswith("picture-") for name in names) == len(paper.PICTURES)
    with pytest.raises(InputError, match="learned"):
        paper.main(["--planner", "kinematic", "--out", str(tmp_path / "out"), "--results", str(tmp_path / "results")])


def test_a_walk_down_a_steep_slope_is_made_of_friction_that_is_not_there():
    pytest.importorskip("casadi", reason="CasADi is not installed")
    from validation.cases import Case
    from validation.pyramid_trial import PAPERS_TIMING, beyond_cone, motion_under

    robot = load_robot(None)
    world = Case("steep_slope_1m", 0, (("length", 0.6),)).world()
    task = footsteps_of(robot, world, make_planner(robot, world, "kinematic"), 7)
    sequence = even_steps(replace(task, timing=PAPERS_TIMING))
    steep = [world.surfaces[contact.surface].normal[2] < 0.9 for contact in sequence.contacts]
    assert any(steep) and not steep[0] and not steep[-1]
    pyramid, cone = (motion_under(robot, world, sequence, pyramid=pyramid).motion for pyramid in (True, False))
    assert pyramid.feasible and beyond_cone(pyramid) > 1.05
    assert not cone.feasible


def test_on_level_ground_both_cones_give_the_same_motion():
    pytest.importorskip("casadi", reason="CasADi is not installed")
    from validation.pyramid_trial import PAPERS_TIMING, beyond_cone, motion_under

    robot, world = load_robot(None), three_surfaces()
    task = footsteps_of(robot, world, make_planner(robot, world, "kinematic"), 4)
    sequence = relax(replace(task, timing=PAPERS_TIMING)).sequence
    assert sequence is not None
    pyramid, cone = (motion_under(robot, world, sequence, pyramid=pyramid).motion for pyramid in (True, False))
    assert pyramid.feasible and cone.feasible
    assert beyond_cone(pyramid) < 0.9
    assert pyramid.objective == pytest.approx(cone.objective, rel=1e-3)


def made_up(job):
    """A record of a job, as its trial might leave it."""
    name, arguments = job.name, job.arguments
    if name.startswith("plan-"):
        return plan_record(arguments[1].kind, arguments[2], arguments[1].seed) | {"name": name}
    if name.startswith("cone-"):
        motion = {"feasible": True, "objective": 1.0, "beyond_cone": 1.3, "executed": False, "execution_reason": "fell"}
        motions = {"pyramid": motion | {"figures": dict.fromkeys(FIGURES, 1.0)}, "cone": {"feasible": False}}
        record = {"kind": arguments[1].kind, "motions": motions, "stage": "done", "passed": True, "reason": ""}
        return record | {"name": name}
    if name.startswith("picture-"):
        return {"name": name, "stage": "planning", "passed": False, "reason": f"{ROOT}/worlds/x.xml: no way"}
    case, rival = arguments[1], arguments[2]
    record = rival_record(rival if isinstance(rival, str) else rival.name, case.seed, 1.0, 900.0, kind=case.kind)
    solution = {"first_seconds": 0.5, "gap_seconds": 0.7}
    size = {"variables": 10, "integers": 4, "rows": 7, "limit": 20.0, "solution": solution}
    return record | {"name": name} | ({} if isinstance(rival, str) else size)


def test_the_page_is_written_from_trials_that_are_there_and_nothing_runs_twice(tmp_path, capsys):
    folders = ["--out", str(tmp_path / "out"), "--results", str(tmp_path / "results"), "--workers", "0"]
    argv = ["--quick", "--trials", "1", *folders]
    args = paper.arguments(argv)
    args.expansions = 300
    settings = options.trial_settings(args)
    store = TrialFile(args.out / "trials.jsonl", settings.deciding())
    for job in paper.jobs_of(settings, paper.size_of(args), available(), args.out / "pictures", 0):
        store.add(made_up(job))
    assert paper.main(argv) == 0
    count = len(store.records)
    assert f"{count} of {count} trials known from before" in capsys.readouterr().out
    page = (tmp_path / "results" / "paper.md").read_text()
    headings = [line for line in page.splitlines() if line.startswith("## ")]
    assert headings[:3] == ["## Goals", "## Where ours is worse", "## How this page was made"]
    assert "This is the quick run" in page and str(ROOT) not in page
    written = json.loads((tmp_path / "results" / "paper.json").read_text())
    assert len(written["trials"]) == count
    worse = written["worse"]
    assert any("rubble field, learned" in line for line in worse)
    assert written["goals"][0]["result"] == "not met"
    assert {path.name for path in (tmp_path / "results" / "paper").iterdir()} == {
        "transition_models.png",
        "networks.png",
        "sums.png",
    }
