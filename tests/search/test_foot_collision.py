"""Feet that are wider than their soles keep off what stands beside these."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.search.worlds import FLOOR, box, make_world
from toolkit.robot.scale import USUAL
from toolkit.search.moves.foot_collision import FootCollision

HALF = np.array([[0.11, 0.065]] * 4)


def robot(overhang):
    return SimpleNamespace(scale=USUAL, half_sizes=HALF, foot_outline=HALF[0] + overhang)


def hits(world, *places):
    feet = FootCollision.of(robot(0.02), world)  # pyright: ignore[reportArgumentType]
    assert feet is not None
    return feet.hits(np.array(places, float), np.tile(np.eye(3), (len(places), 1, 1))).tolist()


def test_feet_within_their_soles_and_the_margin_need_no_check():
    world = make_world(FLOOR)
    assert FootCollision.of(robot(0.01), world) is None  # pyright: ignore[reportArgumentType]
    assert FootCollision.of(robot(0.02), world) is not None  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(("height", "touches"), [(0.1, True), (0.005, False), (-0.02, False)])
def test_what_rises_beside_a_sole_is_touched_by_the_foot(height, touches):
    """A step whose edge is 0.125 m ahead: the sole of 0.11 m has room, the foot of 0.13 m has it 1 cm behind."""
    world = make_world(FLOOR, box([0.325, 0, height - 0.05], [0.2, 0.5, 0.05]))
    assert hits(world, [0, 0, 0], [-0.01, 0, 0], [-0.2, 0, 0]) == [touches, False, False]


def test_an_edge_that_leans_over_the_neighbour_is_seen():
    """The top of a tilted tile begins farther away than its lower edge, which the foot meets."""
    tile = box([0.32, 0, -0.04], [0.2, 0.3, 0.03], (0, 25, 0))
    assert hits(make_world(FLOOR, tile), [0, 0, 0], [-0.2, 0, 0]) == [True, False]
