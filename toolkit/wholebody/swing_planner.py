"""Choice of a swing path that keeps the patch clear of the world and of the other foot."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from toolkit.geometry.pose import Pose
from toolkit.wholebody.profile import Window
from toolkit.wholebody.swing import Move, SwingPath

Collide = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""Maps box centres (k, 3), rotations (k, 3, 3) and half sizes (k, 3) to (k,) bool: the box touches the world."""


SKIN = 2e-3  # m; a resting patch touches its surface and may stand against a wall


@dataclass(frozen=True)
class SwingTiming:
    """When, as fractions of a swing, the patch leaves its surface, rises, crosses, descends and lands."""

    leave: Window = Window(0.0, 0.45)
    rise: Window = Window(0.0, 0.5)
    across: Window = Window(0.05, 0.85)
    descend: Window = Window(0.5, 0.95)
    land: Window = Window(0.55, 1.0)


EASY = SwingTiming()
STEEP = SwingTiming(Window(0.0, 0.3), Window(0.0, 0.4), Window(0.2, 0.8), Window(0.6, 1.0), Window(0.7, 1.0))


@dataclass(frozen=True)
class SwingConfig:
    """Shape of swing paths.

    Attributes:
        foot_lift, palm_lift: m; guarded motion along the surface normal at both ends.
        margin: m; kept free around the swept patch, where the start and the end leave that much.
        thickness: m; height of the swept box above the patch.
        raise_step, max_raise: m; what the path is raised by until it is clear, and the most it may be.
        gap: m; kept between the soles of the swinging and the standing foot.
        detour_step, max_detour: m; the same for the sideways detour around the standing foot.
        easy, steep: timing for the open, and timing that rises first, crosses then, and descends last.
        easy_raise: m; paths raised by more than that are first tried with the steep timing.
        fast_across: window of the crossing for swings faster than `fast`.
        slow, fast: m/s; mean speed up to which the window of the crossing is kept, and from which it is `fast_across`.
        pitch_gain, pitch_from, max_pitch: rad/m, m, rad; a foot that trails the standing one by more than `pitch_from`
            pitches its toes down in proportion.
        moderate_raise: m; higher paths come after lower ones with less margin.
        samples: least number of poses per swing that are checked.
        spacing: m; largest way between two of them.
    """

    foot_lift: float = 0.05
    palm_lift: float = 0.05
    margin: float = 0.02
    thickness: float = 0.08
    raise_step: float = 0.03
    max_raise: float = 0.36
    gap: float = 0.02
    detour_step: float = 0.02
    max_detour: float = 0.16
    slow: float = 1.0
    fast: float = 2.5
    easy: SwingTiming = EASY
    steep: SwingTiming = STEEP
    easy_raise: float = 0.04
    fast_across: Window = Window(0.0, 1.0)
    pitch_gain: float = 1.5
    pitch_from: float = 0.2
    max_pitch: float = 0.6
    moderate_raise: float = 0.12
    samples: int = 33
    spacing: float = 0.03


@dataclass(frozen=True)
class SwingTask:
    """What a swing has to connect.

    Attributes:
        begin, duration: s.
        start, end: world_from_contact at both ends.
        half_size: (2,) m; half extents of the patch.
        is_foot: feet are raised along z, palms away from the wall.
        free_start, free_end: the palm comes from, or goes to, the arm's free posture: no surface there.
        other: the standing sole as (pose, half size); None for palms.
    """

    begin: float
    duration: float
    start: Pose
    end: Pose
    half_size: np.ndarray
    is_foot: bool
    free_start: bool = False
    free_end: bool = False
    other: tuple[Pose, np.ndarray] | None = None


def plan_swing(task: SwingTask, collide: Collide, config: SwingConfig) -> SwingPath:
    """The least raised path that is clear, with `clear` False where none is.

    Candidates are tried from the straightest to the highest, moderate heights first with the whole margin, then with
    half of it, then with none; then great heights likewise.
    """
    detour = _detour(task, config)
    sides = _free_sides(task, collide, config)
    candidates = list(_candidates(task, config))
    needed = 0.0 if not task.is_foot else abs(task.end.position[2] - task.start.position[2])
    moderate = [item for item in candidates if max(item[:2]) <= needed + config.moderate_raise]
    great = [item for item in candidates if max(item[:2]) > needed + config.moderate_raise]
    for group in (moderate, great):
        for share in (1.0, 0.5, 0.0):
            for before, after, timing in group:
                path = _path(task, before, after, timing, detour, config)
                if not collide(*_swept_boxes(task, path, share * config.margin, sides, config)).any():
                    return path
    return replace(_path(task, *candidates[-1], detour, config), clear=False)


