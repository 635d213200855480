import numpy as np
import pytest
import shapely

from toolkit.contacts.projected import Projected
from toolkit.contacts.seats import Seats
from toolkit.geometry.pose import Pose, rotation_on_surface
from toolkit.world.relief import off_relief
from toolkit.world.surface import Surface

HALF = np.array([0.11, 0.065])
RING = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
NORMAL = np.array([0.1, -0.2, 1.0]) / np.linalg.norm([0.1, -0.2, 1.0])
PLANE = Pose(rotation_on_surface(NORMAL, 0.7), np.array([2.0, 1.0, 0.3]))


def laid(relief, places, turn=0.4):
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
    patches = laid(relief, places)
    for row in range(len(places)):
        gap = above(relief, patches, row)
        assert gap.min() == pytest.approx(0.0, abs=1e-4)
        np.testing.assert_allclose(patches.rotation[row].T @ patches.rotation[row], np.eye(3), atol=1e-12)
        assert shapely.Point(PLANE.inverse() @ patches.position[row]).distance(shapely.Point(places[row])) < 1e-3


def test_soles_on_flat_ground_stay_as_they_are():
    places = np.random.default_rng(1).uniform(-0.15, 0.15, (5, 2))
    patches = laid(np.zeros(6), places)
    assert (patches.position == PLANE @ np.column_stack([places, np.zeros(5)])).all()
