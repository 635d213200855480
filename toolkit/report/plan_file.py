"""plan.json: a contact sequence that another program can read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from toolkit.centroidal.plan import MotionPlan
from toolkit.contacts.category import category_of
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.errors import InputError
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.report.files import read_json, write_json
from toolkit.search.result import Solution
from toolkit.world.timing import LONGEST, Timing

SCHEMA = 1
_PATCH = ("position", "quaternion_wxyz", "rotation", "surface", "friction", "bearing")
LARGEST = 1e4
"""Greatest number that a contact may have: no world is so large in m."""
ROUNDING = 1e-9
"""Largest difference between a contact's rotation and its quaternion."""


def write_plan(path: Path, plan: MotionPlan, solution: Solution) -> None:
    """Write plan.json: the plan's contacts and times, with the cost and the predicted CoM of the search's solution.

    Where the optimiser moved a landing point, `moved_from` (3,) m is where the search had put it, and on curved ground
    `turned_from` (9,) is the rotation that it had there, row by row.
    """
    entries: list[dict[str, Any]] = []
    stances, transitions = plan.sequence.stances, plan.sequence.transitions
    # The first phase is the first transition's shift, with the rest before it.
    time = plan.schedule.phases[0].duration - transitions[0].timing.shift if transitions else 0.0
    for index, transition in enumerate(transitions):
        lift_off = time + transition.timing.shift
        touchdown = lift_off + transition.timing.swing
        contact = {} if transition.contact is None else _contact_entry(transition.contact)
        entries.append(
            {
                "limb": transition.limb.label,
                "action": "break" if transition.contact is None else "make",
                **{key: contact.get(key) for key in _PATCH},
                **_moved_from(transition, solution.sequence.transitions[index]),
                "times": {
                    "shift": transition.timing.shift,
                    "swing": transition.timing.swing,
                    "start": time,
                    "lift_off": lift_off,
                    "touchdown": touchdown,
                },
                "category": int(category_of(stances[index], transition)),
            }
        )
        time = touchdown
    content = {
        "schema": SCHEMA,
        "world": plan.world.name,
        "robot": plan.robot.name,
        "cost": solution.cost,
        "bound": solution.bound,
        "predicted_com": solution.com,
        "start": [_contact_entry(contact) for contact in plan.sequence.start.contacts],
        "transitions": entries,
    }
    write_json(path, content)


def read_plan(path: Path) -> ContactSequence:
    """Read the contacts of plan.json.

    Raises:
        InputError: The file cannot be read, or an entry is missing or wrong; the message names it.
    """
    return _read(path, "position")[0]


def read_proposal(path: Path) -> Solution:
    """Read plan.json as what a search proposed: landing points are where they were before the optimiser moved them.

    Optimised with the same settings, it gives the plan again, to the last digit. Of the predictions only the CoM is in
    the file; the others are NaN.

    Raises:
        InputError: As of `read_plan`.
    """
    sequence, plan = _read(path, "moved_from")
    count = len(sequence.transitions)
    try:
        cost, bound = (float("nan" if plan.get(key) is None else plan[key]) for key in ("cost", "bound"))
        com = np.array(plan.get("predicted_com") or np.zeros((0, 3)), float)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{path}: cost, bound or predicted_com is broken: {error}") from error
    if com.shape not in ((count + 1, 3), (0, 3)):
        raise InputError(f"{path}: predicted_com needs a point of 3 numbers at the start and after each transition")
    unknown = np.full((count + 1, 3), np.nan)
    return Solution(sequence, cost, bound, 0.0, com, unknown, unknown[1:, 0])


def read_names(path: Path) -> tuple[str, str]:
    """Names of the world and of the robot that plan.json is for.

    Raises:
        InputError: The file cannot be read, or has none.
    """
    plan = read_json(path)
    if not isinstance(plan, dict) or not all(isinstance(plan.get(key), str) for key in ("world", "robot")):
        raise InputError(f"{path}: is no plan, it does not name a world and a robot")
    return plan["world"], plan["robot"]


