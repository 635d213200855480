from dataclasses import replace

import numpy as np
import pytest

from tests.wholebody.conftest import FIRST, RISE, stairs, world_of
from toolkit.geometry.limb import Limb
from toolkit.geometry.pose import Pose, rotation_on_surface, yaw_of
from toolkit.wholebody import swing_planner, swing_task
from toolkit.wholebody.detour import corners, gaps
from toolkit.wholebody.limb_paths import box_collide
from toolkit.wholebody.swing_planner import plan_swing
from toolkit.wholebody.swing_task import EASY, GAP, LIFT, MARGIN, SAMPLES, STEEP, STRAY, StandingLeg, SwingTask

HALF = np.array([0.11, 0.065])


def task_of(start, end, **options):
    poses = (Pose.from_yaw(np.array(place), 0.0) for place in (start, end))
    return SwingTask(0.0, 0.8, *poses, HALF, True, **options)


def lowest_over(path, half, x_range):
    """Least height of the sole's corners while they are within a range of x."""
    u = np.linspace(0, 1, 401)
    points = path.positions(u)
    sole = np.array([[sx * half[0], sy * half[1], 0.0] for sx in (1, -1) for sy in (1, -1)])
    world = points[:, None] + np.einsum("kij,cj->kci", path.rotations(u), sole)
    inside = (world[..., 0] > x_range[0]) & (world[..., 0] < x_range[1])
    return world[..., 2][inside].min()


def free(collide_box):
    return lambda centers, rotations, halves: np.zeros(len(centers), bool)


def test_flat_ground_needs_no_raise():
    path = plan_swing(task_of([0, 0.1, 0], [0.3, 0.1, 0]), box_collide(world_of("")))
    assert path.clear
    heights = path.positions(np.linspace(0, 1, 101))[:, 2]
    assert heights.max() == pytest.approx(LIFT, rel=0.05)
    assert path.sample(0.4).velocity[0] > 0


def test_path_clears_the_edge_of_a_step():
    """Straight over, the toes would hit the riser; the chosen path passes above the edge by the margin."""
    task = task_of([FIRST - 0.13, 0.1, 0.0], [FIRST + 0.17, 0.1, RISE])
    path = plan_swing(task, box_collide(world_of(stairs(1))))
    assert path.clear
    blind = plan_swing(task, free(None))
    assert lowest_over(blind, HALF, (FIRST, FIRST + 0.02)) < RISE
    assert lowest_over(path, HALF, (FIRST, FIRST + 0.02)) > RISE + 0.5 * MARGIN
    down = task_of([FIRST + 0.17, 0.1, RISE], [FIRST - 0.13, 0.1, 0.0])
    path = plan_swing(down, box_collide(world_of(stairs(1))))
    assert path.clear
    assert lowest_over(path, HALF, (FIRST, FIRST + 0.02)) > RISE + 0.5 * MARGIN


@pytest.mark.parametrize("nose", [0.466, 0.5])
@pytest.mark.parametrize("beyond", [0.13, 0.155, 0.18])
def test_a_fast_foot_clears_the_nose_of_the_stair_that_it_lands_on(nose, beyond):
    """Two stairs in 0.3 s: the nose is as high as the landing point, and passed at 4 m/s."""
    tread, depth = 0.2, 0.155
    low = f'<geom type="box" size="{depth} 1 {tread / 4}" pos="{nose - depth} 0 {tread / 4}"/>'
    high = f'<geom type="box" size="{depth} 1 {tread / 2}" pos="{nose + depth} 0 {tread / 2}"/>'
    task = replace(task_of([0.0, 0.1, 0.0], [nose + beyond, 0.1, tread]), duration=0.3)
    path = plan_swing(task, box_collide(world_of(low + high)))
    assert path.clear
    u = np.linspace(0.0, 0.7, 701)
    toes = path.positions(u) + HALF[0] * path.rotations(u)[:, :, 0]
    passing = (toes[:, 0] > nose) & (toes[:, 0] < nose + 0.04)
    assert toes[passing, 2].min() > tread + 0.5 * MARGIN


