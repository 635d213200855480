"""Legs without ankle roll: soles that roll about a line, on a small robot written for it."""

import mujoco
import numpy as np
import pytest

from tests.robot.line_feet import LINE_TOML, SOLE, line_biped_mjcf
from tests.robot.samples import biped_mjcf, write_robot
from toolkit.errors import RobotError
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import rolled_onto
from toolkit.physics.leg import leg_posture
from toolkit.robot.loader import load_robot
from toolkit.robot.model import LINE, RobotModel
from toolkit.robot.rolling import LEAST

UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> RobotModel:
    return load_robot(str(write_robot(tmp_path_factory.mktemp("line") / "line", line_biped_mjcf(), LINE_TOML)))


@pytest.fixture(scope="module")
def wide(tmp_path_factory: pytest.TempPathFactory) -> RobotModel:
    """The leg's plane passes 0.08 m beside the crossing of the hip's axes."""
    model = line_biped_mjcf()
    for side, sign in (("left", 1), ("right", -1)):
        here = f'name="{side}_knee_link" pos="0 0 -0.35"'
        assert here in model
        model = model.replace(here, f'name="{side}_knee_link" pos="0 {0.08 * sign} -0.35"')
    return load_robot(str(write_robot(tmp_path_factory.mktemp("wide") / "wide", model, LINE_TOML)))


def test_a_sole_without_ankle_roll_rolls(robot: RobotModel) -> None:
    assert len(robot.joint_names) == 10
    for foot in FEET:
        item, (low, high) = robot.limbs[foot], robot.legs[foot].ranges["ankle_roll"]
        assert item.rolls
        np.testing.assert_allclose(item.bearing, [item.half_size[0], LINE])
        np.testing.assert_allclose(robot.bearings[foot], item.bearing)
        # The site sinks below the round edge by radius (1 - cos(roll)), of which 3 mm are allowed.
        np.testing.assert_allclose([-low, high], np.arccos(1 - 0.003 / 0.02), atol=0.01)


def test_soles_with_an_ankle_roll_do_not(tmp_path) -> None:
    robot = load_robot(str(write_robot(tmp_path / "biped")))
    assert not any(item.rolls for item in robot.limbs.values())
    np.testing.assert_array_equal(robot.bearings, robot.half_sizes)


def test_a_foot_on_its_edge_rolls_to_one_side(tmp_path) -> None:
    """The left foot stands on the left edge of a box: the leg may lean to the left."""
    toml = LINE_TOML.replace("position = [0.02, 0.0, -0.08]", "position = [0.02, 0.05, -0.08]", 1)
    toml = toml.replace("position = [0.02, 0.0, -0.08]", "position = [0.02, -0.05, -0.08]", 1)
    assert SOLE in biped_mjcf()
    robot = load_robot(str(write_robot(tmp_path / "edge", toml=toml)))
    leg, other = robot.legs[Limb.LEFT_FOOT], robot.legs[Limb.RIGHT_FOOT]
    offset = leg_posture(
        leg, np.array([[0.0, 0.0, robot.com_height]]), np.zeros(1), robot_sole(robot)[None], np.eye(3)[None]
    ).ankle_roll[0]  # of the two-link leg where the true one does not lean
    low, high = np.array(leg.ranges["ankle_roll"]) - offset
    assert -0.05 < low < 0.0 and high > 2 * LEAST
    np.testing.assert_allclose(other.ranges["ankle_roll"], [-leg.ranges["ankle_roll"][1], -leg.ranges["ankle_roll"][0]])


def robot_sole(robot: RobotModel) -> np.ndarray:
    """(3,) m; the left sole below the home posture's CoM at x = y = 0."""
    data = mujoco.MjData(robot.mujoco_model)
    data.qpos[:] = robot.home
    mujoco.mj_kinematics(robot.mujoco_model, data)
    mujoco.mj_comPos(robot.mujoco_model, data)
    return data.site("left_foot").xpos - data.subtree_com[1] * [1, 1, 0]


def test_a_flat_foot_that_cannot_roll_is_refused(tmp_path) -> None:
    folder = write_robot(tmp_path / "flat", toml=LINE_TOML)
    with pytest.raises(RobotError, match="left_foot: the leg has no ankle roll.*put the patch on the edge or the line"):
        load_robot(str(folder))


@pytest.mark.parametrize("name", ["robot", "wide"])
def test_two_links_stand_for_a_leg_that_rolls(name: str, request: pytest.FixtureRequest) -> None:
    """In random postures the closed form has the joints' angles, up to what its simplifications cost."""
    robot: RobotModel = request.getfixturevalue(name)
    model, rng = robot.mujoco_model, np.random.default_rng(0)
    data = mujoco.MjData(model)
    for foot in FEET:
        leg, joints = robot.legs[foot], robot.joints_to(foot)
        data.qpos[:] = robot.home
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        hip = data.subtree_com[1] + leg.hip_in_com - data.xpos[1]
        for _ in range(20):
            pitch, roll, knee = rng.uniform(-0.7, -0.2), rng.uniform(-0.2, 0.2), rng.uniform(0.5, 1.0)
            data.qpos[:] = robot.home
            data.qpos[7 + joints] = pitch, roll, 0.0, knee, 0.0
            mujoco.mj_kinematics(model, data)
            site = data.site(foot.label)
            # The ankle that brings the sole's line level.
            data.qpos[7 + joints[-1]] = np.arctan2(site.xmat[6], site.xmat[8])
            mujoco.mj_kinematics(model, data)
            sole = rolled_onto(site.xmat.reshape(3, 3), UP)
            np.testing.assert_allclose(sole[2, 0], 0, atol=1e-3)
            com = data.xpos[1] + hip - leg.hip_in_com
            posture = leg_posture(leg, com[None], np.zeros(1), site.xpos[None], sole[None])
            low, high = model.jnt_range[1 + joints].T
            ends = np.array([leg.ranges[role] for role in ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch")])
            ours = np.array([posture.hip_roll[0] - ends[1, 0], posture.knee[0] - ends[3, 0]])
            theirs = (data.qpos[7 + joints] - low)[[1, 3]]
            np.testing.assert_allclose(ours, theirs, atol=0.06)
            assert leg.min_length < posture.length[0]
