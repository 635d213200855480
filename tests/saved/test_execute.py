"""`python -m toolkit.execute`: the same plan with the same settings is the same run."""

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.saved import damage
from tests.saved.conftest import called
from toolkit import execute
from toolkit.errors import InputError
from toolkit.geometry.limb import Limb
from toolkit.pipeline import PipelineConfig, carry_out
from toolkit.report.files import read_json
from toolkit.report.plan_file import read_names, read_plan, read_proposal
from toolkit.world.loader import load_world

FILES = ("plan.json", "motion.npz", "execution.npz", "scene.mjb")


def test_a_run_is_carried_out_again_to_the_last_digit(walk_folder, tmp_path, capsys):
    out = tmp_path / "again"
    assert called(execute.main, walk_folder, "--no-recording", "--out", out) == (0, "")
    for name in FILES:
        assert (out / name).read_bytes() == (walk_folder / name).read_bytes(), name
    text = capsys.readouterr().out
    assert "\nPASS\n" in text and "planning" not in text
    report, before = read_json(out / "report.json"), read_json(walk_folder / "report.json")
    assert report["checks"] == before["checks"] and report["seed"] == before["seed"] == 5
    for name in ("push", "mass_error", "terrain_error", "replanning", "world"):
        assert report["options"][name] == before["options"][name]
    once_more = tmp_path / "once_more"
    assert called(execute.main, out, "--no-recording", "--out", once_more) == (0, "")
    assert (once_more / "execution.npz").read_bytes() == (out / "execution.npz").read_bytes()


def test_options_go_before_those_of_the_run(walk_folder, tmp_path):
    out = tmp_path / "again"
    options = ("--mass-error", "0", "--terrain-error", "0", "--state-noise", "1e-5", "--seed", "8", "--no-replanning")
    assert called(execute.main, walk_folder, "--no-recording", "--out", out, *options) == (0, "")
    report = read_json(out / "report.json")
    assert report["seed"] == 8 and report["options"]["terrain_error"] == [0.0, 0.0]
    assert report["options"]["replanning"] is False and report["stages"]["execution"]["replans"] == 0
    assert (out / "plan.json").read_bytes() == (walk_folder / "plan.json").read_bytes()
    words = execute.arguments().parse_args
    assert [words(["x", *each]).replanning for each in ([], ["--no-replanning"], ["--replanning"])] == [
        True,
        False,
        True,
    ]
    assert (out / "execution.npz").read_bytes() != (walk_folder / "execution.npz").read_bytes()


def test_a_plan_by_itself_needs_its_world(walk_folder, walk_world, tmp_path):
    plan, out = walk_folder / "plan.json", tmp_path / "again"
    code, line = called(execute.main, plan)
    assert code == 2 and "name the world that it was made for with --world (it was called flat)" in line
    assert called(execute.main, plan, "--world", walk_world, "--out", out) == (0, "")
    assert read_json(out / "report.json")["options"]["mass_error"] == 0.0  # no settings of the folder
    assert (out / "recording.rrd").is_file()


def test_a_fall_is_a_failed_check(walk_folder, tmp_path, capsys):
    assert called(execute.main, walk_folder, "--no-recording", "--push", "3000", "--out", tmp_path / "fell") == (1, "")
    assert "FAIL: the robot fell" in capsys.readouterr().out
    assert read_json(tmp_path / "fell" / "report.json")["verdict"] == "FAIL"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (damage.without("plan.json"), "lacks plan.json"),
        (damage.cut("plan.json"), "plan.json: is not a JSON file"),
        (damage.filled("plan.json", b"[1]"), "plan.json: schema is broken"),
        (damage.edited("plan.json", schema=7), "has schema 7, this version reads 1"),
        (damage.edited("plan.json", transitions=[{}]), "transitions[0] has no valid 'times'"),
        (damage.edited("plan.json", predicted_com=[[0, 0, 1]]), "predicted_com needs a point of 3 numbers"),
        (damage.edited("plan.json", cost="dear"), "cost, bound or predicted_com is broken"),
        (damage.edited("plan.json", robot=None), "does not name a world and a robot"),
        (damage.without("report.json"), "holds no report.json"),
        (damage.edited("report.json", schema=1), "has schema 1, this version reads 3"),
        (damage.edited("report.json", options={"push": "hard"}), "options.push is 'hard' in the report"),
        (damage.edited("report.json", options={"terrain_error": 1}), "options.terrain_error is 1 in the report"),
        (damage.edited("report.json", seed=-1), "-1: give a whole number from 0"),
        (damage.edited("report.json", options={}), "name the world that it was made for with --world"),
        (damage.edited("report.json", options={"world": "gone.xml"}), "gone.xml: the world of this run is not there"),
        (damage.edited("report.json", options={"mass_error": -2}), "mass_error must be a fraction above -1"),
    ],
)
def test_a_damaged_folder_gets_one_line(copy, tmp_path, change, words):
    change(copy)
    code, line = called(execute.main, copy, "--out", tmp_path / "out")
    assert code == 2 and words in line and "\n" not in line and not (tmp_path / "out").exists()


