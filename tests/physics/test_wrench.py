"""Linear wrench cones against the forces that corners of a sole can really exert."""

import numpy as np
from scipy.optimize import linprog

from toolkit.physics.wrench import foot_rows, friction_rows, sole_rows, turning_rows, yaw_row

HALF, FRICTION = np.array([0.11, 0.065]), 0.5
CORNERS = np.array([[a * HALF[0], b * HALF[1], 0.0] for a in (-1, 1) for b in (-1, 1)])


def wrench_of(forces, points):
    return np.r_[forces.sum(0), np.cross(points, forces).sum(0)]


def corners_can_exert(wrench, friction):
    """Whether corner forces within square friction pyramids add up to a wrench (a linear programme)."""
    rays = np.array([[friction * a, friction * b, 1.0] for a in (-1, 1) for b in (-1, 1)])
    columns = [np.r_[ray, np.cross(point, ray)] for point in CORNERS for ray in rays]
    answer = linprog(np.zeros(len(columns)), A_eq=np.array(columns).T, b_eq=wrench, bounds=(0, None))
    return answer.status == 0


def test_friction_polygon_lies_inside_the_circular_cone_and_fills_it():
    rng = np.random.default_rng(0)
    rows = friction_rows(FRICTION)
    forces = rng.normal(size=(20000, 3)) * [1.0, 1.0, 2.0]
    inside = (forces @ rows.T <= 0.0).all(1)
    ratio = np.hypot(forces[:, 0], forces[:, 1]) / (FRICTION * np.maximum(forces[:, 2], 1e-12))
    assert (ratio[inside] <= 1.0 + 1e-12).all() and (forces[inside, 2] >= 0.0).all()
    # The inscribed 24-gon reaches cos(pi / 24) = 0.991 of the circle everywhere.
    assert np.asarray(inside)[(ratio < np.cos(np.pi / 24)) & (forces[:, 2] > 0.0)].all()


def test_every_wrench_in_the_sole_cone_can_be_exerted_by_the_corners():
    rng = np.random.default_rng(1)
    rows = sole_rows(FRICTION, HALF)
    inside = outside = 0
    for _ in range(400):
        force = np.r_[rng.uniform(-1, 1, 2) * FRICTION, 1.0]
        moment = np.r_[rng.uniform(-1.2, 1.2, 2) * HALF[::-1], rng.uniform(-1.2, 1.2) * FRICTION * HALF.sum()]
        wrench = np.r_[force, moment]
        within = (rows @ wrench <= -1e-9).all()
        if within:
            inside += 1
            assert corners_can_exert(wrench, FRICTION)
        elif (rows[24:] @ wrench > 1e-9).any() and np.abs(force[:2]).max() <= FRICTION:
            outside += 1
            assert not corners_can_exert(wrench, FRICTION)
    assert inside > 30 and outside > 30


def test_wrenches_of_corner_forces_well_inside_are_accepted():
    rng = np.random.default_rng(2)
    rows = sole_rows(FRICTION, HALF)
    for _ in range(300):
        normal = rng.uniform(0.0, 1.0, 4)
        tangent = rng.uniform(-1, 1, (4, 2)) * normal[:, None] * FRICTION * 0.69  # inside the circle, any direction
        forces = np.c_[tangent, normal]
        assert (rows @ wrench_of(forces, CORNERS) <= 1e-12).all()


def test_yaw_factor_shrinks_the_yaw_moment_in_proportion():
    def most(factor):
        rows = sole_rows(FRICTION, HALF, factor)
        moments = np.linspace(0.0, 0.2, 2001)
        return moments[[(rows @ [0, 0, 1, 0, 0, m] <= 0).all() for m in moments]].max()

    np.testing.assert_allclose(most(1.0), FRICTION * HALF.sum(), atol=1e-4)
    np.testing.assert_allclose(most(0.7), 0.7 * most(1.0), atol=2e-4)


def test_less_yaw_friction_gives_a_smaller_cone():
    rng = np.random.default_rng(3)
    full, reduced = sole_rows(FRICTION, HALF), sole_rows(FRICTION, HALF, 0.7)
    scale = np.r_[FRICTION, FRICTION, 1.0, HALF[1], HALF[0], FRICTION * HALF.sum()]
    wrenches = rng.uniform(-1.0, 1.0, (20000, 6)) * scale
    wrenches[:, 2] = 1.0
    inside = (wrenches @ reduced.T <= 0.0).all(1)
    assert inside.sum() > 100
    assert (wrenches[inside] @ full.T <= 1e-12).all()


