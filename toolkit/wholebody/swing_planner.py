"""Choice of a swing path that keeps the patch clear of the world and of the other foot."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np

from toolkit.wholebody.detour import detour
from toolkit.wholebody.swing import Move, SwingPath, Window
from toolkit.wholebody.swing_task import EARLY, EASY, LATE, SAMPLES, STEEP, THICKNESS, SwingTask, SwingTiming

Raised = tuple[float, float, SwingTiming]
"""Extra heights (m) before and after the crossing, and the timing."""
Collide = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Maps box centres (k, 3), rotations (k, 3, 3) and half sizes (k, 3) to (k,) bool, whether a box touches the world."""

# Lengths and speeds are those of a body of the usual size (`toolkit.robot.scale`).
SKIN = 2e-3  # m; a resting patch touches its surface and may stand against a wall
SPACING = 0.01  # m; largest way between two poses that are checked, so that none passes an edge unseen
SHIN = 0.01  # m; half the width of what must be clear along the middle of the shin
# m per m of way along the surface on which a swing ends that is higher by more than CLIMB (m): the least padding below
NEAR, CLIMB = 0.4, 0.02

RAISE_STEP, MAX_RAISE = 0.03, 0.36  # m; a path is raised in these steps until it is clear, at most by MAX_RAISE
EASY_RAISE = 0.04  # m; paths raised by more than that are first tried with the steep timing
MARGIN_SHARES = (1.0, 0.5, 0.25)  # parts of the margin, in the order in which they are tried
MODERATE_RAISE = 0.12  # m; higher paths come after lower ones with less margin

FAST_LAND = Window(0.75, 1.0)  # of feet that swing fast: they stop moving along the surface before they touch it
SLOW, FAST = 1.0, 2.5  # m/s; the easy windows hold up to a mean speed of SLOW, the fast ones from FAST on

# A foot that turns its toes outward by more than LEAST_TURN (rad), and with them its knee, does so before the legs pass
# each other: until OUTWARD, a fraction of the swing, unless that asks for more than TURN_RATE (rad/s) in the mean.
OUTWARD, LEAST_TURN, TURN_RATE = 0.5, 0.1, 4.0

RETREATS, RETREATING = (0.03, 0.06), Window(0.0, 0.6)  # m by which feet draw back, in the order of trying; and when

# A foot that trails the standing one by more than PITCH_FROM (m) pitches its toes down by PITCH_GAIN (rad/m), and by
# more where the ankle would come closer than ANKLE_MARGIN (rad) to an end of its range. MAX_PITCH (rad) is the most.
PITCH_GAIN, PITCH_FROM, MAX_PITCH, ANKLE_MARGIN = 1.5, 0.2, 0.9, 0.15


def plan_swing(task: SwingTask, collide: Collide) -> SwingPath:
    """The least raised path that is clear and that the leg can follow; where none is, the highest, `clear` False.

    Fast swings that have to rise are also tried with late and with early crossings: the one whose peak acceleration is
    least is taken. A foot that has no such path keeps its toes up, or draws back from what it has to rise over. A path
    that only asks the leg to fold too much comes before one on which its shin meets the world, and that before one on
    which the patch does.
    """
    sides = _free_sides(task, collide)
    found = []
    for each in _variants(task):
        path = _plan(each, collide, sides)
        if not any(_faults(path)):
            return path
        found.append(path)
    return min(found, key=_faults)


def _variants(task: SwingTask) -> Iterator[SwingTask]:
    """The task itself; of a foot also with its toes up, where they would go down, and such that it draws back."""
    yield task
    if not task.is_foot:
        return
    if _pitch(task) > 0.0:
        yield replace(task, level=True)
    way = (task.end.position - task.start.position) * [1.0, 1.0, 0.0]
    length = max(float(np.linalg.norm(way)), 1e-6)
    yield from (replace(task, retreat=-task.scale.length * each * way / length) for each in RETREATS)


def _faults(path: SwingPath) -> tuple[bool, bool, bool]:
    """What is wrong with a path, to compare paths."""
    return not path.clear, not path.passes, not path.fits