def changed_contact(folder, change):
    """Change the first contact that the plan makes."""
    plan = json.loads((folder / "plan.json").read_text())
    change(plan["transitions"][0])
    (folder / "plan.json").write_text(json.dumps(plan))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda entry: entry["position"].__setitem__(2, 0.3),
            "transitions[0] puts left_foot 0.30 m away from surface 0",
        ),
        (lambda entry: entry.update(surface=9), "on surface 9, and there are 1"),
        (lambda entry: entry.update(friction=0.9), "counts on friction 0.9 where surface 0 has 0.7"),
        (lambda entry: entry.update(quaternion_wxyz=[1, 0, 0, 0.1]), "rotation is not that of quaternion_wxyz"),
        (lambda entry: entry.update(rotation=[1, 0]), "rotation is not that of quaternion_wxyz"),
    ],
)
def test_a_plan_of_another_world_is_refused(copy, change, words):
    changed_contact(copy, change)
    code, line = called(execute.main, copy)
    assert code == 2 and words in line


def test_a_robot_without_the_limb_is_refused(copy, robot):
    limbs = {limb: model for limb, model in robot.limbs.items() if limb is not Limb.LEFT_FOOT}
    world = load_world(read_json(copy / "report.json")["options"]["world"])
    with pytest.raises(InputError, match=f"start has a contact of left_foot, which robot {robot.name} does not have"):
        carry_out(replace(robot, limbs=limbs), world, read_proposal(copy / "plan.json"), PipelineConfig())


def test_a_plan_that_counts_on_more_ground_than_bears_is_refused(copy, robot):
    world = load_world(read_json(copy / "report.json")["options"]["world"])
    crests = tuple(replace(surface, bearing=0.05) for surface in world.surfaces)
    with pytest.raises(InputError, match=r"start counts on ground that bears left_foot inf mm .* does so for 50 mm"):
        carry_out(robot, replace(world, surfaces=crests), read_proposal(copy / "plan.json"), PipelineConfig())


def test_an_unknown_robot_gets_one_line(walk_folder):
    code, line = called(execute.main, walk_folder, "--robot", "nobody")
    assert code == 2 and "nobody" in line


def test_a_contact_may_be_turned_without_its_rotation(copy):
    def turn(entry):
        del entry["rotation"]
        entry["quaternion_wxyz"] = [np.cos(0.05), 0.0, 0.0, np.sin(0.05)]

    changed_contact(copy, turn)
    contact = read_plan(copy / "plan.json").transitions[0].contact
    assert contact is not None and contact.pose.yaw == pytest.approx(0.1, abs=1e-12)


def test_a_proposal_has_landing_points_where_the_search_put_them(copy):
    changed_contact(copy, lambda entry: entry.update(moved_from=[0.1, 0.2, 0.0]))
    plan, proposal = read_plan(copy / "plan.json"), read_proposal(copy / "plan.json")
    found, proposed = plan.transitions[0].contact, proposal.sequence.transitions[0].contact
    assert found is not None and proposed is not None
    np.testing.assert_array_equal(proposed.pose.position, [0.1, 0.2, 0.0])
    np.testing.assert_array_equal(proposed.pose.rotation, found.pose.rotation)
    assert not np.array_equal(found.pose.position, proposed.pose.position)
    assert (proposal.cost, proposal.bound) == (7.0, 1.5)
    assert proposal.com.shape == (3, 3)


def test_a_plan_without_predictions_is_a_proposal_too(copy):
    damage.edited("plan.json", cost=None, bound=None, predicted_com=None)(copy)
    proposal = read_proposal(copy / "plan.json")
    assert np.isnan(proposal.cost) and np.isnan(proposal.bound) and proposal.com.shape == (0, 3)
    assert read_names(copy / "plan.json")[0] == "flat"


def test_a_plan_without_predictions_is_carried_out(copy, tmp_path):
    damage.edited("plan.json", cost=None, bound=None, predicted_com=None)(copy)
    assert called(execute.main, copy, "--out", tmp_path / "again") == (0, "")
    assert read_json(tmp_path / "again" / "plan.json")["cost"] is None