def _read(path: Path, position: str) -> tuple[ContactSequence, dict[str, Any]]:
    """The contacts of a plan, and the whole content; new contacts are at `position`, where they have that entry."""
    plan = read_json(path)
    where = "the file"
    try:
        where = "schema"
        if plan["schema"] != SCHEMA:
            raise InputError(f"{path}: has schema {plan['schema']}, this version reads {SCHEMA}")
        where = "start"
        start = Stance(tuple(sorted((_read_contact(entry) for entry in plan["start"]), key=lambda item: item.limb)))
        stance, transitions = start, []
        where = "transitions"
        for index, entry in enumerate(plan["transitions"]):
            where = f"transitions[{index}]"
            transitions.append(_read_transition(entry, position))
            category_of(stance, transitions[-1])
            stance = transitions[-1].apply(stance)
    except KeyError as error:
        raise InputError(f"{path}: {where} has no valid {error}") from error
    except (TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InputError(f"{path}: {where} is broken: {error}") from error
    return ContactSequence(start, tuple(transitions)), plan


def _moved_from(transition: ContactTransition, proposed: ContactTransition) -> dict[str, Any]:
    """Where the search had put a contact that the optimiser moved; nothing where it did not."""
    if transition.contact is None or proposed.contact is None:
        return {}
    pose, moved = proposed.contact.pose, transition.contact.pose
    if np.array_equal(pose.position, moved.position):
        return {}
    turned = {} if np.array_equal(pose.rotation, moved.rotation) else {"turned_from": pose.rotation.ravel()}
    return {"moved_from": pose.position, **turned}


def _contact_entry(contact: Contact) -> dict[str, Any]:
    """One contact as JSON; `rotation`, row by row, is the same as the quaternion, to the last digit."""
    return {
        "limb": contact.limb.label,
        "position": contact.pose.position,
        "quaternion_wxyz": contact.pose.quaternion_wxyz,
        "rotation": contact.pose.rotation.ravel(),
        "surface": contact.surface,
        "friction": contact.friction,
        "bearing": contact.bearing,
    }


def _read_contact(entry: dict[str, Any]) -> Contact:
    """Inverse of `_contact_entry`; raises KeyError, TypeError or ValueError where the entry is broken."""
    position = np.array(entry["position"], float)
    quaternion_wxyz = np.array(entry["quaternion_wxyz"], float)
    if position.shape != (3,) or quaternion_wxyz.shape != (4,) or not np.abs(quaternion_wxyz).max() > 1e-6:
        raise ValueError("position needs 3 numbers, quaternion_wxyz 4 that are not all zero")
    friction, surface = float(entry["friction"]), int(entry["surface"])
    numbers = np.abs([*position, *quaternion_wxyz, friction])
    if not (numbers <= LARGEST).all() or friction <= 0:
        raise ValueError(f"position, quaternion_wxyz and friction are numbers within {LARGEST:g}, friction above zero")
    if not abs(surface) < 2**31:
        raise ValueError("surface is no index of a surface")
    bearing = np.inf if entry.get("bearing") is None else float(entry["bearing"])
    if not bearing > 0.0:
        raise ValueError("bearing is a distance above 0 m, or null where the ground is flat")
    pose = Pose.from_quaternion(position, quaternion_wxyz)
    if entry.get("rotation") is not None:
        rotation = np.array(entry["rotation"], float)
        if rotation.shape != (9,) or not np.abs(rotation - pose.rotation.ravel()).max() <= ROUNDING:
            raise ValueError("rotation is not that of quaternion_wxyz; leave it out where you turn a contact")
        pose = Pose(rotation.reshape(3, 3), position)
    return Contact(Limb.from_label(entry["limb"]), pose, friction, surface, bearing)


def _read_transition(entry: dict[str, Any], position: str) -> ContactTransition:
    """One transition; its contact is at the entry's `position`, where there is such a key.

    Raises KeyError, TypeError or ValueError where the entry is broken.
    """
    timing = Timing(float(entry["times"]["shift"]), float(entry["times"]["swing"]))
    if not (0 <= timing.shift <= LONGEST and 0 < timing.swing <= LONGEST):
        raise ValueError(
            f"shift {timing.shift} and swing {timing.swing} must not be negative, and at most {LONGEST:g} s"
        )
    if entry["action"] not in ("make", "break"):
        raise ValueError(f'action is "{entry["action"]}", must be "make" or "break"')
    place = {"position": entry[position]} if entry.get(position) is not None else {}
    if position == "moved_from" and entry.get("turned_from") is not None:
        turn = np.array(entry["turned_from"], float)
        place |= {"rotation": turn, "quaternion_wxyz": Pose(turn.reshape(3, 3), np.zeros(3)).quaternion_wxyz}
    contact = _read_contact({**entry, **place}) if entry["action"] == "make" else None
    return ContactTransition(Limb.from_label(entry["limb"]), contact, timing)
