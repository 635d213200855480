import numpy as np
import pytest
import shapely

from toolkit.contacts.projected import Projected
from toolkit.contacts.seats import Seats, laid
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose, rotation_on_surface
from toolkit.world.relief import off_relief
from toolkit.world.surface import Surface
from toolkit.world.timing import Timing

HALF = np.array([0.11, 0.065])
RING = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
NORMAL = np.array([0.1, -0.2, 1.0]) / np.linalg.norm([0.1, -0.2, 1.0])
PLANE = Pose(rotation_on_surface(NORMAL, 0.7), np.array([2.0, 1.0, 0.3]))


def soles_on(relief, places, turn=0.4):
    """Soles (n,) that were projected at places (n, 2) of the plane, laid on the ground of a relief."""
    surface = Surface(0, "hill", PLANE, (RING,), (RING,), 0.5, True, False, np.asarray(relief, float))
    rotation = PLANE.rotation @ Pose.from_yaw(np.zeros(3), turn).rotation
    position = PLANE @ np.column_stack([places, np.zeros(len(places))])
    patches = Projected(np.zeros(len(places), int), position, np.tile(rotation, (len(places), 1, 1)))
    return Seats([surface]).lay(patches, HALF)


def above(relief, patches, row):
    """(k,) m by which a grid of points of a sole is above the ground."""
    grid = np.stack(np.meshgrid(*(np.linspace(-half, half, 21) for half in HALF)), axis=-1).reshape(-1, 2)
    points = Pose(patches.rotation[row], patches.position[row]) @ np.column_stack([grid, np.zeros(len(grid))])
    return off_relief(np.asarray(relief, float), PLANE.inverse() @ points)


@pytest.mark.parametrize(
    "curves",
    [(-0.25, 0.0, -0.2), (0.3, 0.0, 0.2), (0.25, 0.1, -0.2), (0.0, 0.3, 0.0)],
    ids=["crest", "hollow", "saddle", "twisted"],
)
def test_a_sole_touches_the_ground_and_is_nowhere_in_it(curves):
    relief = [0.001, 0.01, -0.02, *curves]
    places = np.random.default_rng(0).uniform(-0.15, 0.15, (30, 2))
    patches = soles_on(relief, places)
    for row in range(len(places)):
        gap = above(relief, patches, row)
        assert gap.min() == pytest.approx(0.0, abs=1e-4)
        np.testing.assert_allclose(patches.rotation[row].T @ patches.rotation[row], np.eye(3), atol=1e-12)
        assert shapely.Point(PLANE.inverse() @ patches.position[row]).distance(shapely.Point(places[row])) < 1e-3


def test_soles_on_flat_ground_stay_as_they_are():
    places = np.random.default_rng(1).uniform(-0.15, 0.15, (5, 2))
    patches = soles_on(np.zeros(6), places)
    assert (patches.position == PLANE @ np.column_stack([places, np.zeros(5)])).all()


def test_contacts_that_moved_in_their_planes_are_laid_on_the_ground_again():
    relief = np.array([0.0, 0.0, 0.0, -0.3, 0.1, -0.2])
    hill = Surface(0, "hill", PLANE, (RING,), (RING,), 0.5, True, False, relief)
    flat = Surface(1, "flat", PLANE, (RING,), (RING,), 0.5, True, False)
    feet = [Contact(limb, PLANE, 0.5, 1) for limb in FEET]
    half_sizes = np.tile(HALF, (4, 1))

    def steps(surface, shift):
        moved = Pose(PLANE.rotation, PLANE @ np.array([*shift, 0.0]))
        steps = [ContactTransition(Limb.LEFT_FOOT, Contact(Limb.LEFT_FOOT, moved, 0.5, surface), Timing(0.6, 0.8))]
        return ContactSequence(Stance(tuple(feet)), tuple(steps))

    level = steps(1, (0.1, 0.05))
    assert laid(level, (hill, flat), half_sizes) is level
    sequence = steps(0, (0.1, 0.05))
    (transition,) = laid(sequence, (hill, flat), half_sizes).transitions
    pose = transition.contact.pose
    patch = Projected(np.zeros(1, int), pose.position[None], pose.rotation[None])
    assert above(relief, patch, 0).min() == pytest.approx(0.0, abs=1e-4)
    assert np.degrees(np.arccos(pose.normal @ PLANE.normal)) > 1.0
    again = laid(ContactSequence(sequence.start, (transition,)), (hill, flat), half_sizes).transitions[0].contact.pose
    np.testing.assert_allclose(again.matrix, pose.matrix, atol=1e-6)