def _candidates(task: SwingTask, config: SwingConfig) -> Iterator[tuple[float, float, SwingTiming]]:
    """Extra height (m) before and after the crossing, with the timing, from the easiest to the highest."""
    raises = list(_raises(task, config))
    level = abs(task.end.position[2] - task.start.position[2]) if task.is_foot else 0.0
    low = [pair for pair in raises if max(pair) <= level + config.easy_raise]
    yield from ((*pair, config.easy) for pair in low)
    yield from ((*pair, config.steep) for pair in raises)


def _raises(task: SwingTask, config: SwingConfig) -> Iterator[tuple[float, float]]:
    """Extra height (m) before and after the crossing, from the least to the most."""
    steps = np.arange(0.0, config.max_raise + 1e-9, config.raise_step)
    if not task.is_foot:
        yield from ((0.0 if task.free_start else step, 0.0 if task.free_end else step) for step in steps)
        return
    climb = task.end.position[2] - task.start.position[2]
    climb += config.foot_lift * (task.end.normal[2] - task.start.normal[2])
    up, down = max(climb, 0.0), max(-climb, 0.0)
    shares = np.linspace(0.0, 1.0, 1 + min(4, int(np.ceil(abs(climb) / config.raise_step))))
    yield from ((share * up, share * down) for share in shares)
    yield from ((up + step, down + step) for step in steps[1:])


def _path(
    task: SwingTask, before: float, after: float, timing: SwingTiming, detour: np.ndarray, config: SwingConfig
) -> SwingPath:
    """The path with given extra heights, timing and detour."""
    lift = config.foot_lift if task.is_foot else config.palm_lift
    off = np.zeros(3) if task.free_start else lift * task.start.normal
    onto = np.zeros(3) if task.free_end else -lift * task.end.normal
    up = np.array([0.0, 0.0, 1.0]) if task.is_foot else _outward(task)
    travel = task.end.position - task.start.position - off - onto - (before - after) * up
    across = _across(float(np.linalg.norm(travel)) / task.duration, timing.across, config)
    moves = [
        Move(off, timing.leave),
        Move(before * up, timing.rise),
        Move(travel, across),
        Move(-after * up, timing.descend),
        Move(onto, timing.land),
        Move(detour, across, returns=True),
    ]
    pitch = _pitch(task, config)
    if pitch:  # about the toes, not about the middle of the sole
        moves.append(Move(task.half_size[0] * np.sin(pitch) * task.start.normal, SwingPath.pitching, returns=True))
    moves = tuple(move for move in moves if np.any(move.vector))
    return SwingPath(task.begin, task.duration, task.start, task.end, moves, across, pitch)


def _pitch(task: SwingTask, config: SwingConfig) -> float:
    """How far (rad) the toes go down on the way: more, the farther the foot trails the standing one."""
    if task.other is None:
        return 0.0
    trail = (task.other[0].position - task.start.position) @ task.start.rotation[:, 0]
    ahead = (task.end.position - task.start.position) @ task.start.rotation[:, 0]
    return float(np.clip(config.pitch_gain * (min(trail, ahead) - config.pitch_from), 0.0, config.max_pitch))


def _outward(task: SwingTask) -> np.ndarray:
    """Unit vector away from the surfaces at the ends of a palm's swing."""
    outward = np.zeros(3)
    outward += 0.0 if task.free_start else task.start.normal
    outward += 0.0 if task.free_end else task.end.normal
    length = np.linalg.norm(outward)
    return outward / length if length > 1e-3 else np.array([0.0, 0.0, 1.0])


def _across(speed: float, slow: Window, config: SwingConfig) -> Window:
    """Window of the crossing: fast swings take all the time there is, to keep the peak velocity low."""
    share = min(max((speed - config.slow) / (config.fast - config.slow), 0.0), 1.0)
    fast = config.fast_across
    return Window(slow.start + share * (fast.start - slow.start), slow.end + share * (fast.end - slow.end))


def _free_sides(task: SwingTask, collide: Collide, config: SwingConfig) -> tuple[float, float]:
    """How much (m) the patch can be padded sideways where it starts and where it ends, at most the margin."""
    shares = np.array([1.0, 0.75, 0.5, 0.25])
    sides = []
    for pose, free in ((task.start, task.free_start), (task.end, task.free_end)):
        if free:
            sides.append(config.margin)
            continue
        half = np.empty((len(shares), 3))
        half[:, :2] = task.half_size + (shares * config.margin)[:, None]
        half[:, 2] = 0.5 * config.thickness - SKIN
        centers = np.repeat((pose.position + (half[0, 2] + 2 * SKIN) * pose.normal)[None], len(shares), 0)
        hit = collide(centers, np.repeat(pose.rotation[None], len(shares), 0), half)
        sides.append(float(max(shares[~hit], default=0.0)) * config.margin)
    return sides[0], sides[1]


