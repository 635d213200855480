"""What the controller asks of a foot in contact."""

import numpy as np

from toolkit.control.controller import SETTLING, STANCE, Controller
from toolkit.control.sampled_plan import sample_reference
from toolkit.geometry.limb import FEET


def test_feet_in_contact_stop_soonest_along_their_normals(robot, standing):
    """All of the robot moves, sideways and down: its feet are to slow down, and not to bounce."""
    plan, margins = standing.whole, standing.motion.solved.margins
    controller = Controller(robot, plan.scene, sample_reference(np.array([0.0, 0.01]), plan), margins, 0.01)
    qpos, qvel = plan.trajectory.qpos[0].copy(), np.zeros(robot.mujoco_model.nv)
    qvel[:3] = 0.1, -0.05, -0.4
    controller.tick(0, qpos, qvel, np.full(4, 100.0))
    sideways = STANCE.kd / robot.scale.time
    rates = np.array([sideways, sideways, SETTLING])
    for foot in FEET:
        first = 6 + 6 * foot  # rows of the tasks: CoM, angular momentum, then the feet
        wanted = controller._wanted[first : first + 3] / STANCE.weight**0.5 + controller.dynamics.drift[foot, :3]
        np.testing.assert_allclose(wanted, -rates * qvel[:3], rtol=1e-6, atol=1e-6)
