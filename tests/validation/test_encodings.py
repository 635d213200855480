"""The paper's angles say what the axes say."""

import numpy as np

from tests.prediction.test_features import random_case
from toolkit.contacts.category import Category
from toolkit.prediction.features import encode
from validation.encodings import tait_bryan


def test_tait_bryan_angles_give_the_axes_back():
    rng = np.random.default_rng(5)
    stance, com, velocity, transition = random_case(Category.MOVE_ONE_PALM, rng)
    features = encode(stance, com, velocity, [transition])[1]
    yaw, pitch, roll = tait_bryan(features, Category.MOVE_ONE_PALM)[0, 3:6]
    cy, sy, cp, sp, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    np.testing.assert_allclose(features[0, 3:6], [cy * cp, sy * cp, -sp], rtol=0, atol=1e-12)
    expected = [cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr]
    np.testing.assert_allclose(features[0, 6:9], expected, rtol=0, atol=1e-12)
