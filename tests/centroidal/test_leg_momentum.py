"""Angular momentum of swinging legs, and what of it the ground has to take up."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from tests.centroidal.walks import walk
from tests.shipped_robots import EVERY, OWN
from toolkit.centroidal.build import ProblemConfig, initial_com, sequence_problem
from toolkit.centroidal.leg_momentum import ankles, ground_share, leg_spin
from toolkit.centroidal.sequence import SequenceConfig, optimise
from toolkit.robot.loader import load_robot


@pytest.fixture(scope="module", params=OWN)
def walker(request):
    return load_robot(request.param)


@pytest.fixture(scope="module")
def posed(walker):
    start, schedule = walk(walker, 3, 0.3, (0.6, 0.8), friction=0.7, rest=1.0)
    com = initial_com(walker, start)
    return sequence_problem(walker, schedule, com, np.zeros(3), config=ProblemConfig(max_dt=0.01)), schedule, com


def standing(problem):
    """The problem with all contacts where they are at first."""
    places = np.repeat(problem.position[:1], problem.steps, 0)
    return replace(problem, active=np.ones_like(problem.active), position=places)


def test_ankles_rest_on_contacts_and_move_smoothly_between(posed):
    problem, _, _ = posed
    place, velocity = ankles(problem)
    for foot in range(2):
        held = problem.active[:, foot]
        tip = problem.position[:, foot] + problem.rotation[:, foot] @ problem.tip_in_contact[foot]
        np.testing.assert_allclose(place[:-1, foot][held], tip[held])
        assert not velocity[:-1, foot][held].any()
    # by the differences of neighbours, whose middle is half a step away
    middle = np.diff(place, axis=0) / problem.dt[:, None, None]
    np.testing.assert_allclose(middle, (velocity[1:] + velocity[:-1]) / 2, atol=0.02)


def test_a_body_that_moves_as_a_whole_does_not_turn(walker, posed):
    problem, _, com = posed
    still = replace(
        problem, active=np.ones_like(problem.active), position=np.repeat(problem.position[:1], problem.steps, 0)
    )
    at = np.repeat(com[None], problem.steps + 1, 0)
    np.testing.assert_allclose(leg_spin(still, walker, at, 0.0 * at), 0.0, atol=1e-12)


def test_legs_turn_as_those_of_the_robot_do(walker, posed):
    """A CoM that moves over resting feet bends the legs; MuJoCo's momentum of the hips' turning is near the formula."""
    problem, _, com = posed
    model, data = walker.mujoco_model, mujoco.MjData(walker.mujoco_model)
    pitch = [walker.joints_to(foot)[index] for foot in walker.legs for index in range(3)]
    data.qpos[:] = walker.home
    mujoco.mj_forward(model, data)
    lateral = np.abs(data.xaxis[1:][pitch] @ [0.0, 1.0, 0.0]) > 0.9
    hips = np.array(pitch)[lateral]
    data.qvel[6 + hips] = -1.0 * np.sign(data.xaxis[1:][hips] @ [0.0, 1.0, 0.0])  # both legs forwards
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    feet = np.array([data.site(walker.limbs[foot].site).id for foot in walker.legs])
    speed = np.zeros(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_SITE, int(feet[0]), speed, 0)
    legs = walker.leg_mass
    line = -legs.line[0, 2]
    still = replace(
        problem, active=np.ones_like(problem.active), position=np.repeat(problem.position[:1], problem.steps, 0)
    )
    at = np.repeat(com[None], problem.steps + 1, 0)
    # seen from the feet, the CoM falls back as fast as the ankles swing forwards, less what the base recoils
    velocity = np.zeros_like(at)
    velocity[:, 0] = -line * (1.0 - 2.0 * legs.first)
    found = walker.mass * leg_spin(still, walker, at, velocity)[0]
    assert found[1] == pytest.approx(data.subtree_angmom[0][1], rel=0.3)
    np.testing.assert_allclose(found[[0, 2]], 0.0, atol=1e-9)


@pytest.fixture(scope="module", params=EVERY)
def robot(request):
    return load_robot(request.param)


def test_weaker_motors_leave_more_to_the_ground(robot):
    shares = [ground_share(replace(robot, torque_limit=part * robot.torque_limit)) for part in (10.0, 1.0, 0.3, 0.01)]
    assert shares[0] == 0.0 and shares[-1] == 1.0
    assert all(0.0 <= first <= second <= 1.0 for first, second in zip(shares, shares[1:], strict=False))


def test_a_weak_body_lets_its_legs_turn(walker, posed):
    """The plan of a body without motors above the legs follows the legs' momentum; that of a strong one has none."""
    _, schedule, com = posed
    strong, weak = (replace(walker, torque_limit=part * walker.torque_limit) for part in (10.0, 0.01))
    motions = [optimise(each, schedule, com, np.zeros(3), config=SequenceConfig()) for each in (strong, weak)]
    assert all(motion.feasible for motion in motions)
    calm, free = (motion.angular_momentum[:, 1] for motion in motions)
    problem, motion = motions[1].problem, motions[1]
    legs = walker.mass * leg_spin(problem, walker, motion.com, motion.linear_momentum / walker.mass)[:, 1]
    assert np.abs(free - legs).max() < 0.6 * np.abs(legs).max() and np.abs(calm).max() < 0.2 * np.abs(legs).max()
