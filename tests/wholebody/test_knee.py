import numpy as np
import pytest

from tests.robot.samples import TOML, biped_mjcf, write_robot
from toolkit.geometry.limb import FEET
from toolkit.robot.loader import load_robot
from toolkit.wholebody.ik import knee_range

KNEE = 'axis="0 1 0" range="0.0 2.4"'


@pytest.mark.parametrize("sign, offset", [(1, 0.0), (1, -0.2), (-1, 0.0), (-1, 0.3)])
def test_least_flexion_whichever_way_the_knee_turns(tmp_path, sign, offset):
    low, high = sorted(sign * limit + offset for limit in (0.0, 2.4))
    model = biped_mjcf().replace(KNEE, f'axis="0 {sign} 0" range="{low} {high}" ref="{offset}"')
    toml = TOML.replace('"*_knee" = 0.7', f'"*_knee" = {sign * 0.7 + offset}')
    robot = load_robot(write_robot(tmp_path / "biped", model, toml))
    for foot in FEET:
        joint, lower, upper = knee_range(robot, foot, 0.1)
        assert robot.joint_names[joint] == f"{foot.label.removesuffix('_foot')}_knee"
        expected = sorted(sign * flexion + offset for flexion in (0.1, 2.4))
        np.testing.assert_allclose([lower, upper], expected, rtol=0.0, atol=1e-6)