def test_path_rises_over_a_wall_in_the_way():
    wall = '<geom type="box" size="0.02 1 0.1" pos="0.25 0 0.1"/>'
    path = plan_swing(task_of([0, 0.1, 0], [0.5, 0.1, 0]), box_collide(world_of(wall)))
    assert path.clear
    assert lowest_over(path, HALF, (0.23, 0.27)) > 0.2


def test_a_narrow_way_is_taken_with_what_margin_it_leaves():
    """A quarter of the margin is better than none; the last test is that of the path that is taken."""
    padded = []

    def narrow(centers, rotations, halves):
        padded.append((halves[:, 0] - HALF[0]).max())
        return halves[:, 0] - HALF[0] > 0.3 * MARGIN

    assert plan_swing(task_of([0, 0.1, 0], [0.5, 0.1, 0]), narrow).clear
    assert padded[-1] == pytest.approx(0.25 * MARGIN)


def test_great_heights_come_before_no_margin():
    def only_high(centers, rotations, halves):
        return (halves[:, 0] > HALF[0]) & (np.abs(centers[:, 0] - 0.25) < 0.05) & (centers[:, 2] < 0.3)

    path = plan_swing(task_of([0, 0.1, 0], [0.5, 0.1, 0]), only_high)
    assert path.clear and path.positions(np.linspace(0, 1, 101))[:, 2].max() > 0.2


@pytest.mark.parametrize("duration, clear", [(0.8, True), (0.4, False)])
def test_only_slow_swings_go_without_a_margin(duration, clear):
    def close(centers, rotations, halves):
        return halves[:, 0] > HALF[0]

    task = replace(task_of([0, 0.1, 0], [0.5, 0.1, 0]), duration=duration)
    assert plan_swing(task, close).clear == clear


def test_a_wall_too_high_leaves_no_clear_path():
    wall = '<geom type="box" size="0.02 1 1.0" pos="0.25 0 1.0"/>'
    path = plan_swing(task_of([0, 0.1, 0], [0.5, 0.1, 0]), box_collide(world_of(wall)))
    assert not path.clear


def test_a_contact_beside_a_riser_is_not_a_collision():
    """A sole may rest against a wall; it leaves it and comes back."""
    wall = '<geom type="box" size="0.1 1 0.5" pos="0.2101 0 0.5"/>'
    path = plan_swing(task_of([-0.3, 0.1, 0], [0.0, 0.1, 0]), box_collide(world_of(wall)))
    assert path.clear


def test_tilted_contacts_are_left_and_reached_along_their_normals():
    normal = np.array([0.25, 0.1, 1.0]) / np.linalg.norm([0.25, 0.1, 1.0])
    start = Pose(rotation_on_surface(normal, 0.2), np.zeros(3))
    end = Pose(rotation_on_surface(normal * [-1, 1, 1], -0.3), np.array([0.3, 0.0, 0.05]))
    path = plan_swing(SwingTask(0.0, 0.8, start, end, HALF, True), free(None))
    early, late = path.positions(np.array([0.06]))[0], path.positions(np.array([0.97]))[0]
    assert (early - start.position) @ start.normal > 0.95 * np.linalg.norm(early - start.position)
    assert (late - end.position) @ end.normal > 0.95 * np.linalg.norm(late - end.position)


def test_fast_swings_cross_over_the_full_time():
    slow = plan_swing(task_of([0, 0.1, 0], [0.3, 0.1, 0]), free(None))
    fast = plan_swing(task_of([0, 0.1, 0], [2.4, 0.1, 0]), free(None))
    assert slow.turn == EASY.across
    assert fast.turn == EASY.fast_across


def test_foot_goes_around_the_standing_foot():
    """Between two places on either side of the standing sole the straight way would run through it."""
    other = (Pose.from_yaw(np.array([0.2, -0.08, 0.0]), 0.0), HALF)
    start, end = [-0.05, 0.09, 0.0], [0.5, 0.03, 0.0]
    blocked = plan_swing(task_of(start, end), free(None))
    path = plan_swing(task_of(start, end, other=other), free(None))
    standing = corners(other[0].position[None], other[0].rotation[None], HALF)[0]
    u = np.linspace(0, 1, 101)
    gap = {name: gaps(corners(p.positions(u), p.rotations(u), HALF), standing).min() for name, p in
           (("straight", blocked), ("around", path))}  # fmt: skip
    assert gap["straight"] < 0.01
    assert gap["around"] > GAP - 2e-3
    np.testing.assert_allclose(path.sample(0.8).pose.position, end, atol=1e-12)


