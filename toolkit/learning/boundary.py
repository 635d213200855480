"""Transitions near the boundary of what is feasible, made of feasible ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from toolkit.learning.feasible import TransitionProblem, transition_feasible

# Lengths and speeds are those of a body of the usual size (`toolkit.robot.scale`).
_COM = np.array([0.12, 0.12, 0.08])  # m; deviations of the largest disturbance of the CoM, in the frame of the feet
_VELOCITY = np.array([0.6, 0.5, 0.25])  # m/s; the same of its velocity
_CONTACT = np.array([0.3, 0.3, 0.1])  # m; the same of the new contact, in its own frame
_GROWTH = (1.0, 2.0, 4.0)  # parts of the disturbance that are tried until one is infeasible


def at_boundary(problem: TransitionProblem, rng: np.random.Generator) -> list[tuple[TransitionProblem, bool]]:
    """A feasible transition, changed as far as it stays feasible and a little farther.

    The CoM, its velocity or the new contact moves in a random direction, or several of them.

    Returns:
        The changed transitions and whether each is feasible.
    """
    moved = rng.normal(size=(3, 3)) * (rng.random((3, 1)) < 0.5)
    if not moved[:2].any():
        moved[int(rng.integers(2))] = rng.normal(size=3)
    judged, least = [], 0.0
    for part in _GROWTH:
        changed = _changed(problem, moved, part)
        judged.append((changed, transition_feasible(changed)))
        if not judged[-1][1]:
            between = _changed(problem, moved, (least + part) / 2)
            return [*judged, (between, transition_feasible(between))]
        least = part
    return judged


def _changed(problem: TransitionProblem, moved: np.ndarray, part: float) -> TransitionProblem:
    """The transition with a part of a change: (3, 3) of CoM, velocity and new contact, in standard deviations."""
    turn, transition = problem.stance.mean_feet.rotation, problem.transition
    scale = problem.robot.scale
    if transition.contact is not None:
        pose = transition.contact.pose
        pose = replace(pose, position=pose @ (scale.length * part * moved[2] * _CONTACT))
        transition = replace(transition, contact=replace(transition.contact, pose=pose))
    return replace(
        problem,
        com=problem.com + turn @ (scale.length * part * moved[0] * _COM),
        com_velocity=problem.com_velocity + turn @ (scale.speed * part * moved[1] * _VELOCITY),
        transition=transition,
    )
