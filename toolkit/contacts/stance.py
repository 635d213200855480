"""Contact and stance: which limbs rest where."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from toolkit.geometry.limb import FEET, PALMS, Limb
from toolkit.geometry.pose import Pose, mean_pose


@dataclass(frozen=True)
class Contact:
    """A limb's patch resting on a surface.

    Attributes:
        limb: The limb in contact.
        pose: world_from_contact. The origin is the centre of the patch, z is the outward normal of the surface, and
            x of a foot points along its toes. The limb's site in the robot model coincides with this frame.
        friction: Coulomb coefficient of the surface.
        surface: Index of the surface in `World.surfaces`, -1 where there is none.
        bearing: m; how far from the middle of the patch the centre of pressure can be; see `Surface`.
    """

    limb: Limb
    pose: Pose
    friction: float
    surface: int = -1
    bearing: float = math.inf

    @cached_property
    def identity(self) -> bytes:
        """Bytes that are equal for equal contacts: limb, place and surface, to the last bit."""
        numbers = np.array([self.limb, self.surface, self.friction, *self.pose.position])
        return numbers.tobytes() + self.pose.rotation.tobytes()


@dataclass(frozen=True)
class Stance:
    """A set of contacts in the order of `Limb`, at most one for each limb: always both feet, perhaps palms."""

    contacts: tuple[Contact, ...]

    def __post_init__(self):
        limbs = [contact.limb for contact in self.contacts]
        if limbs != sorted(set(limbs)) or limbs[: len(FEET)] != list(FEET):
            raise ValueError(f"a stance needs both feet, each limb once and in order; got {[x.label for x in limbs]}")

    @cached_property
    def identity(self) -> bytes:
        """Bytes that are equal for equal stances: those of all contacts."""
        return b"|".join(contact.identity for contact in self.contacts)

    def __getitem__(self, limb: Limb) -> Contact:
        for contact in self.contacts:
            if contact.limb == limb:
                return contact
        raise KeyError(limb.label)

    def __contains__(self, limb: Limb) -> bool:
        return any(contact.limb == limb for contact in self.contacts)

    @property
    def limbs(self) -> tuple[Limb, ...]:
        """Limbs in contact, in order."""
        return tuple(contact.limb for contact in self.contacts)

    @property
    def feet(self) -> tuple[Contact, ...]:
        """Contacts of the feet, the left one first."""
        return self.contacts[: len(FEET)]

    @property
    def palms(self) -> tuple[Limb, ...]:
        """Palms in contact, in order."""
        return tuple(limb for limb in PALMS if limb in self)

    @property
    def mean_feet(self) -> Pose:
        """Upright frame at the mean of the feet with the circular mean of their headings (world_from_feet)."""
        return mean_pose(*(contact.pose for contact in self.feet))

    def replace(self, contact: Contact) -> Stance:
        """The stance with `contact` in place of the limb's old contact, if there is one."""
        kept = [old for old in self.contacts if old.limb != contact.limb]
        return Stance(tuple(sorted([*kept, contact], key=lambda item: item.limb)))

    def without(self, limb: Limb) -> Stance:
        """The stance without the contact of a palm."""
        return Stance(tuple(contact for contact in self.contacts if contact.limb != limb))