def _plan(task: SwingTask, collide: Collide, sides: tuple[float, float]) -> SwingPath:
    """The path of one variant of a task, with what is free at the sides of the limb; see `plan_swing`."""
    bump = detour(task, lambda vector: _path(task, 0.0, 0.0, EASY, vector))

    def around_leg(candidates: Sequence[Raised]) -> tuple[SwingPath, SwingTiming]:
        """What is found among candidates, and its timing; the standing leg is elsewhere at that height."""
        path, raised = _least_raised(task, collide, candidates, bump, sides)
        around = detour(task, lambda vector: _within_ankle_range(task, _path(task, *raised, vector)))
        if np.any(around != bump):
            other, other_raised = _least_raised(task, collide, candidates, around, sides)
            if _faults(other) <= _faults(path):
                return other, other_raised[2]
        return path, raised[2]

    easy = _raised(task, EASY, task.rise + task.scale.length * EASY_RAISE)
    path, timing = around_leg(easy + _raised(task, STEEP))
    if not _fast_foot(task) or timing is EASY:
        return path
    others = (around_leg(_raised(task, timing))[0] for timing in (LATE, EARLY))
    return min([path, *others], key=lambda each: (*_faults(each), each.peak_acceleration))


def _least_raised(
    task: SwingTask,
    collide: Collide,
    candidates: Sequence[Raised],
    bump: np.ndarray,
    sides: tuple[float, float],
) -> tuple[SwingPath, Raised]:
    """The first of some candidates, with a sideways bump, that is clear, and how it is raised.

    It is the last one with `clear` False if none is.

    Moderate heights are tried first with the whole margin, then with half and a quarter of it; before all others come
    those for which the leg can fold. Great heights follow in the same way. No margin at all is the last resort, but not
    of fast feet: they do not follow their path so closely. On all of them the middle of the shin meets nothing, since a
    foot has room below a bar over which its leg has to go; only where there is no such path it does not count.
    """

    @cache
    def path_of(raised: Raised) -> SwingPath:
        path = _within_ankle_range(task, _path(task, *raised, bump))
        return replace(path, fits=task.leg is None or task.leg.fits(path))

    @cache
    def clear(raised: Raised, share: float) -> bool:
        return not collide(*_swept_boxes(task, path_of(raised), share * task.margin, sides)).any()

    @cache
    def passes(raised: Raised) -> bool:
        return task.leg is None or not collide(*_shin_boxes(task, path_of(raised))).any()

    most = task.rise + task.scale.length * MODERATE_RAISE
    moderate = [raised for raised in candidates if max(raised[:2]) <= most]
    great = [raised for raised in candidates if max(raised[:2]) > most]
    every, last_resort = (moderate, great), () if _fast_foot(task) else (0.0,)
    stages = (True, (moderate,), MARGIN_SHARES), (False, every, MARGIN_SHARES), (False, every, last_resort)
    for passing, (fitting, groups, shares) in product((True, False), stages):
        for group, share in product(groups, shares):
            for raised in group:
                if (path_of(raised).fits or not fitting) and clear(raised, share) and passes(raised) >= passing:
                    return replace(path_of(raised), passes=passing), raised
    return replace(path_of(candidates[-1]), clear=False), candidates[-1]


def _raised(task: SwingTask, timing: SwingTiming, most: float = np.inf) -> list[Raised]:
    """Extra heights (m) before and after the crossing, from the least to `most`, with a timing."""
    return [(*pair, timing) for pair in _raises(task) if max(pair) <= most]


def _raises(task: SwingTask) -> Iterator[tuple[float, float]]:
    """Extra height (m) before and after the crossing, from the least to the most."""
    scale = task.scale.length
    steps = (scale * np.arange(0.0, MAX_RAISE + 1e-9, RAISE_STEP)).tolist()
    if not task.is_foot:
        yield from ((0.0 if task.free_start else step, 0.0 if task.free_end else step) for step in steps)
        return
    climb = float(task.end.position[2] - task.start.position[2])
    climb += task.lift * float(task.end.normal[2] - task.start.normal[2])
    up, down = max(climb, 0.0), max(-climb, 0.0)
    # Small raises come first for every climb: along a slope they are enough.
    small = [step for step in steps[:5] if step < abs(climb)]
    heights = sorted(
        {*small, *np.linspace(0.0, abs(climb), 1 + min(4, int(np.ceil(abs(climb) / (scale * RAISE_STEP)))))}
    )
    yield from ((min(height, up), min(height, down)) for height in heights)
    yield from ((up + step, down + step) for step in steps[1:])


