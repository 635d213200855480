"""The sum of predicted objectives against the objective of the whole sequence (the paper's last figure)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy.stats import pearsonr, spearmanr, theilslopes

from toolkit.centroidal.build import initial_com
from toolkit.centroidal.sequence import optimise
from toolkit.contacts.schedule import ContactSchedule
from toolkit.errors import PlanningError
from toolkit.pipeline import make_planner
from toolkit.report.colors import OPTIMISED, unit
from toolkit.robot.model import RobotModel
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.planner import PlannerConfig
from toolkit.world.generators import rubble_corridor, rubble_field
from toolkit.world.loader import load_world

FINAL_REST = 1.0  # s
_GENERATORS = (rubble_field, rubble_corridor)


@dataclass(frozen=True)
class Relation:
    """Sums of predictions and objectives of whole sequences.

    Attributes:
        predicted: (n,) sums over the transitions.
        actual: (n,) objectives of the whole sequences.
        worlds: (n,) name of the kind of world.
        infeasible: sequences left out because the optimiser found no motion.
    """

    predicted: np.ndarray
    actual: np.ndarray
    worlds: tuple[str, ...]
    infeasible: int

    @property
    def pearson(self) -> float:
        """Linear correlation."""
        return float(np.asarray(pearsonr(self.predicted, self.actual))[0])

    @property
    def spearman(self) -> float:
        """Rank correlation."""
        return float(np.asarray(spearmanr(self.predicted, self.actual))[0])

    @property
    def line(self) -> tuple[float, float]:
        """Slope and intercept of a robust fit (Theil and Sen)."""
        slope, intercept = np.asarray(theilslopes(self.actual, self.predicted))[:2]
        return float(slope), float(intercept)


def relation(robot: RobotModel, *, count: int, seed: int, expansions: int = 200) -> Relation:
    """Plan with the networks through random rubble fields and corridors, and optimise what is found.

    Args:
        robot: with networks.
        count: sequences.
        seed: of the worlds and searches.
        expansions: of each search; its cheapest and its costliest sequence count.
    """
    predicted, actual, worlds, infeasible = [], [], [], 0
    number = 0
    while len(actual) < count and number < 5 * count:
        rng = np.random.default_rng([seed, number])
        generator = _GENERATORS[number % 2]
        number += 1
        text = generator(rng, rows=int(rng.integers(1, 6)), shift=1.0, swing=1.0)
        world = load_world(f"{generator.__name__}.xml", mjcf=text)
        config = PlannerConfig(search=AnaStarConfig(max_expansions=expansions))
        try:
            found = make_planner(robot, world, "learned", config).search(rng, np.inf).solutions
        except PlanningError:  # no way through this world
            continue
        for solution in {id(item): item for item in (found[:1] + found[-1:])}.values():
            if len(actual) == count:
                break
            schedule = ContactSchedule.of(solution.sequence, final_rest=FINAL_REST)
            start = initial_com(robot, solution.sequence.start)
            motion = optimise(robot, schedule, start, np.zeros(3))
            if not motion.feasible:
                infeasible += 1
                continue
            predicted.append(float(solution.objective.sum()))
            actual.append(motion.objective)
            worlds.append(generator.__name__)
    return Relation(np.array(predicted), np.array(actual), tuple(worlds), infeasible)


def draw_relation(result: Relation, path: Path) -> None:
    """Write the scatter plot with the robust line and the correlation."""
    figure = Figure(figsize=(6.0, 4.5), layout="constrained")
    axes = figure.subplots()
    for kind, marker in zip(dict.fromkeys(result.worlds), "o^sv", strict=False):
        rows = np.array([world == kind for world in result.worlds])
        axes.scatter(
            result.predicted[rows], result.actual[rows], s=14, marker=marker, alpha=0.6, label=kind.replace("_", " ")
        )
    if len(result.actual) > 1:
        slope, intercept = result.line
        ends = np.array([result.predicted.min(), result.predicted.max()])
        axes.plot(ends, slope * ends + intercept, color=unit(OPTIMISED), label=f"{slope:.2f} x + {intercept:.0f}")
        axes.set_title(
            f"{len(result.actual)} sequences, correlation {result.pearson:.2f} (ranks {result.spearman:.2f})"
        )
    axes.set_xlabel("sum of the predicted objectives of the transitions")
    axes.set_ylabel("objective of the whole sequence")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    FigureCanvasAgg(figure).print_figure(str(path), dpi=110)
