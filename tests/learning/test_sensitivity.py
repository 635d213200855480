"""Derivatives of the objective: in the form that networks see, along what transitions can do, and for older data."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from tests.centroidal.test_sensitivity import varied
from tests.prediction.test_features import mirrored, moved, random_case
from toolkit.centroidal.fast import Sensitivity
from toolkit.contacts.category import Category
from toolkit.errors import DatasetError
from toolkit.geometry.pose import Pose, rotation_about_z
from toolkit.learning.dataset import Manifest, Samples, join, read_manifest, read_shard, shard_path, write_shard
from toolkit.learning.differentiate import differentiate, sensitivities
from toolkit.learning.label import label
from toolkit.learning.sensitivity import canonical, decode, sensitivity_size
from toolkit.prediction.features import TARGETS, encode, feature_size
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
    from toolkit.learning.tangent import TangentSpace

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
def test_features_are_decoded(category):
    _, features = encode(*(case := random_case(category, np.random.default_rng(int(category))))[:3], [case[3]])
    stance, com, velocity, transition = decode(features[0], category)
    np.testing.assert_allclose(encode(stance, com, velocity, [transition])[1], features, rtol=0, atol=1e-12)


def labelled(robot, category, count, seed=0):
    """Samples of a category, and the same as they were stored before derivatives were."""
    rng, groups = np.random.default_rng(seed), []
    for _ in range(count):
        s = sample_transition(robot, category, rng, SamplingConfig(speed_spread=0.2, step_spread=0.8))
        labels = label(robot, s.stance, s.com[None], s.com_velocity[None], [s.transition])
        frame, features = encode(s.stance, s.com, s.com_velocity, [s.transition])
        targets = np.zeros((1, TARGETS), np.float32)
        targets[0, 0] = labels.objective[0] if labels.feasible[0] else 0.0
        known = np.full((1, sensitivity_size(category)), np.nan, np.float32)
        if labels.sensitivity[0] is not None:
            known[0] = canonical(frame, category, labels.sensitivity[0])
        groups.append(Samples(features.astype(np.float32), labels.feasible, targets, known))
    new = join(groups, category)
    return new, replace(new, sensitivity=None)


@pytest.mark.parametrize("category", [Category.MOVE_FOOT, Category.BREAK_ONE_PALM, Category.MOVE_OUTER_FOOT_WITH_PALM])
def test_older_samples_get_the_same_derivatives(robot, category):
    new, old = labelled(robot, category, 30)
    found = sensitivities(robot, category, old)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(new.sensitivity))
    good = np.flatnonzero(~np.isnan(found[:, 0]))
    assert len(good) > 5
    error = np.linalg.norm(found[good] - new.sensitivity[good], axis=1)
    # Single precision moves the solver's iterates within its tolerance.
    assert np.median(error / np.linalg.norm(new.sensitivity[good], axis=1)) < 2e-3


def test_labels_of_something_else_are_refused(robot):
    _, old = labelled(robot, Category.MOVE_FOOT, 20)
    old.targets[:, 0] *= 1.5
    with pytest.raises(
        DatasetError, match="another objective for .* transitions than is stored; collect the data again"
    ):
        sensitivities(robot, Category.MOVE_FOOT, old)


def test_a_data_set_is_differentiated_once(tmp_path, robot):
    new, old = labelled(robot, Category.MOVE_FOOT, 12)
    Manifest("transition-data-1", robot.name, robot.fingerprint, 0, {}, {}).write(tmp_path)
    with pytest.raises(DatasetError, match="holds no shards"):
        differentiate(tmp_path, robot, ThreadPoolExecutor(1))
    write_shard(tmp_path, 0, {Category.MOVE_FOOT: old})
    write_shard(tmp_path, 7, {Category.MOVE_FOOT: new})
    assert read_manifest(tmp_path).schema == "transition-data-1"
    assert read_shard(shard_path(tmp_path, 0))[Category.MOVE_FOOT].sensitivity is None
    seen = []
    with ThreadPoolExecutor(1) as pool:
        assert differentiate(tmp_path, robot, pool, lambda *state: seen.append(state)) == 1
        assert differentiate(tmp_path, robot, pool) == 0
        with pytest.raises(DatasetError, match="collected for another robot"):
            differentiate(tmp_path, replace(robot, fingerprint="other"), pool)
    assert seen == [(1, 2), (2, 2)]
    first, second = (read_shard(shard_path(tmp_path, index))[Category.MOVE_FOOT] for index in (0, 7))
    np.testing.assert_array_equal(np.isnan(first.sensitivity), np.isnan(second.sensitivity))
    both = join([old, second], Category.MOVE_FOOT)
    assert np.isnan(both.sensitivity[: len(old)]).all() and len(both) == 2 * len(old)
    write_shard(tmp_path, 7, {Category.MOVE_FOOT: replace(new, sensitivity=new.sensitivity[:, 1:])})
    with pytest.raises(DatasetError, match="has shapes"):
        read_shard(shard_path(tmp_path, 7))
