"""The paper's angles say what the axes say, and the goal is seen from the feet."""

import numpy as np

from tests.prediction.test_features import random_case
from toolkit.contacts.category import Category
from toolkit.learning.samples import Samples
from toolkit.prediction.features import encode
from validation.encodings import NEARBY, tait_bryan, with_goal


def test_tait_bryan_angles_give_the_axes_back():
    rng = np.random.default_rng(5)
    stance, com, velocity, transition = random_case(Category.MOVE_ONE_PALM, rng)
    features = encode(stance, com, velocity, [transition])[1]
    yaw, pitch, roll = tait_bryan(features, Category.MOVE_ONE_PALM)[0, 3:6]
    cy, sy, cp, sp, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    np.testing.assert_allclose(features[0, 3:6], [cy * cp, sy * cp, -sp], rtol=0, atol=1e-12)
    expected = [cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr]
    np.testing.assert_allclose(features[0, 6:9], expected, rtol=0, atol=1e-12)


def test_the_goal_has_a_direction_and_a_distance_that_ends():
    goal = np.array([[3.0, 4.0, 0.2], [0.0, -0.3, 0.0], [0.0, 0.0, 0.0]], np.float32)
    features = np.arange(6, dtype=np.float32).reshape(3, 2)
    samples = Samples(features, np.ones(3, bool), np.ones((3, 7), np.float32), goal, np.zeros(3, np.int32))
    seen = with_goal(samples).features
    np.testing.assert_array_equal(seen[:, 3:], features)
    expected = [[0.6, 0.8, NEARBY], [0.0, -1.0, 0.3], [0.0, 0.0, 0.0]]
    np.testing.assert_allclose(seen[:, :3], expected, atol=1e-6)
