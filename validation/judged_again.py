"""Finished sequences judged by the networks, transition by transition, as a search would have judged them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.centroidal.build import initial_com
from toolkit.centroidal.intervals import intervals
from toolkit.centroidal.plan import MotionPlan
from toolkit.contacts.sequence import ContactSequence
from toolkit.prediction.networks import NetworkEvaluator, load_networks
from toolkit.robot.model import RobotModel
from toolkit.search.states.contact_table import ContactTable
from toolkit.search.states.reader import StateReader
from toolkit.search.states.state import CONTACTS, pack, unpack
from toolkit.world.timing import Timing
from toolkit.world.world import World

CHAIN = 10  # predictions in a row after which the error of the CoM is told


@dataclass(frozen=True)
class Judgement:
    """What the networks say of a sequence whose true motion is known.

    Attributes:
        objective: Sum of the objectives; None where a transition was rejected.
        rejected: Number of transitions that were rejected.
        com_error: m; distance of the predicted CoM from the true one after `CHAIN` predictions in a row; None where
            there are fewer.
    """

    objective: float | None
    rejected: int
    com_error: float | None


class Judge:
    """Judges the sequences of one world by the robot's networks.

    Args:
        robot: The robot, with networks.
        world: The world.

    Raises:
        NetworkError: The networks are missing or do not fit.
    """

    def __init__(self, robot: RobotModel, world: World):
        self._robot, self._world = robot, world
        self._networks = NetworkEvaluator(load_networks(robot), world.goal)

    def __call__(self, sequence: ContactSequence, plan: MotionPlan) -> Judgement:
        """Judge the transitions one after the other, each from the state that the one before it is predicted to leave.

        After a rejected transition the true motion says where the CoM is.

        Args:
            sequence: The sequence, as a search found it.
            plan: Its feasible motion.
        """
        table = ContactTable(np.array([surface.friction for surface in self._world.surfaces]))
        timings: dict[Timing, int] = {}
        for transition in sequence.transitions:
            timings.setdefault(transition.timing, len(timings))
        reader = StateReader(table, tuple(timings))
        truth, chained, com_error = intervals(plan.motion, plan.schedule), 0, None
        states = [reader.at_rest(sequence.start, initial_com(self._robot, sequence.start))]
        payloads: list[tuple[float, int]] = []
        rejected = 0
        for index, transition in enumerate(sequence.transitions):
            batch = self._networks.evaluate(*reader.origin(states[-1]), [transition])
            contacts = unpack([states[-1]])[0, CONTACTS].copy()
            made = transition.contact
            contacts[transition.limb] = -1 if made is None else table.add_contact(made)
            after = batch.com, batch.com_velocity
            if not batch.feasible[0]:
                rejected, chained = rejected + 1, -1
                after = truth.com[index + 1 : index + 2], truth.com_velocity[index + 1 : index + 2]
            states.append(pack(contacts[None], np.array([transition.limb]), *after)[0])
            payloads.append((float(batch.objective[0]), timings[transition.timing]))
            chained += 1
            if chained == CHAIN and com_error is None:
                com_error = float(np.linalg.norm(after[0][0] - truth.com[index + 1]))
        if rejected:
            return Judgement(None, rejected, com_error)
        return Judgement(sum(objective for objective, _ in payloads), 0, com_error)
