"""carry_out: the stages after the search, for a contact sequence that is known already."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from toolkit.contacts.sequence import ContactSequence
from toolkit.contacts.stance import Contact
from toolkit.errors import InputError, PlanningError
from toolkit.mjcf import warnings_refused
from toolkit.pipeline.candidate import Candidate, Source
from toolkit.pipeline.config import PipelineConfig
from toolkit.pipeline.loop import PipelineResult
from toolkit.pipeline.observer import Observer
from toolkit.pipeline.trial import Tester
from toolkit.robot.model import RobotModel
from toolkit.search.costs.plan_cost import plan_cost
from toolkit.search.result import SearchResult, Solution
from toolkit.world.world import World

# m for a body of the usual size (`toolkit.robot.scale`); a patch farther from its surface was planned for another world
NEAR = 0.02


@warnings_refused("the run", PlanningError)
def carry_out(
    robot: RobotModel,
    world: World,
    solution: Solution,
    config: PipelineConfig,
    observer: Observer | None = None,
    *,
    moves: bool = True,
) -> PipelineResult:
    """Optimise and execute one contact sequence, without any search.

    Args:
        robot: The robot.
        world: The world.
        solution: The contacts as a search proposed them, e.g. from `toolkit.report.plan_file.read_proposal`.
        config: Settings; those of the search are ignored.
        observer: Is told of every stage.
        moves: Whether the optimiser may move landing points (`PipelineConfig.landing`).

    Raises:
        InputError: The contacts are not on the surfaces of this world, or the robot has not the limbs for them.
    """
    _check_fits(solution.sequence, robot, world)
    config = config if moves else replace(config, landing=None)
    tester = Tester(robot, world, config, observer or Observer())
    plan, failure = tester.optimise(solution.sequence)
    candidate = Candidate(0, Source.SEARCH, 0, 0.0, solution, plan, plan_cost(plan, config.cost), failure)
    trial = tester.test(candidate)
    search = SearchResult((solution,), 0.0, 0.0, 0, False, np.zeros((0, 3)), "")
    reason = "" if trial.failure is None else trial.failure.reason
    return PipelineResult(robot, world, config, search, trial, (candidate,), (trial,), reason)


def _check_fits(sequence: ContactSequence, robot: RobotModel, world: World) -> None:
    """Raise InputError unless every contact lies on a surface of the world, with a limb that the robot has."""
    for contact in sequence.start.contacts:
        _check_contact(contact, "start", robot, world)
    for index, transition in enumerate(sequence.transitions):
        if transition.contact is not None:
            _check_contact(transition.contact, f"transitions[{index}]", robot, world)


def _check_contact(contact: Contact, where: str, robot: RobotModel, world: World) -> None:
    """Raise InputError unless this contact fits."""
    label, position = contact.limb.label, contact.pose.position
    if contact.limb not in robot.limbs:
        raise InputError(
            f"{where} has a contact of {label}, which robot {robot.name} does not have; take another robot"
        )
    if contact.surface < 0:
        return
    remedy = f"the plan belongs to another world than {world.path}"
    if contact.surface >= len(world.surfaces):
        count = len(world.surfaces)
        raise InputError(f"{where} puts {label} on surface {contact.surface}, and there are {count}: {remedy}")
    surface = world.surfaces[contact.surface]
    distance = float(np.linalg.norm(surface.nearest_point(position) - position))
    if not distance <= robot.scale.length * NEAR:
        raise InputError(f"{where} puts {label} {distance:.2f} m away from surface {contact.surface}: {remedy}")
    if contact.friction > surface.friction + 1e-9:
        raise InputError(
            f"{where} counts on friction {contact.friction:g} where surface {contact.surface} has "
            f"{surface.friction:g}: {remedy}"
        )
    if contact.bearing > surface.bearing + 1e-9:
        raise InputError(
            f"{where} counts on ground that bears {label} {1e3 * contact.bearing:.3g} mm from its middle where surface "
            f"{contact.surface} does so for {1e3 * surface.bearing:.3g} mm: {remedy}"
        )
