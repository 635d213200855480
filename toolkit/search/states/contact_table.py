"""A table of every contact that a search has met, as rows of arrays; states name contacts by number."""

from __future__ import annotations

import numpy as np

from toolkit.centroidal.problem import GRAVITY
from toolkit.contacts.projected import Projected
from toolkit.contacts.stance import Contact
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose, steepness, yaw_of

_KEPT = 50_000  # Contact objects kept for reuse
_LIMBS = tuple(Limb)


class ContactTable:
    """Contacts by number. Two contacts within the same rounding (1 mm for a usual body, 0.1 deg) are the same.

    Args:
        friction: (S,) coefficient of each surface of the world.
        scale: Factor on the rounding, for bodies of other sizes (`toolkit.robot.scale`).
        bearing: (S,) m; how far from the middle of a patch each surface bears; None where all are flat.

    Attributes:
        position: (capacity, 3) m; world.
        rotation: (capacity, 3, 3); world_from_contact.
        yaw: (capacity,) rad; heading of the x axis.
        surface: (capacity,) int; index of the surface.
        limb: (capacity,) int; the limb in contact.
    """

    def __init__(self, friction: np.ndarray, scale: float = 1.0, bearing: np.ndarray | None = None):
        self._friction, self._per_metre = friction, 1000 / scale
        self._bearing = np.full(len(friction), np.inf) if bearing is None else bearing
        self._number: dict[bytes, int] = {}
        self._objects: dict[int, Contact] = {}
        self.position = np.zeros((256, 3))
        self.rotation = np.zeros((256, 3, 3))
        self.yaw = np.zeros(256)
        self.surface = np.zeros(256, np.int32)
        self.limb = np.zeros(256, np.int8)

    def __len__(self) -> int:
        return len(self._number)

    def add(self, limb: Limb, patches: Projected) -> np.ndarray:
        """Numbers (n,) of contacts of one limb; new ones are entered."""
        n = len(patches.surface)
        yaw = np.asarray(yaw_of(patches.rotation), float).reshape(n)
        rounded = np.empty((n, 6), np.int32)
        rounded[:, 0], rounded[:, 1] = limb, patches.surface
        rounded[:, 2:5] = np.round(patches.position * self._per_metre)
        rounded[:, 5] = np.round(yaw * (1800 / np.pi)) % 3600
        data, size = rounded.tobytes(), rounded.itemsize * 6
        while len(self._number) + n > len(self.yaw):
            self._grow()
        known = self._number
        first = len(known)
        keys = [data[start : start + size] for start in range(0, n * size, size)]
        numbers = np.array([known.setdefault(key, len(known)) for key in keys], np.int64)
        rows = np.flatnonzero(numbers >= first)[::-1]  # of two within the same rounding the first one is kept
        if len(rows):
            new = numbers[rows]
            self.position[new], self.rotation[new] = patches.position[rows], patches.rotation[rows]
            self.yaw[new], self.surface[new], self.limb[new] = yaw[rows], patches.surface[rows], limb
        return numbers

    def add_contact(self, contact: Contact) -> int:
        """Number of one contact."""
        pose = contact.pose
        patch = Projected(np.array([contact.surface]), pose.position[None], pose.rotation[None])
        return int(self.add(contact.limb, patch)[0])

    def contact(self, number: int) -> Contact:
        """The contact with a number."""
        found = self._objects.get(number)
        if found is None:
            if len(self._objects) >= _KEPT:
                self._objects.clear()
            surface = int(self.surface[number])
            pose = Pose(self.rotation[number].copy(), self.position[number].copy())
            friction, bearing = float(self._friction[surface]), float(self._bearing[surface])
            found = Contact(_LIMBS[self.limb[number]], pose, friction, surface, bearing)
            self._objects[number] = found
        return found

    def friction(self, numbers: np.ndarray) -> np.ndarray:
        """(n,) coefficients of contacts (n,)."""
        return self._friction[self.surface[numbers]]

    def steepness(self, numbers: np.ndarray) -> np.ndarray:
        """(n,) part of its friction that a foot needs to rest on contacts (n,); above 1 it slides."""
        return steepness(self.rotation[numbers, 2, 2]) / np.maximum(self.friction(numbers), 1e-9)

    def slide(self, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Slides of a robot that stands on contacts (n,) alone.

        Returns:
            Downhill unit vectors (n, 2) in XY, and the least horizontal accelerations (n,) m/s^2 that way, 0 where
            friction holds.
        """
        normal, friction = self.rotation[numbers, :, 2], self.friction(numbers)
        steep = np.hypot(normal[:, 0], normal[:, 1])  # sine of the angle
        gain = np.maximum(steep - friction * normal[:, 2], 0.0) * normal[:, 2] * -GRAVITY[2]
        return normal[:, :2] / np.maximum(steep, 1e-12)[:, None], gain

    def _grow(self) -> None:
        for name in ("position", "rotation", "yaw", "surface", "limb"):
            old = getattr(self, name)
            new = np.zeros((2 * len(old), *old.shape[1:]), old.dtype)
            new[: len(old)] = old
            setattr(self, name, new)