def test_foot_goes_around_the_shin_where_it_leans_over_the_standing_foot():
    """Over a tilted sole the shin is aside of it: a foot keeps the same gap from there."""
    other, start, end = (Pose.from_yaw(np.array([0.2, -0.08, 0.0]), 0.0), HALF), [-0.1, 0.1, 0.0], [0.5, 0.1, 0.0]
    shin = np.array([0.0, 0.04, 0.0])
    level = plan_swing(task_of(start, end, other=other), free(None))
    path = plan_swing(task_of(start, end, other=other, shin=shin), free(None))
    leaning = corners((other[0].position + shin)[None], other[0].rotation[None], HALF)[0]
    u = np.linspace(0, 1, 101)
    gap = [gaps(corners(p.positions(u), p.rotations(u), HALF), leaning).min() for p in (level, path)]
    assert gap[0] < 0.6 * GAP
    assert gap[1] > GAP - 2e-3


@pytest.mark.parametrize("duration", [0.8, 0.45])
def test_a_raised_foot_goes_around_the_knee_of_the_standing_leg(duration):
    """Over a block it is as high as the knee, which is ahead of the ankle; a foot that stays low passes beneath.

    The knee of a leg that leans with the base has room, also where the foot is so fast that it crosses late or early.
    """
    start, end = [-0.3, -0.12, 0.0], [0.6, -0.12, 0.0]
    knee = np.array([0.2, -0.02, 0.35])
    points = np.tile([[0.0, 0.1, 0.09], knee, [0.05, 0.1, 0.75]], (SAMPLES, 1, 1))
    beside = StandingLeg(points, np.array([0.04, 0.05]))
    other = Pose.from_yaw(np.array([0.0, 0.1, 0.0]), 0.0), HALF
    timed = replace(task_of(start, end, other=other), duration=duration)
    block = box_collide(world_of('<geom type="box" size="0.05 1 0.14" pos="0.2 0 0.14"/>'))
    u = np.linspace(0.0, 1.0, 201)

    def apart(path):
        places = path.positions(u)
        passing = (places[:, 2] < knee[2]) & (places[:, 2] + 0.08 > knee[2])
        sides = corners(places, path.rotations(u), HALF)[passing]
        square = knee[:2] + 0.04 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
        return gaps(sides, square).min() if passing.any() else np.inf

    straight = plan_swing(timed, block)
    path = plan_swing(replace(timed, beside=beside), block)
    room = GAP + STRAY * (knee[2] - points[0, 0, 2])
    assert path.clear and apart(straight) < 0.5 * GAP and apart(path) > room - 5e-3
    wide = '<geom type="box" size="0.4 0.01 0.5" pos="0.2 -0.2 0.5"/>'  # no room to go around

    def walled(*boxes):
        return block(*boxes) | box_collide(world_of(wide))(*boxes)

    assert plan_swing(replace(timed, beside=beside), walled).clear
    low = [plan_swing(replace(timed, beside=each), free(None)) for each in (None, beside)]
    np.testing.assert_allclose(low[0].positions(u), low[1].positions(u))


@pytest.mark.parametrize("under", [0.0, 0.015, 0.03])
def test_a_foot_that_stands_under_an_edge_draws_back_from_there(under):
    """The nose of a step is over the toes: straight up they would hit it, and back on the ground nothing is in the way.

    Where the toes are not under it, the foot goes up straight.
    """
    nose, height = 0.3, 0.25
    step = f'<geom type="box" size="0.4 1 0.02" pos="{nose + 0.4} 0 {height - 0.02}"/>'
    start = np.array([nose + under - HALF[0] - 0.002, 0.1, 0.0])
    task = task_of(start, [nose + 0.2, 0.1, height])
    path = plan_swing(task, box_collide(world_of(step)))
    u = np.linspace(0.0, 1.0, 201)
    back = start[0] - path.positions(u)[:, 0].min()
    assert path.clear and (back > under + 0.005 if under else back < 1e-9)
    np.testing.assert_allclose(path.positions(u)[[0, -1]], [start, task.end.position], atol=1e-12)


