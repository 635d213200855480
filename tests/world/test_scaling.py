"""Terrain to the scale of a robot."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from toolkit import terrain
from toolkit.geometry.limb import FEET
from toolkit.robot.loader import default_robot, load_robot
from toolkit.world.generators import KINDS
from toolkit.world.loader import load_world
from toolkit.world.scaling import Fit, fitted


def with_legs(robot, factor, roll):
    legs = {
        foot: replace(
            leg,
            thigh=factor * leg.thigh,
            shin=factor * leg.shin,
            ranges=leg.ranges | {"ankle_roll": (-roll, roll)},
        )
        for foot, leg in robot.legs.items()
    }
    return replace(robot, legs=legs)


def test_the_usual_body_gets_the_usual_worlds():
    robot = load_robot(None)
    assert Fit.of(robot).factor == 1.0 and Fit.of(robot).tilt > 20
    for generator in KINDS.values():
        text = fitted(generator, np.random.default_rng(3), Fit.of(robot), {})
        assert text == generator(np.random.default_rng(3))


@pytest.mark.parametrize("kind", KINDS)
def test_lengths_follow_the_legs(kind):
    texts = [fitted(KINDS[kind], np.random.default_rng(3), Fit(factor), {}) for factor in (1.0, 0.6)]
    usual, small = (mujoco.MjModel.from_xml_string(text) for text in texts)
    drawn = usual.geom_type != mujoco.mjtGeom.mjGEOM_PLANE
    for name in ("geom_pos", "geom_aabb"):
        scaled, expected = (getattr(model, name)[drawn] for model in (small, usual))
        np.testing.assert_allclose(scaled, 0.6 * expected, atol=3e-6)  # six decimals in the file
    np.testing.assert_allclose(small.geom_quat, usual.geom_quat, atol=1e-6)
    np.testing.assert_allclose(small.site_pos, 0.6 * usual.site_pos, atol=2e-6)
    worlds = [load_world("world.xml", mjcf=text) for text in texts]
    if worlds[0].timing is None:
        assert worlds[1].timing is None
    else:
        assert worlds[1].timing.swing == pytest.approx(np.sqrt(0.6) * worlds[0].timing.swing, abs=1e-3)
    assert worlds[1].goal.radius == pytest.approx(0.6 * worlds[0].goal.radius) and worlds[1].surfaces


def test_tiles_are_no_steeper_than_ankles_follow_unless_asked_for():
    robot = with_legs(load_robot(None), 0.7, 0.262)
    fit = Fit.of(robot)
    assert (fit.factor, fit.tilt) == (0.7, 9.0)

    def steepest(given):
        world = load_world("field.xml", mjcf=fitted(KINDS["rubble_field"], np.random.default_rng(0), fit, given))
        return max(np.degrees(np.arccos(surface.pose.normal[2])) for surface in world.surfaces)

    assert 5.0 < steepest({}) < 9.0 * np.sqrt(2) < 15.0 < steepest({"tilt": 20.0})
    text = fitted(KINDS["rubble_field"], np.random.default_rng(0), fit, {"swing": 1.0})
    assert load_world("field.xml", mjcf=text).timing.swing == 1.0


def test_stones_hold_the_soles_of_short_legs_with_long_feet():
    usual, short = load_robot(None), with_legs(load_robot(None), 0.3, 0.4)
    assert Fit.of(usual).edge == pytest.approx(0.22 + 0.05) and Fit.of(short).edge == pytest.approx(0.22 + 0.3 * 0.05)

    def widths(robot, given):
        text = fitted(KINDS["stepping_stones"], np.random.default_rng(0), Fit.of(robot), given)
        world = load_world("stones.xml", mjcf=text)
        return [np.ptp(each.boundary[0], axis=0).min() for each in world.surfaces if "stone" in each.geom]

    assert min(widths(usual, {})) == pytest.approx(0.36, abs=1e-3)
    assert min(widths(short, {})) == pytest.approx(0.235, abs=1e-3)
    assert min(widths(short, {"stone": 0.36})) == pytest.approx(0.3 * 0.36, abs=1e-3)


def test_the_command(tmp_path, capsys):
    assert terrain.main(["stairs", "--robot", default_robot()]) == 0
    with_robot = capsys.readouterr().out
    assert terrain.main(["stairs"]) == 0
    assert capsys.readouterr().out == with_robot
    assert all(foot in load_robot(None).legs for foot in FEET)