def _path(task: SwingTask, before: float, after: float, timing: SwingTiming, bump: np.ndarray) -> SwingPath:
    """The path with given extra heights, timing and sideways bump."""
    off = np.zeros(3) if task.free_start else task.lift * task.start.normal
    onto = np.zeros(3) if task.free_end else -task.lift * task.end.normal
    up = np.array([0.0, 0.0, 1.0]) if task.is_foot else _outward(task)
    travel = task.end.position - task.start.position - off - onto - (before - after) * up
    haste = _haste(task, float(np.linalg.norm(travel)))
    across = _hastened(haste, timing.across, timing.fast_across)
    land = _hastened(haste, timing.land, FAST_LAND) if task.is_foot else timing.land
    moves = [
        Move(off, timing.leave),
        Move(before * up, timing.rise),
        Move(travel, across),
        Move(-after * up, timing.descend),
        Move(onto, land),
        Move(bump, across, returns=True),
        Move(task.retreat, RETREATING, returns=True),
    ]
    moves = tuple(move for move in moves if np.any(move.vector))
    path = SwingPath(task.begin, task.duration, task.start, task.end, moves, across)
    return _pitched(task, replace(path, turn=_turning(task, path)), _pitch(task))


def _turning(task: SwingTask, path: SwingPath) -> Window:
    """When the patch turns: while it crosses, but outward early."""
    across = path.turn
    if not task.is_foot or task.outward * path.rotation_vector[2] < LEAST_TURN:
        return across
    needed = task.scale.time * float(np.linalg.norm(path.rotation_vector)) / (TURN_RATE * task.duration)
    return Window(across.start, min(max(OUTWARD, across.start + needed), across.end))


def _pitched(task: SwingTask, path: SwingPath, pitch: float) -> SwingPath:
    """The path with its toes pitched by a further angle (rad) on the way: down about the toes, up about the heel."""
    if abs(pitch) < 1e-3:
        return path
    reach = task.half_size[0]
    rise = reach * (abs(np.sin(path.pitch + pitch)) - abs(np.sin(path.pitch)))
    moves = (*path.moves, Move(rise * task.start.normal, path.pitching, returns=True))
    return replace(path, moves=moves, pitch=path.pitch + pitch)


def _within_ankle_range(task: SwingTask, path: SwingPath) -> SwingPath:
    """The path with the further pitch that the ankle needs."""
    if task.leg is None:
        return path
    for _ in range(2):  # twice, since the pitch raises the foot
        wanted = path.pitch + task.leg.extra_pitch(path, ANKLE_MARGIN)
        path = _pitched(task, path, float(np.clip(wanted, -MAX_PITCH, MAX_PITCH)) - path.pitch)
    return path


def _pitch(task: SwingTask) -> float:
    """Angle (rad) by which the toes go down on the way; it grows with how far the foot trails the standing one."""
    if task.other is None or task.level:
        return 0.0
    trail = (task.other[0].position - task.start.position) @ task.start.rotation[:, 0]
    ahead = (task.end.position - task.start.position) @ task.start.rotation[:, 0]
    # In fast swings the ankle has only time for the pitch that its range demands.
    scale = task.scale.length
    gain = PITCH_GAIN / scale * (1.0 - _haste(task, task.way))
    return float(np.clip(gain * (min(trail, ahead) - scale * PITCH_FROM), 0.0, MAX_PITCH))


def _outward(task: SwingTask) -> np.ndarray:
    """Unit vector away from the surfaces at the ends of a palm's swing."""
    outward = np.zeros(3)
    outward += 0.0 if task.free_start else task.start.normal
    outward += 0.0 if task.free_end else task.end.normal
    length = np.linalg.norm(outward)
    return outward / length if length > 1e-3 else np.array([0.0, 0.0, 1.0])


def _fast_foot(task: SwingTask) -> bool:
    """Whether a foot swings faster than the easy windows are for."""
    return task.is_foot and _haste(task, task.way) > 0.0


