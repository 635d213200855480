"""What friction leaves of a predicted motion where nothing can rest.

On ground steeper than its friction angle a robot gains speed whatever it does. Networks know that on average only: a
sequence of their predictions goes down a steep slope as slowly as they have seen robots walk elsewhere. But impulse and
first moment of the contact forces lie in the sum of the contacts' friction cones (`toolkit.physics.impulse`), and both
follow from the CoM states at the ends of a transition. So predicted states are moved to the nearest ones that friction
allows, as much of it as plans use.
"""

from __future__ import annotations

import numpy as np

from toolkit.centroidal.problem import GRAVITY
from toolkit.centroidal.program import LEAST
from toolkit.contacts.stance import Stance
from toolkit.geometry.pose import steepness
from toolkit.physics.impulse import nearest_sum
from toolkit.physics.momentum import ballistic


def rests(stance: Stance) -> bool:
    """Whether some contact of a stance could stay where it is without the others, with the friction that plans use."""
    normals, friction = _cones(stance)
    return bool((steepness(normals[:, 2]) < friction).any())


def allowed(
    stance: Stance,
    com: np.ndarray,
    com_velocity: np.ndarray,
    seconds: np.ndarray,
    end_com: np.ndarray,
    end_velocity: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """The nearest CoM states after n transitions that the friction of a stance allows.

    Args:
        stance: The contacts before the transitions. What they make or break only takes contacts away.
        com: (3,) m; CoM before.
        com_velocity: (3,) m/s; its velocity.
        seconds: (n,) s; times of the transitions.
        end_com: (n, 3) m; predicted CoMs after them.
        end_velocity: (n, 3) m/s; predicted velocities.

    Returns:
        (n, 3) m CoMs and (n, 3) m/s velocities.
    """
    normals, friction = _cones(stance)
    cones, time = (normals, friction), seconds[:, None]
    free_velocity = com_velocity + time * GRAVITY
    free_com = ballistic(time, com, com_velocity, GRAVITY)
    return (
        free_com + nearest_sum(end_com - free_com, *cones),
        free_velocity + nearest_sum(end_velocity - free_velocity, *cones),
    )


def _cones(stance: Stance) -> tuple[np.ndarray, np.ndarray]:
    """(k, 3) normals of the contacts, and (k,) as much of their friction as plans use."""
    normals = np.array([contact.pose.normal for contact in stance.contacts])
    return normals, LEAST.friction * np.array([contact.friction for contact in stance.contacts])