def test_palm_retracts_and_approaches_along_the_normal():
    normal = np.array([0.0, -1.0, 0.0])
    rotation = np.stack([[0, 0, 1.0], np.cross(normal, [0, 0, 1.0]), normal], 1)
    start, end = Pose(rotation, np.array([0.2, 0.6, 1.1])), Pose(rotation, np.array([0.5, 0.6, 1.2]))
    wall = '<geom type="box" size="2 0.05 1" pos="0 0.65 1"/>'
    task = SwingTask(0.0, 1.0, start, end, np.array([0.04, 0.04]), False)
    path = plan_swing(task, box_collide(world_of(wall)))
    assert path.clear
    away = (path.positions(np.linspace(0, 1, 101)) - start.position) @ normal
    assert away.max() == pytest.approx(LIFT, rel=0.05)
    # The last stretch runs along the normal only, and slowly.
    late = path.sample(0.9)
    assert abs(late.velocity[0]) < 1e-9 and late.velocity[1] > 0
    assert np.linalg.norm(path.sample(0.97).velocity[:3]) < 0.08


def test_swept_box_that_always_hits_is_reported():
    path = plan_swing(task_of([0, 0.1, 0], [0.3, 0.1, 0]), lambda c, r, h: np.ones(len(c), bool))
    assert not path.clear


def test_toes_and_knee_turn_outward_before_the_legs_pass_each_other():
    def turned(foot, yaw, duration=0.8):
        start, end = Pose.from_yaw(np.array([-0.4, 0.2, 0.0]), -yaw), Pose.from_yaw(np.array([0.4, 0.2, 0.0]), yaw)
        path = plan_swing(SwingTask(0.0, duration, start, end, HALF, True, foot.outward), free(None))
        return yaw_of(path.rotations(np.array([0.5]))[0]) / yaw

    assert turned(Limb.LEFT_FOOT, 0.25) == pytest.approx(1.0) and turned(Limb.RIGHT_FOOT, -0.25) == pytest.approx(1.0)
    assert abs(turned(Limb.LEFT_FOOT, -0.25)) < 0.3 and abs(turned(Limb.RIGHT_FOOT, 0.25)) < 0.3
    assert turned(Limb.LEFT_FOOT, 0.5, 0.3) < 0.95  # a fast one takes longer


@pytest.mark.parametrize(
    ("box", "rise", "reach", "beyond"),
    [
        ('size="0.3 1 0.03" pos="1.43 0 0.03"', 0.0, 0.9, "LATE"),  # a riser before the toes
        ('size="0.5 1 0.1" pos="0.85 0 0.1"', -0.2, 0.5, "EARLY"),  # an edge behind the heel
    ],
)
def test_a_fast_foot_at_an_edge_crosses_when_it_needs_the_least_acceleration(monkeypatch, box, rise, reach, beyond):
    start, end = (Pose.from_yaw(np.array(place), 0.0) for place in ([1.0, 0.1, -rise], [1.0 + reach, 0.1, 0.0]))
    world = world_of(f'<geom type="box" {box}/>')

    def path(duration):
        return plan_swing(SwingTask(0.0, duration, start, end, HALF, True), box_collide(world))

    chosen, slow = path(0.3), path(1.0)
    for timing in ("LATE", "EARLY"):
        monkeypatch.setattr(swing_planner, timing, STEEP)
    assert chosen.clear and chosen.peak_acceleration < 0.9 * path(0.3).peak_acceleration
    assert path(1.0).peak_acceleration == slow.peak_acceleration  # there the time suffices
    monkeypatch.setattr(swing_planner, beyond, getattr(swing_task, beyond))
    assert path(0.3).peak_acceleration == chosen.peak_acceleration


def test_the_peak_acceleration_is_that_of_the_samples():
    start, end = (Pose.from_yaw(np.array(place), 0.0) for place in ([0.0, 0.1, 0.0], [0.5, 0.1, 0.1]))
    path = plan_swing(SwingTask(0.0, 0.4, start, end, HALF, True), free(None))
    largest = max(np.linalg.norm(path.sample(time).acceleration[:3]) for time in np.linspace(0.0, 0.4, 401))
    assert path.peak_acceleration == pytest.approx(largest, rel=0.1)