def _haste(task: SwingTask, way: float) -> float:
    """Number from 0 for slow swings to 1 for fast ones, of a way in m."""
    speed = way / task.duration / task.scale.speed
    return min(max((speed - SLOW) / (FAST - SLOW), 0.0), 1.0)


def _hastened(share: float, slow: Window, fast: Window) -> Window:
    """Window between those of slow and of fast swings, for a number from 0 to 1."""
    return Window(slow.start + share * (fast.start - slow.start), slow.end + share * (fast.end - slow.end))


def _free_sides(task: SwingTask, collide: Collide) -> tuple[float, float]:
    """How much (m) the patch can be padded sideways where it starts and where it ends, at most the margin."""
    shares, margin, scale = np.array([1.0, 0.75, 0.5, 0.25]), task.margin, task.scale.length
    sides = []
    for pose, free in ((task.start, task.free_start), (task.end, task.free_end)):
        if free:
            sides.append(margin)
            continue
        half = np.empty((len(shares), 3))
        half[:, :2] = task.half_size + (shares * margin)[:, None]
        half[:, 2] = scale * (0.5 * THICKNESS - SKIN)
        centers = np.repeat((pose.position + (half[0, 2] + 2 * scale * SKIN) * pose.normal)[None], len(shares), 0)
        hit = collide(centers, np.repeat(pose.rotation[None], len(shares), 0), half)
        sides.append(float(max(shares[~hit], default=0.0)) * margin)
    return sides[0], sides[1]


def _shin_boxes(task: SwingTask, path: SwingPath) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres (k, 3), rotations (k, 3, 3), half sizes (k, 3) of thin boxes inside the shin, along a path."""
    assert task.leg is not None
    ankle, knee = task.leg.shin(path)
    up = knee - ankle
    length = np.linalg.norm(up, axis=1)
    up /= length[:, None]
    side = np.cross(path.start.rotation[:, 0], up)  # upright legs: far from along the foot
    side /= np.linalg.norm(side, axis=1)[:, None]
    half = np.column_stack([np.full((len(up), 2), task.scale.length * SHIN), length / 2])
    return (ankle + knee) / 2, np.stack([np.cross(side, up), side, up], axis=-1), half


def _swept_boxes(
    task: SwingTask, path: SwingPath, margin: float, sides: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres (k, 3), rotations (k, 3, 3), half sizes (k, 3) of the patch, thickened and padded, along a path.

    The padding below shrinks with the height of the patch's lowest edge above the surfaces at the ends. Where the swing
    climbs it does so near its end alone: the edge of a stair in front of its landing point is as high. The padding at
    the sides starts from what is free there and grows with the distance.
    """
    length = sum(np.linalg.norm(move.vector) for move in path.moves)
    thickness, skin, spacing = (task.scale.length * each for each in (THICKNESS, SKIN, SPACING))
    count = max(SAMPLES, int(np.ceil(2.0 * length / spacing)) + 1)  # twice as fast in the middle
    u = np.linspace(0.0, 1.0, count)
    points, rotations = path.positions(u), path.rotations(u)
    climbs = task.end.position[2] - task.start.position[2] > task.scale.length * CLIMB
    below, aside = np.full(count, margin), np.full(count, margin)
    for pose, free, half_of_swing, side, near in (
        (task.start, task.free_start, u < 0.5, sides[0], 0.0),
        (task.end, task.free_end, u >= 0.5, sides[1], NEAR if climbs else 0.0),
    ):
        if free:
            continue
        way = points - pose.position
        height = way @ pose.normal
        along = np.linalg.norm(way - height[:, None] * pose.normal, axis=1)
        lowest = height - np.abs(np.einsum("kij,i->kj", rotations[:, :, :2], pose.normal)) @ task.half_size
        below[half_of_swing] = np.minimum(below, np.maximum(0.5 * lowest, near * along))[half_of_swing]
        aside[half_of_swing] = np.minimum(aside, side + along)[half_of_swing]
    below = np.maximum(below, 0.0)
    half = np.empty((count, 3))
    half[:, :2] = task.half_size + (aside - np.where(aside > skin, 0.0, skin))[:, None]
    half[:, 2] = 0.5 * (thickness + below - skin)
    centers = points + (0.5 * (thickness - below + skin))[:, None] * rotations[:, :, 2]
    return centers, rotations, half