def test_what_keeps_the_margins_of_a_plan_is_within_the_physical_limits():
    """Plan inside controller inside simulation, whatever force the sole pushes with."""
    rng = np.random.default_rng(7)
    rings = [(0.66, 0.6, HALF - [0.055, 0.0325]), (0.83, 0.8, HALF - [0.0275, 0.01625]), (1.0, 1.0, HALF)]
    cones = [sole_rows(part * FRICTION, half, yaw) for part, yaw, half in rings]
    scale = np.r_[0.66 * FRICTION, 0.66 * FRICTION, 1.0, HALF[1] / 2, HALF[0] / 2, 0.4 * FRICTION * HALF.sum()]
    wrenches = rng.uniform(-1.0, 1.0, (40000, 6)) * scale
    wrenches[:, 2] = 1.0
    inside = (wrenches @ cones[0].T <= 0.0).all(1)
    assert inside.sum() > 1000
    for wider in cones[1:]:
        assert (wrenches[inside] @ wider.T <= 1e-12).all()
    # A factor on the moment itself lets through what no corner forces exert: the range does not contain zero here.
    push = np.r_[0.6 * FRICTION, 0.6 * FRICTION, 1.0, 0.95 * HALF[1], 0.95 * HALF[0]]
    row = np.array(yaw_row(FRICTION, *HALF, 1.0, 1.0, 1.0))
    most = -row[:5] @ push
    assert most < 0.0
    assert (sole_rows(FRICTION, HALF)[28:] @ np.append(push, 0.6 * most) > 0.0).any()


def test_a_force_at_a_corner_keeps_its_own_yaw_moment_whatever_the_margin():
    """A tangential force at an off-centre CoP turns the sole about its centre: that moment is no yaw torque."""
    rng = np.random.default_rng(4)
    rows = sole_rows(FRICTION, HALF, 0.7)
    for point in CORNERS:
        angle = rng.uniform(0.0, 2.0 * np.pi)
        force = np.array([0.65 * FRICTION * np.cos(angle), 0.65 * FRICTION * np.sin(angle), 1.0])
        assert (rows @ np.r_[force, np.cross(point, force)] <= 1e-12).all()


def sliding_wrench(rng):
    """Unit load spread affinely over the corners, every corner at its circular cone against one motion of the sole."""
    cop = rng.uniform(-0.5, 0.5, 2) * HALF
    load = 0.25 * (1.0 + (CORNERS[:, :2] / HALF**2 * cop).sum(1))
    angle, spin = rng.uniform(0.0, 2.0 * np.pi), rng.normal() * 20.0
    velocity = np.array([np.cos(angle), np.sin(angle)]) + spin * np.c_[-CORNERS[:, 1], CORNERS[:, 0]]
    tangent = -FRICTION * load[:, None] * velocity / np.linalg.norm(velocity, axis=1, keepdims=True)
    return wrench_of(np.c_[tangent, load], CORNERS)


def test_turning_rows_are_near_the_limit_at_which_the_sole_slides():
    rng, rows = np.random.default_rng(5), foot_rows(FRICTION, HALF)
    for _ in range(400):
        wrench = sliding_wrench(rng)
        inside, beyond = wrench.copy(), wrench.copy()
        inside[[0, 1, 5]] *= 0.97
        beyond[[0, 1, 5]] *= 1.08
        assert (rows @ inside <= 1e-12).all()
        assert (rows @ beyond > 0.0).any()


def test_a_sole_that_pushes_with_all_of_its_friction_cannot_turn():
    wrench = np.array([-0.95 * FRICTION, 0.0, 1.0, 0.0, 0.0, 0.03])
    assert (sole_rows(FRICTION, HALF) @ wrench <= 0.0).all()  # square cones at the corners could
    assert (turning_rows(FRICTION, HALF) @ wrench > 0.0).any()
    assert (foot_rows(FRICTION, HALF) @ np.append(wrench[:5], 0.0) <= 0.0).all()


def test_yaw_factor_of_turning_rows_leaves_pure_pushes_alone():
    wrench = np.array([0.97 * FRICTION, 0.0, 1.0, 0.0, 0.0, 0.0])
    assert (foot_rows(FRICTION, HALF, 0.7) @ wrench <= 0.0).all()
    turn = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.9 * FRICTION * np.hypot(*HALF)])
    assert (turning_rows(FRICTION, HALF) @ turn <= 0.0).all() and (turning_rows(FRICTION, HALF, 0.7) @ turn > 0.0).any()
