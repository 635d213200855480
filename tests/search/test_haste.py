"""Haste: states that run ahead of their feet wait, slow ones do not."""

import numpy as np
import pytest

from toolkit.contacts.stance import Contact
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.search.anytime.open_list import OpenList
from toolkit.search.costs.delay import Haste
from toolkit.search.states.contact_table import ContactTable


@pytest.fixture
def standing() -> tuple[ContactTable, np.ndarray]:
    table = ContactTable(np.array([0.5]))
    numbers = [
        table.add_contact(Contact(limb, Pose.from_yaw(np.array([x, y, 0.0]), 0.0), 0.5, 0))
        for limb, x, y in ((Limb.LEFT_FOOT, 0.3, 0.1), (Limb.RIGHT_FOOT, 0.0, -0.1))
    ]
    return table, np.array([[*numbers, -1, -1]])


def delay(standing, com, velocity, *, forced=0.5):
    table, contacts = standing
    haste = Haste(table, 0.9, forced, 5.0)
    return haste.delay(contacts, np.array([com]), np.array([velocity]))[0]


def test_rest_is_not_delayed(standing):
    assert delay(standing, [0.1, 0.0, 0.9], [0.0, 0.0, 0.0]) == 0.0


def test_faster_waits_longer_whichever_way_it_goes(standing):
    for way in ([1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]):
        delays = [delay(standing, [0.1, 0.0, 0.9], speed * np.array(way)) for speed in (0.2, 0.8, 1.6)]
        assert 0.0 < delays[0] < delays[1] < delays[2]


def test_capture_point_counts_from_the_foremost_foot(standing):
    w = np.sqrt(9.81 / 0.9)
    ahead = 0.25 + 0.6 / w - 0.3
    expected = 5.0 * ahead
    assert delay(standing, [0.25, 0.0, 0.9], [0.6, 0.0, 0.0], forced=0.0) == pytest.approx(expected, rel=1e-12)
    assert delay(standing, [0.0, 0.0, 0.9], [0.6, 0.0, 0.0], forced=0.0) == 0.0


def test_going_on_at_the_forced_acceleration_pays(standing):
    """A metre further on v^2 is larger by 2 a: less delay than the h that the metre is worth."""
    before = delay(standing, [0.0, 0.0, 0.9], [1.0, 0.0, 0.0], forced=0.7)
    after = delay(standing, [0.0, 0.0, 0.9], [np.sqrt(1.0 + 2 * 0.7), 0.0, 0.0], forced=0.7)
    assert 0.0 < after - before < 5.0


def test_without_forced_acceleration_speed_alone_is_no_haste(standing):
    assert delay(standing, [0.0, 0.0, 0.9], [0.3, 0.0, 0.0], forced=0.0) == 0.0


@pytest.mark.parametrize("left, right", [(0.4, 0.0), (0.0, -0.4), (np.pi - 0.1, 0.3 - np.pi)])
def test_turn_between_the_feet_waits_whichever_way(left, right):
    table = ContactTable(np.array([0.5]))
    feet = ((Limb.LEFT_FOOT, 0.1, left), (Limb.RIGHT_FOOT, -0.1, right))
    numbers = [table.add_contact(Contact(i, Pose.from_yaw(np.array([0.0, y, 0.0]), yaw), 0.5, 0)) for i, y, yaw in feet]
    standing = table, np.array([[*numbers, -1, -1]])
    assert delay(standing, [0.0, 0.0, 0.9], [0.0, 0.0, 0.0]) == pytest.approx(5.0 * 0.5 * 0.4, rel=1e-9)


def test_layers_share_the_random_draws():
    """Of a thousand nodes in one layer and one in another, random draws soon take the one."""
    g, h = [0.0] * 1001, [0.5] * 1000 + [9.5]
    lonely = 0
    for seed in range(20):
        nodes = OpenList(g, h, 1.0)
        for node in range(1001):
            nodes.add(node, float(node))
        rng = np.random.default_rng(seed)
        taken = [nodes.take_random(rng, float) for _ in range(6)]
        assert len(set(taken)) == 6
        assert sorted(node for node in taken if node < 1000) == [node for node in taken if node < 1000]  # best first
        lonely += 1000 in taken
    assert lonely > 15  # 1 - 2^-6 of them on average; uniform draws: 0.6 %


def test_open_list_keeps_what_it_is_told_to_keep():
    h = [0.5, 1.5, 2.5, 3.5]
    nodes = OpenList([0.0] * 4, h, 1.0)
    for node in range(4):
        nodes.add(node, -float(node))
    nodes.reset([0, 2], lambda node: -float(node))
    rng = np.random.default_rng(0)
    assert {nodes.take_random(rng, float), nodes.take_best(float)} == {0, 2}
    assert len(nodes) == 0
