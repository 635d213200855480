"""The folder of a short walk as `validate` writes it."""

import numpy as np
import pytest

from toolkit.exchange.record import read_run
from toolkit.pipeline import Candidate, PipelineConfig, PipelineResult, Source, Trial
from toolkit.report.run import RunOptions, write_run
from toolkit.search.costs.plan_cost import plan_cost
from toolkit.search.result import SearchResult, Solution


def write_walk(folder, plan, execution):
    sequence = plan.sequence
    count = len(sequence.transitions)
    zero = np.zeros((count + 1, 3))
    solution = Solution(sequence, 1.0, 1.0, 0.1, zero, zero, np.zeros(count))
    search = SearchResult((solution,), 0.1, 0.0, 1, False, zero, "")
    config, whole = PipelineConfig(), plan.whole
    candidate = Candidate(0, Source.SEARCH, 0, 0.1, solution, whole, plan_cost(whole, config.cost), None)
    trial = Trial(candidate, whole, execution, execution.failure)
    result = PipelineResult(plan.robot, plan.world, config, search, trial, (candidate,), (trial,), "")
    write_run(folder, result, RunOptions(recording=False))


@pytest.fixture(scope="session")
def run_folder(walking, walked, tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "walk"
    folder.mkdir()
    write_walk(folder, walking, walked)
    return folder


@pytest.fixture(scope="session")
def record(run_folder):
    return read_run(run_folder)
