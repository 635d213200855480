"""Footsteps at equal distances along the straight way, each moved into the nearest region that holds its sole."""

from __future__ import annotations

import numpy as np

from toolkit.contacts.sequence import ContactSequence
from validation.rivals.footsteps import Footsteps
from validation.rivals.regions import Region


def even_steps(task: Footsteps) -> ContactSequence:
    """The contacts of a task whose feet keep their distance from the way's middle; limits of steps are not asked."""
    feet = [contact.pose.position for contact in task.start.feet]
    middle = (feet[0] + feet[1]) / 2
    places, chosen = [], []
    for step, limb in enumerate(task.limbs[2:], start=1):
        share = min((step + 1) / task.count, 1.0)  # the last two steps end side by side
        wish = feet[int(limb)][:2] + share * (task.goal - middle[:2])
        options = [_nearest(region, wish) for region in task.regions]
        number = int(np.argmin([np.linalg.norm(place[:2] - wish) for place in options]))
        places.append(options[number])
        chosen.append(number)
    return task.sequence(np.array(places), np.array(chosen))


def _nearest(region: Region, wish: np.ndarray) -> np.ndarray:
    """(3,) m; the point of a region that alternating projections on its edges find near the world's XY (2,)."""
    normal = region.normal
    place = np.append(wish, (region.height - normal[:2] @ wish) / normal[2])
    for _ in range(50):
        beyond = region.sides @ place - region.bounds
        worst = int(np.argmax(beyond))
        if beyond[worst] <= 1e-9:
            break
        place = place - beyond[worst] * region.sides[worst]
    return place
