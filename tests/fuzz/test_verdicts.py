"""Verdicts of runs on random terrain under random disturbances hold against a replay in plain MuJoCo.

For a long run see `tests/fuzz/budget.py`.
"""

import time
import traceback
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from tests.fuzz.budget import SEED, seconds
from tests.fuzz.children import run_in_child
from tests.fuzz.verdict_oracle import replayed
from tests.shipped_robots import OWN
from toolkit import pipeline
from toolkit.errors import ToolkitError, WorldError
from toolkit.execution.config import SCUFF_LIMIT, ExecutionConfig
from toolkit.execution.disturbance import Disturbance
from toolkit.execution.recorder import MAX_TILT, MIN_HEIGHT
from toolkit.execution.verdict import RANGE_TOLERANCE
from toolkit.robot.loader import load_robot
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.planner import PlannerConfig
from toolkit.world.generators import KINDS
from toolkit.world.loader import load_world

BLOCK = 10  # cases of one process
LIMIT = 600  # s; a case that takes longer hangs
SLIP_MARGIN = 4e-3  # m; the oracle counts by the plan's times, the verdict by measured forces
SHORT = {
    "rubble_field": {"rows": (1, 2), "tilt": (0.0, 20.0)},
    "rubble_corridor": {"rows": (1, 2), "tilt": (0.0, 20.0)},
    "stepping_stones": {"rows": (1, 2), "stone": (0.3, 0.45), "gap": (0.02, 0.1)},
    "stairs": {"steps": (1, 2), "step_height": (-0.1, 0.12)},
    "gap": {"width": (0.05, 0.5)},
    "slope": {"length": (0.5, 1.2), "angle": (-15.0, 25.0)},
    "mesh_patches": {"rows": (2, 3), "tilt": (0.0, 12.0)},
}
"""Ranges of the generators' numbers that give terrain of a few steps."""


def some_world(rng):
    """A short world of a random kind, and what it is."""
    kind = str(rng.choice(sorted(SHORT)))
    ranges = SHORT[kind] | {"friction": (0.3, 0.9), "shift": (0.2, 0.8), "swing": (0.4, 0.9)}
    numbers = {
        name: int(rng.integers(low, high + 1)) if isinstance(low, int) else round(float(rng.uniform(low, high)), 3)
        for name, (low, high) in ranges.items()
    }
    return load_world(f"{kind}.xml", mjcf=KINDS[kind](rng, **numbers)), f"{kind} {numbers}"


def some_disturbance(rng):
    """Nothing, or one or two things that differ from the plan; a push cannot be replayed and is left out."""
    scale = float(rng.choice([1.0, 4.0]))  # mild, which most runs survive, or wild, which many do not
    most = {
        "mass_error": scale * rng.uniform(-0.1, 0.1),
        "friction_error": max(scale * rng.uniform(-0.3, 0.1), -0.9),
        "terrain_offset": scale * rng.uniform(0.0, 0.02),
        "terrain_tilt": scale * rng.uniform(0.0, 0.05),
        "state_noise": scale * rng.uniform(0.0, 0.003),
        "delay": scale * rng.uniform(0.0, 0.01),
    }
    names = rng.choice(sorted(most), int(rng.choice([0, 1, 2])), replace=False)
    return Disturbance(**{str(name): float(most[str(name)]) for name in names})


