"""A robot without ankle roll walks on feet that roll about a line."""

import numpy as np
import pytest

from tests.conftest import Plan, walk
from tests.robot.line_feet import LINE_TOML, line_biped_mjcf
from tests.robot.samples import write_robot
from toolkit.control.dynamics import RobotDynamics
from toolkit.execution.check import Result
from toolkit.geometry.limb import FEET
from toolkit.geometry.pose import rotation_from_quaternion
from toolkit.robot.loader import load_robot


@pytest.fixture(scope="module")
def planned(flat, tmp_path_factory) -> Plan:
    robot = load_robot(str(write_robot(tmp_path_factory.mktemp("line") / "line", line_biped_mjcf(), LINE_TOML)))
    return Plan(robot, flat(0.15), walk(robot, 2, 0.15))


@pytest.fixture(scope="module")
def run(planned):
    return planned.run()


def rolls(poses: np.ndarray) -> np.ndarray:
    """Roll (n,) rad of patches on level ground, from poses (n, 7): position and quaternion wxyz."""
    turn = rotation_from_quaternion(poses[:, 3:])
    return np.arctan2(turn[:, 2, 1], turn[:, 2, 2])


def test_it_walks(run):
    assert {check.name for check in run.checks if check.result is not Result.PASS} == set()
    assert len(run.touchdowns) == 2 and run.solver_failures == 0
    assert run.com_rms_error < 0.01


def test_the_plan_pushes_on_the_lines_alone(planned):
    motion, (x, y) = planned.motion, planned.robot.limbs[FEET[0]].bearing
    cop = np.abs(motion.cop[:, FEET])
    assert (cop[..., 0] <= x).all() and (cop[..., 1] <= y).all()


def test_feet_in_contact_roll_with_their_legs_and_do_not_turn_otherwise(planned, run):
    for foot in FEET:
        executed = run.samples.limb_pose[:, foot]
        loaded = run.samples.wrench[:, foot, 2] > 0.2 * planned.robot.mass * 9.81
        assert np.ptp(rolls(executed[loaded])) > np.radians(3)
        level = rotation_from_quaternion(executed[loaded, 3:])[:, 2, 0]
        np.testing.assert_allclose(level, 0.0, atol=np.radians(1))


def test_the_controller_takes_contacts_as_not_rolled(planned):
    robot, rng = planned.robot, np.random.default_rng(0)
    dynamics = RobotDynamics(robot)
    qpos = robot.home.copy()
    qpos[7:] += rng.uniform(-0.1, 0.1, len(robot.joint_names))
    dynamics.update(qpos, np.zeros(6 + len(robot.joint_names)))
    before = dynamics.limb_rotation.copy()
    dynamics.roll_soles(np.tile([0.0, 0.0, 1.0], (4, 1)))
    assert dynamics.rolling == FEET
    for foot in FEET:
        after = dynamics.limb_rotation[foot]
        np.testing.assert_allclose(after[:, 0], before[foot, :, 0], atol=1e-12)
        np.testing.assert_allclose(after.T @ after, np.eye(3), atol=1e-12)
        assert after[2, 1] == pytest.approx(0.0, abs=1e-12) and after[2, 2] > 0.9
