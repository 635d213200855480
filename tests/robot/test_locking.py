"""Frozen joints leave every body where the joint had put it."""

from __future__ import annotations

import itertools

import mujoco
import numpy as np
import pytest

from tests.robot.test_urdf import NASTY
from toolkit.errors import RobotError
from toolkit.robot.locking import lock_joints

POSITIONS = {"z_first": 0.9, "a_second": -0.4, "m_third": 0.17, "k_wrist": -0.8, "b_tail": 1.2}


@pytest.mark.parametrize(
    "locked", [names for size in (1, 2, 3) for names in itertools.combinations(list(POSITIONS)[:3], size)]
    + [("k_wrist",), ("b_tail", "k_wrist"), tuple(POSITIONS)],
)  # fmt: skip
def test_bodies_stay(locked: tuple[str, ...]) -> None:
    """Compared in random positions of the joints that are left, on a body in a frame and on anchors and refs too."""
    model = mujoco.MjModel.from_xml_string(NASTY)
    spec = mujoco.MjSpec.from_string(NASTY)
    lock_joints(spec, {name: POSITIONS[name] for name in locked})
    frozen = spec.compile()
    assert frozen.njnt == model.njnt - len(locked)
    rng = np.random.default_rng(2)
    data, still = mujoco.MjData(model), mujoco.MjData(frozen)
    for _ in range(3):
        for joint in range(1, model.njnt):
            name = model.joint(joint).name
            value = POSITIONS[name] if name in locked else rng.uniform(-0.5, 0.5)
            data.joint(name).qpos[0] = value
            if name not in locked:
                still.joint(name).qpos[0] = value
        mujoco.mj_forward(model, data)
        mujoco.mj_forward(frozen, still)
        np.testing.assert_allclose(still.xpos, data.xpos, atol=1e-12)
        np.testing.assert_allclose(still.xmat, data.xmat, atol=1e-12)
        np.testing.assert_allclose(still.site_xpos, data.site_xpos, atol=1e-12)
        np.testing.assert_allclose(still.subtree_com[1], data.subtree_com[1], atol=1e-12)


def test_nothing_to_lock() -> None:
    spec = mujoco.MjSpec.from_string(NASTY)
    lock_joints(spec, {})
    assert spec.compile().njnt == mujoco.MjModel.from_xml_string(NASTY).njnt


def test_motors_go_with_their_joints() -> None:
    motors = '<actuator><motor joint="a_second"/><motor joint="b_tail"/></actuator></mujoco>'
    spec = mujoco.MjSpec.from_string(NASTY.replace("</mujoco>", motors))
    lock_joints(spec, {"a_second": 0.1})
    assert spec.compile().nu == 1


def test_neighbour_in_a_frame() -> None:
    text = NASTY.replace('<joint name="z_first"', '<frame euler="10 0 0"><joint name="z_first"')
    text = text.replace('<joint name="a_second"', '</frame><joint name="a_second"')
    with pytest.raises(RobotError, match="joint 'z_first' stands in a <frame>"):
        lock_joints(mujoco.MjSpec.from_string(text), {"a_second": 0.1})
