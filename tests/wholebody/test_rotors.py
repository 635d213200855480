"""How joints come to the ends of their ranges when their rotors are heavy."""

from dataclasses import replace

import numpy as np

from toolkit.geometry.limb import FEET
from toolkit.wholebody.ik import WholeBodyIK


def test_heavy_rotors_come_to_the_end_of_a_range_more_slowly(robot):
    heavy = replace(robot, armature=np.where(robot.carrying(FEET), 0.02 * robot.torque_limit, robot.armature))
    assert heavy.rotor_factor > 2.0
    knee = robot.joints_to(FEET[0])[3]

    def room(one):
        ik = WholeBodyIK(one, 0.01)
        ik._set_ranges(one.home[7:], [], set())
        low, high = ik.wrapper.get_joint_limits(one.joint_names[knee])
        return np.array([one.home[7 + knee] - low, high - one.home[7 + knee]])

    np.testing.assert_allclose(room(heavy), room(robot) / heavy.rotor_factor, rtol=1e-6)