def check_verdict(seed):
    """Plan and execute one case, and hold the verdict against the replay; how it ended."""
    rng = np.random.default_rng([seed, 3])
    robots = OWN
    robot = load_robot(robots[int(rng.integers(len(robots)))])
    try:
        world, what = some_world(rng)
    except WorldError:
        return "no world"
    execution = ExecutionConfig(disturbance=some_disturbance(rng), replanning=bool(rng.random() < 0.7))
    config = pipeline.PipelineConfig(seed=int(rng.integers(100)), candidates=2, execution=execution)
    what += f" {robot.name} {execution}"
    search = PlannerConfig(search=AnaStarConfig(max_expansions=60), palms=bool(rng.random() < 0.5))
    try:
        result = pipeline.run(robot, world, pipeline.make_planner(robot, world, "kinematic", search), config)
    except ToolkitError:
        return "no plan"
    assert result.passed == (result.reason == ""), what
    if result.trial is None or result.trial.execution is None:
        assert not result.passed, what
        return "not executed"
    run, trial = result.trial.execution, result.trial
    seen = replayed(run.scene, robot, run.controls, trial.plan.schedule)
    np.testing.assert_array_equal(seen.final_qpos, run.controls.final_qpos, err_msg=what)
    goal = float(np.hypot(*(seen.feet - world.goal.position[:2])))
    assert goal == pytest.approx(run.final_goal_distance, abs=1e-9), what
    assert seen.torque == pytest.approx(run.max_torque_ratio, rel=1e-9), what
    if execution.control_decimation == 1:
        assert seen.velocity == pytest.approx(run.max_velocity_ratio, rel=1e-9), what
    low = MIN_HEIGHT * robot.com_height
    fell = seen.tilt > MAX_TILT or seen.sink < low
    assert not fell or run.fell, f"it fell in the replay, by {seen}: {what}"
    if result.passed:
        assert goal <= world.goal.radius and seen.tilt < MAX_TILT and seen.sink > low, f"{seen}: {what}"
        assert max(seen.torque, seen.velocity) <= 1.0 and seen.excess <= RANGE_TOLERANCE, f"{seen}: {what}"
        assert not seen.touched and seen.slip <= execution.slip_limit + SLIP_MARGIN, f"{seen}: {what}"
        assert seen.scuff <= SCUFF_LIMIT, f"{seen}: {what}"
        assert seen.scuff == pytest.approx(run.max_scuff, rel=1e-6, abs=1e-9), f"{run.scuffs} {seen}: {what}"
        return "PASS" if not seen.scuff else "PASS with a graze"
    assert run.failure is not None and run.failure.reason, what
    return "FAIL"


def test_a_verdict_holds():
    """One case of the long run that is executed."""
    assert check_verdict(1) in ("PASS", "PASS with a graze", "FAIL")


def test_a_verdict_that_lies_is_noticed(walked, walking):
    """The oracle sees a foot that slides, controls that were changed, and a trunk that touches."""
    robot, schedule = walking.robot, walking.schedule
    seen = replayed(walked.scene, robot, walked.controls, schedule)
    np.testing.assert_array_equal(seen.final_qpos, walked.controls.final_qpos)
    assert not seen.touched and seen.slip < walked.max_slip + SLIP_MARGIN and seen.sink > MIN_HEIGHT * robot.com_height
    weak = replace(walked.controls, ctrl=0.3 * walked.controls.ctrl)
    fallen = replayed(walked.scene, robot, weak, schedule)
    assert fallen.slip > 0.05 and fallen.sink < seen.sink and (fallen.final_qpos != seen.final_qpos).any()


def check_block(block):
    """Check some cases; how many ended in each way, and the failures."""
    ends, failures = Counter(), []
    for number in block:
        try:
            ends[check_verdict(number)] += 1
        except Exception:
            failures.append(f"case {number}: {traceback.format_exc()[-3000:]}")
    return dict(ends), failures


@pytest.mark.slow
def test_many_verdicts_hold(capfd):
    began, first, ends, failures = time.monotonic(), SEED * 1_000_000, Counter(), []
    number = first
    while time.monotonic() - began < seconds("verdicts"):
        block = range(number, number + BLOCK)
        found, failed = run_in_child(lambda block=block: check_block(block), BLOCK * LIMIT)
        ends.update(found)
        failures += failed
        number += BLOCK
    with capfd.disabled():
        print(f"\n{number - first} verdicts, {dict(ends)}, {len(failures)} failures, seed {SEED}")  # noqa: T201
    assert not failures, "\n\n".join(failures[:20])
    assert ends["PASS"] and ends["FAIL"]
