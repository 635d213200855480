"""Features: the canonical form hides where, how turned and on which side a transition happens, and nothing else."""

import numpy as np
import pytest

from toolkit.contacts.category import Category, category_of
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose, rotation_about_z
from toolkit.prediction.features import MIRROR, ahead, encode, feature_size
from toolkit.world.timing import Timing

REFLECT = np.diag(MIRROR)


def random_rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else q[:, [1, 0, 2]]


def random_case(category, rng):
    """A stance, CoM, velocity and transition of a category, moving a left limb."""

    def contact(limb):
        return Contact(limb, Pose(random_rotation(rng), rng.normal(size=3)), 0.5)

    moving = category.moving
    stance = Stance(tuple(contact(limb) for limb in category.before))
    transition = ContactTransition(moving, contact(moving) if category.makes else None, Timing(0.7, 0.4))
    return stance, rng.normal(size=3), rng.normal(size=3), transition


def moved(case, world_from_old):
    stance, com, velocity, transition = case

    def contact(old):
        return Contact(old.limb, world_from_old @ old.pose, old.friction)

    return (
        Stance(tuple(contact(item) for item in stance.contacts)),
        world_from_old @ com,
        world_from_old.rotation @ velocity,
        ContactTransition(transition.limb, transition.contact and contact(transition.contact), transition.timing),
    )


def mirrored(case):
    """The whole case reflected in y: positions, and frames so that y stays right-handed."""
    stance, com, velocity, transition = case

    def contact(old):
        rotation = REFLECT @ old.pose.rotation @ REFLECT
        return Contact(old.limb.mirrored, Pose(rotation, REFLECT @ old.pose.position), old.friction)

    return (
        Stance(tuple(sorted((contact(item) for item in stance.contacts), key=lambda item: item.limb))),
        REFLECT @ com,
        REFLECT @ velocity,
        ContactTransition(
            transition.limb.mirrored, transition.contact and contact(transition.contact), transition.timing
        ),
    )


@pytest.mark.parametrize("category", list(Category))
def test_features_do_not_depend_on_place_heading_or_side(category):
    rng = np.random.default_rng(int(category))
    case = random_case(category, rng)
    assert category_of(case[0], case[3]) == category
    frame, features = encode(*case[:3], [case[3]])
    assert features.shape == (1, feature_size(category))
    change = Pose(rotation_about_z(1.3), np.array([3.0, -2.0, 0.4]))
    for other in (moved(case, change), mirrored(case), moved(mirrored(case), change)):
        assert category_of(other[0], other[3]) == category
        np.testing.assert_allclose(encode(*other[:3], [other[3]])[1], features, rtol=0, atol=1e-12)
    # The way back restores points and directions.
    points = rng.normal(size=(5, 3))
    np.testing.assert_allclose(frame.point_back(frame.point(points)), points, rtol=0, atol=1e-12)
    np.testing.assert_allclose(frame.vector_back(frame.vector(points)), points, rtol=0, atol=1e-12)


def test_every_input_of_the_optimiser_changes_the_features():
    rng = np.random.default_rng(3)
    stance, com, velocity, transition = random_case(Category.MOVE_FOOT, rng)
    base = encode(stance, com, velocity, [transition])[1]
    other = ContactTransition(transition.limb, transition.contact, Timing(0.7, 0.5))
    lower = Contact(Limb.RIGHT_FOOT, stance[Limb.RIGHT_FOOT].pose, 0.3)
    for changed in (
        encode(stance, com + 0.01, velocity, [transition]),
        encode(stance, com, velocity + 0.01, [transition]),
        encode(stance, com, velocity, [other]),
        encode(stance.replace(lower), com, velocity, [transition]),
    ):
        assert not np.allclose(changed[1], base)


def test_the_goal_is_seen_as_a_direction_that_shortens_on_arrival():
    way = np.array([[3.0, 4.0, 7.0], [0.0, -0.3, 0.0], [0.0, 0.0, 1.0], [1e9, 0.0, 0.0]])
    seen = ahead(way, 0.3)
    np.testing.assert_allclose(seen[0], 4.7 / 5.2 * np.array([0.6, 0.8]), rtol=1e-12)
    np.testing.assert_array_equal(seen[1:3], 0.0)  # within the region
    np.testing.assert_allclose(seen[3], [1.0, 0.0], rtol=0, atol=1e-8)
    np.testing.assert_array_equal(ahead(way, np.full(4, 0.3)), seen)


def test_a_mirrored_goal_is_seen_mirrored():
    case = random_case(Category.MOVE_FOOT, np.random.default_rng(7))
    goal = np.array([1.0, 2.0, 3.0])
    seen = [
        ahead(encode(*item[:3], [item[3]])[0].point(place))
        for item, place in (
            (case, goal),
            (mirrored(case), REFLECT @ goal),
        )
    ]
    np.testing.assert_allclose(*seen, rtol=0, atol=1e-12)


def test_transitions_of_two_limbs_are_refused():
    rng = np.random.default_rng(4)
    stance, com, velocity, transition = random_case(Category.MOVE_FOOT, rng)
    right = ContactTransition(Limb.RIGHT_FOOT, Contact(Limb.RIGHT_FOOT, transition.contact.pose, 0.5))
    with pytest.raises(ValueError, match="share their limb and category"):
        encode(stance, com, velocity, [transition, right])
