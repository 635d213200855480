"""Contact sequences made of those of a search: cut, with other steps, with palms in between, with other timings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from toolkit.centroidal.build import initial_com
from toolkit.contacts.category import category_of
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.contacts.transition_rows import TransitionRows
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import rotation_about_z
from toolkit.learning.quota import Quota
from toolkit.learning.scout import Scout
from toolkit.robot.model import RobotModel
from toolkit.world.timing import Timing

_ASIDE = 0.15  # share of steps that are replaced
_EVENTS = 3  # most palm transitions between two steps
_EVENT = 0.7  # probability of each
_WANTED = 20.0  # weight of a transition whose category is lacking; that of another is 1
# m for a body of the usual size (`toolkit.robot.scale`); palms in between are this far within the arm's reach above the
# middle of the feet
_ARM_MARGIN = 0.03


def part_of(sequence: ContactSequence, rng: np.random.Generator) -> ContactSequence:
    """A random part of at least two transitions; the whole sequence where it has no more."""
    count = len(sequence.transitions)
    if count <= 2:
        return sequence
    first = int(rng.integers(0, count - 1))
    last = int(rng.integers(first + 2, count + 1))
    return ContactSequence(sequence.stances[first], sequence.transitions[first:last])


def stepping_aside(sequence: ContactSequence, scout: Scout, rng: np.random.Generator) -> ContactSequence:
    """The sequence with some of its steps replaced by others out of the same stance that the search asked about.

    So steps that a search would not choose have labels too.
    """
    transitions = list(sequence.transitions)
    for index, (stance, step) in enumerate(zip(sequence.stances, sequence.transitions, strict=False)):
        if step.limb.is_foot and rng.random() < _ASIDE:
            asked = scout.asked(stance)
            rows = np.flatnonzero(TransitionRows.of(asked).limb == step.limb)
            if len(rows):
                transitions[index] = replace(asked[int(rng.choice(rows))], timing=step.timing)
    return ContactSequence(sequence.start, tuple(transitions))


def timed(sequence: ContactSequence, timings: list[Timing], rng: np.random.Generator) -> ContactSequence:
    """The same contacts, with one of the timings drawn for each transition."""
    drawn = rng.integers(0, len(timings), len(sequence.transitions))
    transitions = (
        replace(item, timing=timings[index]) for item, index in zip(sequence.transitions, drawn, strict=True)
    )
    return ContactSequence(sequence.start, tuple(transitions))


def with_palms(
    robot: RobotModel, sequence: ContactSequence, scout: Scout, quota: Quota, rng: np.random.Generator
) -> ContactSequence:
    """The steps of a sequence, with palms that make, move and break contacts between them.

    Palms touch where the search could have put them, and mostly do what the quota lacks. They let go before the arm is
    too short.
    """
    stance, transitions, last = sequence.start, [], None
    for step in sequence.transitions:
        if not step.limb.is_foot:
            continue
        for _ in range(_EVENTS):
            event = _event(robot, stance, scout, quota, last, rng) if rng.random() < _EVENT else None
            if event is not None:
                transitions.append(replace(event, timing=step.timing))
                stance, last = event.apply(stance), event.limb
        for palm in stance.palms:
            if not _reaches(robot, step.apply(stance), stance[palm]):
                transitions.append(ContactTransition(palm, None, step.timing))
                stance = stance.without(palm)
        transitions.append(step)
        stance, last = step.apply(stance), step.limb
    return ContactSequence(sequence.start, tuple(transitions))


def _event(
    robot: RobotModel, stance: Stance, scout: Scout, quota: Quota, last: Limb | None, rng: np.random.Generator
) -> ContactTransition | None:
    """A random transition of a palm out of a stance, other than the limb that moved last; None where there is none."""
    found = []
    for limb in robot.arms:
        if limb == last:
            continue
        places = [item for item in scout.touched(stance, limb) if _reaches(robot, stance, item.contact)]
        if places:
            found.append(places[int(rng.integers(len(places)))])
        if limb in stance.limbs:
            found.append(ContactTransition(limb, None))
    if not found:
        return None
    weight = np.array([_WANTED if quota.lack(category_of(stance, item)) else 1.0 for item in found])
    return found[int(rng.choice(len(found), p=weight / weight.sum()))]


def _reaches(robot: RobotModel, stance: Stance, palm: Contact | None) -> bool:
    """Whether an arm reaches its contact with the CoM at home height above the middle of the feet."""
    if palm is None:
        return False
    arm = robot.arms[palm.limb]
    shoulder = initial_com(robot, stance) + rotation_about_z(stance.mean_feet.yaw) @ arm.shoulder_in_com
    distance = np.linalg.norm(palm.pose.position - shoulder)
    margin = robot.scale.length * _ARM_MARGIN
    return bool(arm.min_reach + margin <= distance <= arm.max_reach - margin)
