"""Momentum dynamics under constant contact wrenches, integrated exactly over a step.

Everything is per mass. The state (9,) is the CoM r, its velocity v and the angular momentum L about a fixed point, the
origin of r too; k = L - r x v is the angular momentum about the CoM. Gravity g points down the z axis:

    r' = r + dt v + dt^2/2 a          a = F + g, with F the sum of the contact forces
    v' = v + dt a
    L' = L + dt M + (dt r + dt^2/2 v + dt^3/6 a) x g     M: the moment of the contact wrenches about the point
    k' = k + dt (M - rbar x F)        rbar = r + dt/2 v + dt^2/6 g; the mean of r, less a part along F

The functions use only arithmetic on entries, so NumPy (also with arrays), compiled functions and CasADi share them.
"""

from __future__ import annotations

from toolkit.compiled import law


@law
def cross(a, b):
    """The three entries of a cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@law
def ballistic(dt, position, velocity, acceleration):
    """Position after a time under a constant acceleration."""
    return position + dt * velocity + dt**2 / 2 * acceleration


@law
def advanced(dt, gravity, state, acceleration, moment):
    """The nine entries of the state after a step; linear in the last three arguments, so it carries deviations too.

    Of the state (9,), the acceleration (3,) of the CoM in m/s^2 and the moment (3,) of the contact wrenches about the
    fixed point in m^2/s^2; dt is in s, and gravity a magnitude in m/s^2.
    """
    half, cube = dt**2 / 2, dt**3 / 6
    return (
        ballistic(dt, state[0], state[3], acceleration[0]),
        ballistic(dt, state[1], state[4], acceleration[1]),
        ballistic(dt, state[2], state[5], acceleration[2]),
        state[3] + dt * acceleration[0],
        state[4] + dt * acceleration[1],
        state[5] + dt * acceleration[2],
        state[6] + dt * moment[0] - gravity * (dt * state[1] + half * state[4] + cube * acceleration[1]),
        state[7] + dt * moment[1] + gravity * (dt * state[0] + half * state[3] + cube * acceleration[0]),
        state[8] + dt * moment[2],
    )


@law
def mean_com(dt, gravity, state):
    """The three entries of rbar: the point of the CoM's path over a step about which the forces make k."""
    return (
        state[0] + dt / 2 * state[3],
        state[1] + dt / 2 * state[4],
        state[2] + dt / 2 * state[5] - dt**2 / 6 * gravity,
    )


@law
def spin_rate(dt, gravity, state, force, moment):
    """The three entries of the rate of k, which is constant over a step.

    Of the state (9,) at the beginning, whose angular momentum is not used, the force (3,) of the contacts without
    gravity in m/s^2, and the moment (3,) as in `advanced`.
    """
    turned = cross(mean_com(dt, gravity, state), force)
    return moment[0] - turned[0], moment[1] - turned[1], moment[2] - turned[2]


@law
def spin(state):
    """The three entries of k, the angular momentum about the CoM."""
    turned = cross(state[:3], state[3:6])
    return state[6] - turned[0], state[7] - turned[1], state[8] - turned[2]


@law
def fill_wrench_map(rotation, lever, out):
    """Fill the matrix `out` (6, 6) that takes a wrench in a contact frame to force and moment about the fixed point.

    The rotation (3, 3) is world_from_contact, and the lever (3,) in m leads from the fixed point to the patch's centre.
    The upper right block is left as it is.
    """
    for b in range(3):
        axis = rotation[0, b], rotation[1, b], rotation[2, b]
        out[0, b], out[1, b], out[2, b] = axis
        out[3, 3 + b], out[4, 3 + b], out[5, 3 + b] = axis
        out[3, b], out[4, b], out[5, b] = cross(lever, axis)
