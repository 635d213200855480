"""Angular momentum that the legs bring along while they swing.

Feet and CoM place both legs. With trunk and arms at rest against each other the legs still turn about the CoM, and only
the ground or a motion of trunk and arms can take that up. A leg counts as mass along the line from hip to ankle:
with d the way from hip to ankle, o the hip from the base's reference point b, and m1 and m2 the first and second
moment of the leg's mass along the line, in parts of the robot's mass,

    kappa = sum_legs (m1 o + m2 d) x d' - (c - b) x sum_legs m1 d',    c - b = sum_legs m1 (d - d_home).
"""

from __future__ import annotations

import numpy as np

from toolkit.centroidal.problem import CentroidalProblem, smooth_step
from toolkit.geometry.limb import FEET
from toolkit.geometry.pose import rotation_about_z
from toolkit.robot.model import RobotModel

ACROSS, RISE, SINK = (0.05, 0.85), (0.0, 0.5), (0.5, 1.0)  # parts of a swing in which the foot moves along or upright
STRIDE = 7.3  # m/s^2; acceleration of the foot in a step of natural length and time, which no size of a body changes
# Momentum changes at three times the rate of a plan's knots at its peaks. Trunks with motors for twice that take up all
# of it, and keep half of their torque for balance; those with motors for less than once leave all to the ground.
WEAK, STRONG = 3.0, 6.0


def ankles(problem: CentroidalProblem) -> tuple[np.ndarray, np.ndarray]:
    """(N + 1, 2, 3) m and m/s; ankles and their velocities at the knots, on smooth paths between the contacts.

    A foot in the air that lands nowhere stays where it was.
    """
    times, shape = problem.times, (problem.steps + 1, len(FEET), 3)
    place, velocity = np.zeros(shape), np.zeros(shape)
    for foot in FEET:
        tip = problem.position[:, foot] + problem.rotation[:, foot] @ problem.tip_in_contact[foot]
        last = tip[-1]
        if problem.landing_limb == foot and problem.landing_rotation is not None:
            last = problem.landing_position + problem.landing_rotation @ problem.tip_in_contact[foot]
        place[:, foot] = tip = np.vstack([tip, last])
        edges = np.flatnonzero(np.diff(np.concatenate([[1], problem.active[:, foot].astype(int), [1]])))
        for lift, land in edges.reshape(-1, 2):
            start, swing = tip[max(lift - 1, 0)], slice(lift, land + 1)
            duration, way = times[land] - times[lift], tip[land] - start
            s = (times[swing] - times[lift]) / duration
            climb = np.array([0.0, 0.0, problem.swing_lift + max(way[2], 0.0)])
            place[swing, foot], velocity[swing, foot] = start, 0.0
            for move, window in ((way * [1, 1, 0], ACROSS), (climb, RISE), (way * [0, 0, 1] - climb, SINK)):
                part, rate = smooth_step(s, *window)
                place[swing, foot] += part[:, None] * move
                velocity[swing, foot] += rate[:, None] * move / duration
    return place, velocity


def leg_spin(problem: CentroidalProblem, robot: RobotModel, com: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """(N + 1, 3) m^2/s; angular momentum per mass that the legs bring along at the knots.

    It is about the CoM, in the world, while the base is upright with the heading of the feet and the rest of the body
    does not turn against it; `com` and `velocity` (N + 1, 3) are those of the CoM.
    """
    mass, turn = robot.leg_mass, rotation_about_z(problem.yaw)
    hip = np.stack([turn @ robot.legs[foot].hip_in_com for foot in FEET], 1)
    home = np.stack([turn @ mass.line[foot] for foot in FEET], 1)
    tips, speed = ankles(problem)
    both = len(FEET) * mass.first
    base = (com - mass.first * (tips - hip - home).sum(1)) / (1.0 - both)
    base_speed = (velocity - mass.first * speed.sum(1)) / (1.0 - both)
    line, rate = tips - hip - base[:, None], speed - base_speed[:, None]
    own = np.cross(mass.first * hip + mass.second * line, rate).sum(1)
    return own - np.cross(com - base, mass.first * rate.sum(1))


def ground_share(robot: RobotModel) -> float:
    """Part of the legs' momentum, in [0, 1], that is the ground's to take up because trunk and arms are too weak."""
    needed = robot.mass * robot.leg_mass.first * robot.com_height * STRIDE
    strength = robot.turning_torque / needed
    return float(np.clip((STRONG - strength) / (STRONG - WEAK), 0.0, 1.0))
