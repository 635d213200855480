"""A robot of numbers only: what the centroidal problems need of a RobotModel."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from toolkit.contacts.stance import Contact, Stance
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose
from toolkit.physics.leg import LIMITS, TORQUE_ROLES
from toolkit.robot.model import ArmGeometry, LegGeometry, LegMass, LimbModel
from toolkit.robot.scale import USUAL, Scale


def _limbs():
    sizes = [(0.11, 0.065), (0.11, 0.065), (0.04, 0.04), (0.04, 0.04)]
    return {limb: LimbModel(limb, limb.label, limb.label, np.array(sizes[limb])) for limb in Limb}


def _leg(side):
    return LegGeometry(
        hip_in_com=np.array([-0.018, 0.085 * side, -0.145]),
        ankle_in_sole=np.array([0.0, 0.0, 0.107]),
        thigh=0.4,
        shin=0.4,
        min_length=0.45,
        max_length=0.785,
        ranges={limit.quantity: (-2.0, 2.0) for limit in LIMITS if limit.quantity != "length"},
        torques=dict.fromkeys(TORQUE_ROLES, 1000.0),
    )


def _arm(side):
    return ArmGeometry(shoulder_in_com=np.array([0.0, 0.25 * side, 0.35]), min_reach=0.2, max_reach=0.65)


@dataclass(frozen=True)
class NumbersOnlyRobot:
    mass: float = 68.0
    com_height: float = 0.95
    limbs: dict = field(default_factory=_limbs)
    legs: dict = field(default_factory=lambda: {Limb.LEFT_FOOT: _leg(1), Limb.RIGHT_FOOT: _leg(-1)})
    arms: dict = field(default_factory=lambda: {Limb.LEFT_PALM: _arm(1), Limb.RIGHT_PALM: _arm(-1)})
    leg_mass: LegMass = LegMass(0.06, 0.045, np.array([[0.0, 0.0, -0.75]] * 2))
    turning_torque: float = 1e4  # enough for all of the legs' momentum
    scale: Scale = USUAL


@pytest.fixture(scope="session")
def robot():
    return NumbersOnlyRobot()


@pytest.fixture
def feet():
    """Standing on the flat, feet 0.2 m apart."""
    return Stance(
        tuple(
            Contact(limb, Pose.from_yaw(np.array([0.0, y, 0.0]), 0.0), 0.5)
            for limb, y in ((Limb.LEFT_FOOT, 0.1), (Limb.RIGHT_FOOT, -0.1))
        )
    )