def _swept_boxes(
    task: SwingTask, path: SwingPath, margin: float, sides: tuple[float, float], config: SwingConfig
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres (k, 3), rotations (k, 3, 3), half sizes (k, 3) of the patch, thickened and padded, along a path.

    The padding below fades to nothing at the surfaces that the path leaves and reaches; the padding at the sides is
    what is free there, and grows with the way from there.
    """
    length = sum(np.linalg.norm(move.vector) for move in path.moves)
    count = max(config.samples, int(np.ceil(2.0 * length / config.spacing)) + 1)  # twice as fast in the middle
    u = np.linspace(0.0, 1.0, count)
    points, rotations = path.positions(u), path.rotations(u)
    below, aside = np.full(count, margin), np.full(count, margin)
    for pose, free, half_of_swing, side in (
        (task.start, task.free_start, u < 0.5, sides[0]),
        (task.end, task.free_end, u >= 0.5, sides[1]),
    ):
        if free:
            continue
        way = points - pose.position
        height = way @ pose.normal
        along = np.linalg.norm(way - height[:, None] * pose.normal, axis=1)
        below[half_of_swing] = np.minimum(below, 0.5 * height)[half_of_swing]
        aside[half_of_swing] = np.minimum(aside, side + along)[half_of_swing]
    below = np.maximum(below, 0.0)
    half = np.empty((count, 3))
    half[:, :2] = task.half_size + (aside - np.where(aside > SKIN, 0.0, SKIN))[:, None]
    half[:, 2] = 0.5 * (config.thickness + below - SKIN)
    centers = points + (0.5 * (config.thickness - below + SKIN))[:, None] * rotations[:, :, 2]
    return centers, rotations, half


def _detour(task: SwingTask, config: SwingConfig) -> np.ndarray:
    """(3,) m; horizontal bump that leads a foot around the standing one, zero where the straight way is free."""
    if task.other is None:
        return np.zeros(3)
    pose, half_size = task.other
    standing = _corners(pose.position[None], pose.rotation[None], half_size)[0]
    u = np.linspace(0.0, 1.0, config.samples)

    def gap(detour: np.ndarray) -> tuple[float, float]:
        path = _path(task, 0.0, 0.0, config.easy, detour, config)
        gaps = _gaps(_corners(path.positions(u), path.rotations(u), task.half_size), standing)
        return float(gaps.min()), float(min(gaps[0], gaps[-1]))

    free, at_ends = gap(np.zeros(3))
    wanted = min(config.gap, at_ends)
    if free >= wanted - 1e-6:
        return np.zeros(3)
    travel = (task.end.position - task.start.position)[:2]
    aside = np.array([-travel[1], travel[0], 0.0])
    length = np.linalg.norm(aside)
    if length < 1e-6:
        return np.zeros(3)
    middle = 0.5 * (task.end.position + task.start.position) - pose.position
    aside *= (1.0 if aside @ middle >= 0.0 else -1.0) / length
    best, best_gap = np.zeros(3), free
    for size in np.arange(config.detour_step, config.max_detour + 1e-9, config.detour_step):
        reached = gap(size * aside)[0]
        if reached > best_gap:
            best, best_gap = size * aside, reached
        if reached >= wanted - 1e-6:
            break
    return best


def _corners(positions: np.ndarray, rotations: np.ndarray, half_size: np.ndarray) -> np.ndarray:
    """(k, 4, 2) corners of patches seen from above, in order around."""
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], float)
    local = np.concatenate([signs * half_size, np.zeros((4, 1))], 1)
    return (positions[:, None] + np.einsum("kij,cj->kci", rotations, local))[..., :2]


def _gaps(moving: np.ndarray, standing: np.ndarray) -> np.ndarray:
    """(k,) m; largest separation of convex quadrilaterals along any edge normal, negative where they overlap.

    Args:
        moving: (k, 4, 2) m; corners in order around.
        standing: (4, 2) m.
    """
    standing = np.broadcast_to(standing, moving.shape)
    gaps = np.full(len(moving), -np.inf)
    for shape in (moving, standing):
        edges = np.roll(shape, -1, axis=1) - shape
        normals = np.stack([edges[..., 1], -edges[..., 0]], -1)
        normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
        first = np.einsum("kni,kci->knc", normals, moving)
        second = np.einsum("kni,kci->knc", normals, standing)
        apart = np.maximum(first.min(-1) - second.max(-1), second.min(-1) - first.max(-1))
        gaps = np.maximum(gaps, apart.max(-1))
    return gaps
