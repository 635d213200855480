"""`--timing auto` with trained networks: slow where that is possible, quick where only that leads on."""

from pathlib import Path

import numpy as np
import pytest

from tests.search.worlds import FLOOR, box, make_world
from toolkit.cli import AUTO_TIMINGS
from toolkit.pipeline import make_planner
from toolkit.robot.loader import load_robot
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.planner import PlannerConfig

TRAINED = sorted(path.parent.name for path in Path("robots").glob("*/networks"))


def swings(name, world):
    config = PlannerConfig(timings=AUTO_TIMINGS, search=AnaStarConfig(max_expansions=400))
    result = make_planner(load_robot(name), world, "learned", config).search(np.random.default_rng(0), 120.0)
    assert result.solutions and not result.warning
    return np.array([transition.timing.swing for transition in result.solutions[-1].sequence.transitions])


@pytest.mark.slow
@pytest.mark.parametrize("name", TRAINED)
def test_walks_slowly_on_level_ground_and_not_on_a_steep_slope(name):
    quick = min(timing.swing for timing in AUTO_TIMINGS)
    assert (swings(name, make_world(FLOOR, goal=(1.2, 0, 0))) > quick).all()
    steep = box([0.82, 0, -0.2887], [0.577, 0.6, 0.02], (0, 30, 0), friction=0.5)  # 1 m across, nobody rests on it
    lower = box([2.4, 0, -0.62], [1.0, 0.6, 0.02], friction=0.5)
    slope = make_world(box([-0.1, 0, -0.02], [0.42, 0.6, 0.02], friction=0.5), steep, lower, goal=(2.4, 0, -0.6))
    chosen = swings(name, slope)
    assert len(set(chosen.tolist())) > 1 or (chosen < max(timing.swing for timing in AUTO_TIMINGS)).all()
