"""Generated worlds to scale: all lengths alike, and nothing else."""

import numpy as np
import pytest

from toolkit.robot.loader import load_robot
from toolkit.world.generators import KINDS
from toolkit.world.loader import load_world
from toolkit.world.scaling import scale_of, scaled, steepest_tile


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_lengths_scale_and_angles_stay(kind):
    text = KINDS[kind](np.random.default_rng(3))
    whole, half = (load_world(f"{kind}.xml", mjcf=each) for each in (text, scaled(text, 0.5)))
    assert half.goal.position == pytest.approx(0.5 * whole.goal.position, abs=1e-5)
    assert half.goal.radius == pytest.approx(0.5 * whole.goal.radius)
    assert half.timing == whole.timing
    if kind in ("mesh_patches", "training"):  # what counts as one patch, or as covered, is a matter of metres
        return
    ground = [surface for surface in whole.surfaces if surface.serves_foot]
    small = [surface for surface in half.surfaces if surface.serves_foot]
    assert len(ground) == len(small)
    for one, other in zip(ground, small, strict=True):
        assert other.pose.position == pytest.approx(0.5 * one.pose.position, abs=2e-3)
        assert other.pose.normal == pytest.approx(one.pose.normal, abs=1e-3)
        assert other.friction == one.friction


def test_the_scale_follows_the_legs_and_tilts_the_ankles():
    robot = load_robot("humanoid30")
    assert scale_of(robot) == pytest.approx(1.0) and steepest_tile(robot) == pytest.approx(34.4, abs=0.1)
