"""Seats: how patches lie on surfaces whose ground curves about their planes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toolkit.contacts.projected import Projected
from toolkit.contacts.sequence import ContactSequence
from toolkit.geometry.pose import Pose
from toolkit.world.relief import height_and_slopes
from toolkit.world.surface import Surface


class Seats:
    """Lays patches that were projected on the planes of a world's surfaces on the ground itself.

    Args:
        surfaces: The surfaces of the world.
    """

    def __init__(self, surfaces: Sequence[Surface]):
        self._relief = np.array([surface.relief for surface in surfaces]).reshape(-1, 6)
        self._curved = np.asarray(self._relief.any(axis=1))
        self._origin = np.array([surface.pose.position for surface in surfaces]).reshape(-1, 3)
        self._turn = np.array([surface.pose.rotation for surface in surfaces]).reshape(-1, 3, 3)
        self._any = bool(self._curved.any())

    def lay(self, patches: Projected, half_size: np.ndarray) -> Projected:
        """Move patches with half extents (2,) m along the normals of their surfaces on the ground, in place.

        They tilt with the ground at their middle, and in a hollow rest on their edges.
        """
        if not self._any:
            return patches
        rows = np.flatnonzero(patches.found & self._curved[patches.surface])
        surface = patches.surface[rows]
        turn = self._turn[surface]
        local = np.einsum("nji,nj->ni", turn, patches.position[rows] - self._origin[surface])
        height, slopes = height_and_slopes(self._relief[surface], local[:, :2])
        axis = np.einsum("nji,nj->ni", turn, patches.rotation[rows, :, 0])[:, :2]
        height += _hollow(self._relief[surface], axis, half_size) - local[:, 2]
        patches.position[rows] += height[:, None] * turn[:, :, 2]
        normal = turn[:, :, 2] - np.einsum("nij,nj->ni", turn[:, :, :2], slopes)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        along = patches.rotation[rows, :, 0]
        along = along - (along * normal).sum(axis=1, keepdims=True) * normal
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        patches.rotation[rows] = np.stack([along, np.cross(normal, along), normal], axis=-1)
        return patches


def laid(sequence: ContactSequence, surfaces: Sequence[Surface], half_sizes: np.ndarray) -> ContactSequence:
    """A sequence whose new contacts lie on the ground again after they moved in their own planes.

    Args:
        sequence: The contacts.
        surfaces: The surfaces of the world.
        half_sizes: (4, 2) m; half extents of the limbs' patches.

    Returns:
        The sequence itself where all of it is on flat ground.
    """
    transitions = []
    for transition in sequence.transitions:
        contact = transition.contact
        if contact is not None and contact.surface >= 0 and surfaces[contact.surface].relief.any():
            patch = Projected(np.zeros(1, int), contact.pose.position[None].copy(), contact.pose.rotation[None].copy())
            Seats([surfaces[contact.surface]]).lay(patch, half_sizes[contact.limb])
            pose = Pose(patch.rotation[0], patch.position[0])
            transition = replace(transition, contact=replace(contact, pose=pose))
        transitions.append(transition)
    if all(new is old for new, old in zip(transitions, sequence.transitions, strict=True)):
        return sequence
    return ContactSequence(sequence.start, tuple(transitions))


def _hollow(relief: np.ndarray, axis: np.ndarray, half_size: np.ndarray) -> np.ndarray:
    """(n,) m by which the ground is higher at the edges of patches than its slope at their middle, at least 0.

    The x axes (n, 2) of the patches are in the frames of their reliefs (n, 6).
    """
    (c, s), (xx, xy, yy) = axis.T, relief[:, 3:].T
    along, across = c * c * xx + 2 * c * s * xy + s * s * yy, s * s * xx - 2 * c * s * xy + c * c * yy
    twist = c * s * (yy - xx) + (c * c - s * s) * xy
    x, y = half_size
    ends, sides = along * x * x / 2, across * y * y / 2
    return np.maximum.reduce([np.zeros_like(ends), ends, sides, ends + sides + np.abs(twist) * x * y])
