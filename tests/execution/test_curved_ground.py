"""Smooth hills, from world to verdict."""

import numpy as np
import pytest

from toolkit.centroidal.problem import GRAVITY
from toolkit.pipeline import PipelineConfig, make_planner, run
from toolkit.robot.loader import load_robot
from toolkit.world.authoring import WorldText
from toolkit.world.loader import load_world

SPACING = 0.05  # m


@pytest.mark.slow
@pytest.mark.parametrize("name", ["humanoid30", "g1"])
def test_smooth_hills_are_walked(name, tmp_path):
    """Waves of 5 cm that are 3 m long, walked by two robots; under start and goal the ground is level."""
    x, y = np.arange(-3.0, 3.0, SPACING), np.arange(-1.5, 1.5, SPACING)
    grid_x, grid_y = np.meshgrid(x, y, indexing="ij")
    level = np.ones_like(grid_x)
    for middle in (-2.4, 2.4):
        level -= 1.0 / (1.0 + np.exp((np.hypot(grid_x - middle, grid_y) - 0.6) / 0.08))
    heights = 0.05 * level * np.sin(2 * np.pi * grid_x / 3.0) * np.cos(2 * np.pi * grid_y / 3.0)
    text = WorldText("hills", "smooth hills", 0.8, None, (2.4, 0.0, 0.0), start=(-2.4, 0.0, 0.0), abyss=-1.0)
    text.height_field("hills", heights, SPACING, (x[0], y[0]))
    world = load_world(tmp_path / "hills.xml", mjcf=text.render())
    assert min(surface.bearing for surface in world.surfaces) < 0.065
    robot = load_robot(name)
    result = run(robot, world, make_planner(robot, world), PipelineConfig(seed=0))
    assert result.passed, result.reason
    assert any(contact.bearing < 0.1 for contact in result.trial.plan.sequence.contacts)
    weight = robot.mass * -GRAVITY[2]
    assert result.trial.execution.samples.wrench[2, :, 2].sum() == pytest.approx(weight, rel=0.1)  # it begins settled
