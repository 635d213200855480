"""Derivatives of the objective: in the form that networks see, along what transitions can do; features decoded."""

import numpy as np
import pytest

from tests.centroidal.test_sensitivity import varied
from tests.prediction.test_features import mirrored, moved, random_case
from toolkit.centroidal.fast import Sensitivity
from toolkit.contacts.category import Category
from toolkit.geometry.pose import Pose, rotation_about_z
from toolkit.learning.label import label, samples_of
from toolkit.learning.samples import join
from toolkit.learning.sensitivity import canonical, decode, sensitivity_size
from toolkit.prediction.features import encode, feature_size
from toolkit.robot.loader import load_robot
from validation.random_contacts import SamplingConfig, sample_transition

STEP = 1e-6


@pytest.fixture(scope="module")
def robot():
    return load_robot(None)


@pytest.mark.parametrize("category", list(Category))
@pytest.mark.parametrize("mirror", [False, True])
def test_what_changes_in_the_world_is_what_changes_in_the_features(category, mirror):
    torch = pytest.importorskip("torch")
    from toolkit.learning.tasks import TangentSpace

    rng = np.random.default_rng(int(category))
    case = moved(random_case(category, rng), Pose(rotation_about_z(0.8), rng.normal(size=3)))
    case = mirrored(case) if mirror else case
    factors = rng.normal(size=feature_size(category))

    def function(features):
        return np.sin(features @ factors)

    # Derivatives in the world of a function of the features.
    pairs = [[varied(case, k, sign * STEP) or case for sign in (-1, 1)] for k in range(39)]
    values = [[function(encode(*c[:3], [c[3]])[1])[0] for c in pair] for pair in pairs]
    world = np.diff(values)[:, 0] / (2 * STEP)
    frame, features = encode(*case[:3], [case[3]])
    seen = canonical(frame, category, Sensitivity(world[:30].reshape(5, 6), world[30:]))
    assert seen.shape == (sensitivity_size(category),)
    # The same from the function's gradient in the features.
    spread = torch.from_numpy(rng.uniform(0.5, 2.0, (20, feature_size(category))))
    space, rows = TangentSpace(spread), torch.from_numpy(features)
    gradient = torch.from_numpy(np.cos(features @ factors)[:, None] * factors)
    found, expected = space.of_gradient(rows, gradient), space.of_sensitivity(rows, torch.from_numpy(seen)[None])
    scale = np.abs(expected.numpy()).max()
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-4 * scale)  # of the differences
    np.testing.assert_raises(
        AssertionError, np.testing.assert_allclose, found, -expected.numpy(), rtol=0, atol=1e-2 * scale
    )


@pytest.mark.parametrize("category", list(Category))
@pytest.mark.parametrize("mirror", [False, True])
def test_features_are_decoded(category, mirror):
    _, features = encode(*(case := random_case(category, np.random.default_rng(int(category))))[:3], [case[3]])
    stance, com, velocity, transition = decode(features[0], category, mirrored=mirror)
    assert transition.limb.is_left != mirror
    np.testing.assert_allclose(encode(stance, com, velocity, [transition])[1], features, rtol=0, atol=1e-12)


def labelled(robot, category, count, seed=0):
    """Random samples of a category."""
    rng, groups = np.random.default_rng(seed), []
    for _ in range(count):
        s = sample_transition(robot, category, rng, SamplingConfig(speed_spread=0.2, step_spread=0.8))
        labels = label(robot, s.stance, s.com[None], s.com_velocity[None], [s.transition])
        groups.append(samples_of(s.stance, s.com[None], s.com_velocity[None], [s.transition], labels))
    return join(groups)
