"""Momentum dynamics under constant contact wrenches, integrated exactly over a step.

Everything is per mass. The state (9,) is the CoM r, its velocity v and the angular momentum L about a fixed point, from
which r counts too; k = L - r x v is the angular momentum about the CoM. Gravity g points down the z axis:

    r' = r + dt v + dt^2/2 a          a = F + g, with F the sum of the contact forces
    v' = v + dt a
    L' = L + dt M + (dt r + dt^2/2 v + dt^3/6 a) x g     M: the moment of the contact wrenches about the point
    k' = k + dt (M - rbar x F)        rbar = r + dt/2 v + dt^2/6 g; the mean of r, less a part along F

The functions use nothing but arithmetic on entries: NumPy (entries may be arrays), compiled functions
and CasADi call the same ones.
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
    """The state after a step; linear in state, acceleration and moment, so it carries deviations too.

    Args:
        dt: s.
        gravity: m/s^2; its magnitude.
        state: (9,) m, m/s, m^2/s.
        acceleration: (3,) m/s^2; of the CoM.
        moment: (3,) m^2/s^2; of the contact wrenches about the fixed point.

    Returns:
        Nine entries.
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
    """The three entries of the rate of k, constant over a step.

    Args:
        dt: s.
        gravity: m/s^2; its magnitude.
        state: (9,) at the step's beginning; its angular momentum does not count.
        force: (3,) m/s^2; of the contacts, without gravity.
        moment: (3,) m^2/s^2; of the contact wrenches about the fixed point.
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
    """Fill the matrix that takes a wrench in a contact frame to its force and moment about the fixed point.

    Args:
        rotation: (3, 3); world_from_contact.
        lever: (3,) m; from the fixed point to the patch's centre.
        out: (6, 6); its upper right block is left as it is.
    """
    for b in range(3):
        axis = rotation[0, b], rotation[1, b], rotation[2, b]
        out[0, b], out[1, b], out[2, b] = axis
        out[3, 3 + b], out[4, 3 + b], out[5, 3 + b] = axis
        out[3, b], out[4, b], out[5, b] = cross(lever, axis)
