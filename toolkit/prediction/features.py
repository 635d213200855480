"""Features: the vector by which the networks see a contact transition, and the way back.

Every transition is brought into one canonical form: the frame of the parent stance (mean of the feet, yaw only), and
mirrored where a right limb moves, so that the moving limb is always a left one (paper, Sec. VI). Each contact enters
with its position and the x and z axes of its frame (9 numbers). The axes are continuous over all orientations, so the
paper's copies of samples at +-2 pi are not needed (`validation.encodings` compares both).

Order: left foot, right foot, (left palm), (right palm), (new contact), CoM, CoM velocity, shift, swing, friction.

Whether a transition is feasible depends on these alone. Its outcome in a whole motion depends on what comes after it
too; the regressors see of that where the goal lies (`ahead`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.contacts.category import Category, category_rows
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.contacts.transition_rows import TransitionRows
from toolkit.geometry.heading import joint_heading
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose

MIRROR = np.array([1.0, -1.0, 1.0])
CONTACT = 9  # numbers per contact
STATE = 9  # numbers after the contacts: CoM, CoM velocity, shift, swing, friction
AHEAD = 2  # numbers that say where the goal lies
TARGETS = 7  # objective, CoM, CoM velocity
COM = slice(-9, -6)  # columns of the initial CoM
TIMING = slice(-3, -1)
TIMING_AND_FRICTION = slice(-3, None)
_HALFWAY = 0.5  # m; so far away, the goal is halfway between here and far away


def feature_size(category: Category) -> int:
    """Length of the feature vector of a category."""
    return CONTACT * len(category.contact_limbs) + STATE


@dataclass(frozen=True)
class Canonical:
    """The change of frame that brought transitions into canonical form.

    Attributes:
        world_from_parent: Upright frame at the mean of the parent's feet.
        mirrored: Whether y was negated afterwards.
    """

    world_from_parent: Pose
    mirrored: bool

    def vector(self, vectors: np.ndarray) -> np.ndarray:
        """Directions (..., 3) from the world into canonical form."""
        local = vectors @ self.world_from_parent.rotation
        return local * MIRROR if self.mirrored else local

    def point(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) from the world into canonical form."""
        return self.vector(points - self.world_from_parent.position)

    def vector_back(self, vectors: np.ndarray) -> np.ndarray:
        """Directions (..., 3) from canonical form into the world."""
        local = vectors * MIRROR if self.mirrored else vectors
        return local @ self.world_from_parent.rotation.T

    def point_back(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) from canonical form into the world."""
        return self.vector_back(points) + self.world_from_parent.position

    def contacts(self, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """Contacts at (n, 3) with frames (n, 3, 3) as canonical rows (n, 9): position, x axis, z axis.

        The x and z axes of a mirrored contact are mirrored; y follows from them.
        """
        rows = np.empty((len(position), 3, 3))
        rows[:, 0] = position - self.world_from_parent.position
        rows[:, 1], rows[:, 2] = rotation[:, :, 0], rotation[:, :, 2]
        return self.vector(rows).reshape(-1, CONTACT)


def ahead(way: np.ndarray, radius: float | np.ndarray = 0.0) -> np.ndarray:
    """Where the goal lies, as the regressors see it.

    Args:
        way: (..., 2) or (..., 3) m, canonical; from the mean of the parent's feet to the middle of the goal region.
        radius: m; of the goal region, one or (...) of them.

    Returns:
        (..., 2); the direction to the goal region, whose length is 0 in it and 1 far away from it.
    """
    distance = np.maximum(np.linalg.norm(way[..., :2], axis=-1), 1e-9)
    left = np.maximum(distance - radius, 0.0)
    return way[..., :2] * (left / (left + _HALFWAY) / distance)[..., None]


def _parent_frame(stance: Stance) -> Pose:
    """`stance.mean_feet`, computed in plain floats, which is several times faster; every query needs it."""
    left, right = (contact.pose for contact in stance.feet)
    x, y = joint_heading(left.rotation, right.rotation)
    length = math.hypot(x, y)
    c, s = (x / length, y / length) if length > 0.0 else (1.0, 0.0)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return Pose(rotation, (left.position + right.position) / 2)


def encode(
    stance: Stance, com: np.ndarray, com_velocity: np.ndarray, transitions: Sequence[ContactTransition]
) -> tuple[Canonical, np.ndarray]:
    """Features of transitions of ONE category by the same limb out of one parent state.

    Args:
        stance: The parent's stance.
        com: (3,) m, world, or (n, 3) with one CoM for each transition.
        com_velocity: (3,) or (n, 3) m/s, world.
        transitions: The n transitions.

    Returns:
        The canonical frame and (n, feature_size) float64 features.

    Raises:
        ValueError: The transitions are of several categories or limbs.
    """
    new = TransitionRows.of(transitions)
    numbers = category_rows(stance, new)
    limb, category = Limb(new.limb[0]), Category(numbers[0])
    if (new.limb != limb).any() or (numbers != category).any():
        raise ValueError("transitions of one call must share their limb and category")
    frame = Canonical(_parent_frame(stance), not limb.is_left)
    contacts = [stance[limb.mirrored if frame.mirrored else limb] for limb in category.before]
    before = frame.contacts(
        np.array([contact.pose.position for contact in contacts]),
        np.array([contact.pose.rotation for contact in contacts]),
    )
    friction: float | np.ndarray = min(contact.friction for contact in contacts)
    features = np.empty((len(new), feature_size(category)))
    column = before.size
    features[:, :column] = before.ravel()
    if category.makes:
        features[:, column : column + CONTACT] = frame.contacts(new.position, new.rotation)
        column += CONTACT
        friction = np.minimum(friction, new.friction)
    features[:, column : column + 3] = frame.point(np.asarray(com, float))
    features[:, column + 3 : column + 6] = frame.vector(np.asarray(com_velocity, float))
    features[:, column + 6], features[:, column + 7], features[:, column + 8] = new.shift, new.swing, friction
    return frame, features
