"""The whole-sequence optimisation: the motion that is executed.

The paper's objective under exact cones, with what the body can do (`toolkit.centroidal.body`), and with margins: the
wanted margins may be relaxed at a price, so they shrink only where nothing else is feasible, and the motion says how
far (its problem's margins). Solved by Fatrop, which exploits the stages; by Ipopt where Fatrop gives up.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from toolkit.centroidal.body import BodyMargins, knot_contacts
from toolkit.centroidal.build import ProblemConfig, sequence_problem
from toolkit.centroidal.layout import indices
from toolkit.centroidal.pieces import WRENCH, G
from toolkit.centroidal.problem import CentroidalMotion, CentroidalProblem, Margins, Weights
from toolkit.centroidal.program import Landing, Program, Regularisers
from toolkit.centroidal.verdict import judged
from toolkit.contacts.schedule import ContactSchedule
from toolkit.errors import InputError
from toolkit.geometry.limb import FEET
from toolkit.robot.model import RobotModel

WANTED = Margins(friction=0.66, cop=(0.055, 0.045), yaw=0.6)
CALM = Weights(angular_momentum=20.0, angular_momentum_rate=1.0)
"""The paper's weights but for the angular momentum: what fast swings ask for with the paper's, no body can follow."""
WANTED_BODY = BodyMargins(length=0.015, ankle=0.1, hip=0.05, height=0.02, torque=0.85)
CONVERGED = "converged"
HOPELESS = (0.05, 1.5)  # excess and slack of the body at which a sequence is infeasible, the solver converged or not
# Fatrop's barrier for a start near the solution; for a sequence a few per cent different it saves nothing.
WARM = {"mu_init": 1e-3, "bound_push": 1e-5, "bound_frac": 1e-5}


@dataclass(frozen=True)
class SequenceConfig:
    """What a sequence is planned with.

    Attributes:
        problem: discretisation, final box, weights and the wanted margins of the contacts.
        body: wanted margins of legs and arms.
        regularisers: small terms beside the paper's objective.
        solver: "fatrop" (Ipopt is tried where it fails) or "ipopt".
        max_iterations: of either solver.
        landing_iterations: of either solver, where landing points move.
        tolerance: of either solver; its constraints are met to about this.
    """

    problem: ProblemConfig = field(default_factory=lambda: ProblemConfig(weights=CALM, margins=WANTED, min_dt=0.02))
    body: BodyMargins = WANTED_BODY
    regularisers: Regularisers = field(default_factory=Regularisers)
    solver: str = "fatrop"
    max_iterations: int = 70
    landing_iterations: int = 150
    tolerance: float = 1e-4


def optimise(
    robot: RobotModel,
    schedule: ContactSchedule,
    com: np.ndarray,
    com_velocity: np.ndarray,
    *,
    config: SequenceConfig = SequenceConfig(),
    warm: CentroidalMotion | None = None,
    room: np.ndarray | None = None,
) -> CentroidalMotion:
    """Optimise the motion of a whole schedule, which ends at rest.

    Args:
        robot: mass, patches, legs and arms.
        schedule: phases; the last one has both feet in contact.
        com: (3,) m initial CoM in the world.
        com_velocity: (3,) m/s.
        config: see the class.
        warm: a motion to start the solver from, of any schedule; it is sampled in time. Saves about a third of the
            iterations where little has changed.
        room: (transitions, 2, 2) m; lowest and highest displacement of each transition's contact along its own axes,
            where feet may land elsewhere; the motion's problem has the contacts where they landed. As planned where
            None.

    Returns:
        The motion. Feasible where NumPy confirms it within `motion.problem.margins` and the body's limits; else
        `status` names the constraint that is violated most, and where.

    Raises:
        InputError: as `sequence_problem`, or a contact is not finite.
    """
    start = time.perf_counter()
    problem = sequence_problem(robot, schedule, com, com_velocity, config=config.problem)
    landings = None if room is None else _landings(problem, schedule, room)
    motion = optimise_problem(robot, problem, config=config, warm=warm, landings=landings)
    ends = np.array([phase.end for phase in schedule.phases])
    status = motion.status
    if "at knot" in status:
        before, _, rest = status.rpartition("at knot ")
        knot = min(int(rest), problem.steps - 1)
        middle = (problem.times[knot] + problem.times[knot + 1]) / 2
        phase = schedule.phases[min(int(np.searchsorted(ends, middle)), len(ends) - 1)]
        status = f"{before}in transition {phase.transition}, {problem.times[knot]:.2f} s"
    return replace(motion, status=status, seconds=time.perf_counter() - start)


def optimise_problem(
    robot: RobotModel,
    problem: CentroidalProblem,
    *,
    config: SequenceConfig = SequenceConfig(),
    warm: CentroidalMotion | None = None,
    landings: Sequence[Landing] | None = None,
) -> CentroidalMotion:
    """Optimise a problem whose margins are the wanted ones; as `optimise`."""
    start = time.perf_counter()
    if landings is not None:
        config = replace(config, max_iterations=max(config.max_iterations, config.landing_iterations))
    program = Program(problem, robot, config.body, config.regularisers, landings)
    if not np.isfinite(program.assembly.parameters).all():
        raise InputError("a contact pose, a friction coefficient or a timing of the sequence is not finite")
    x, status, iterations = _solve(program, _guess(program, warm), config.solver, config, warm is not None)
    motion = judged(_motion(program, x, status), robot, x[program.layout.slack])
    # Far beyond a physical limit the verdict will not change: Ipopt is asked only where it may.
    hopeless = np.isfinite(x).all() and (x[program.layout.slack[:-1]].max(0) > HOPELESS).any()
    if not motion.feasible and status != CONVERGED and config.solver == "fatrop" and not hopeless:
        x, status, count = _solve(program, _guess(program, warm), "ipopt", config)
        iterations += count
        motion = judged(_motion(program, x, status), robot, x[program.layout.slack])
    return replace(motion, iterations=iterations, seconds=time.perf_counter() - start)


def _solve(
    program: Program, guess: np.ndarray, solver: str, config: SequenceConfig, warm: bool = False
) -> tuple[np.ndarray, str, int]:
    """Variables, the solver's word ("converged" or what it said) and its iterations."""
    functions = program.assembly.functions(upper_hessian=solver == "ipopt")
    nlp = functions.pop("nlp")
    options: dict = {
        "cache": functions,
        "print_time": False,
        "calc_lam_x": False,
        "calc_lam_p": False,
        "calc_f": False,
        "calc_g": False,
    }
    if solver == "fatrop":
        layout = program.layout
        options |= {
            "structure_detection": "manual",
            "N": program.problem.steps,
            "nx": layout.states.tolist(),
            "nu": layout.controls.tolist(),
            "ng": program.path_rows.tolist(),
            "fatrop": {
                "print_level": 0,
                "max_iter": config.max_iterations,
                "tolerance": config.tolerance,
                "constr_viol_tol": 1e-8,
                "tol_acceptable": 10 * config.tolerance,
                "acceptable_iter": 6,
                **(WARM if warm else {}),
            },
        }
    else:
        options["ipopt"] = {
            "print_level": 0,
            "sb": "yes",
            "max_iter": config.max_iterations,
            "tol": config.tolerance,
            "constr_viol_tol": 1e-8,
            "bound_relax_factor": 0.0,
        }
    instance = ca.nlpsol("sequence", solver, nlp, options)
    bounds = program.variable_bounds, program.row_bounds
    result = instance(
        x0=guess,
        p=program.assembly.parameters,
        lbx=bounds[0][:, 0],
        ubx=bounds[0][:, 1],
        lbg=bounds[1][:, 0],
        ubg=bounds[1][:, 1],
    )
    stats = instance.stats()
    status = CONVERGED if stats["success"] else f"{solver} stopped early"
    return np.array(result["x"]).ravel(), status, int(stats["iter_count"])


def _guess(program: Program, warm: CentroidalMotion | None) -> np.ndarray:
    """Start of the solver: the CoM along the mean of the feet, the weight shared; or a sampled motion."""
    p, layout = program.problem, program.layout
    n = p.steps
    knots, limbs, positions, _ = knot_contacts(p)
    x = np.zeros(layout.size)
    com, velocity = np.zeros((n + 1, 3)), np.zeros((n + 1, 3))
    if warm is not None:
        for knot, at in enumerate(p.times):
            com[knot], velocity[knot], _ = warm.sample(float(at))
    else:
        feet = limbs < 2
        total, count = np.zeros((n + 1, 3)), np.zeros(n + 1)
        np.add.at(total, knots[feet], positions[feet])
        np.add.at(count, knots[feet], 1.0)
        total /= np.maximum(count, 1.0)[:, None]
        com = total + [0.0, 0.0, p.final_center[2] - p.position[-1, :2, 2].mean()]
        width = max(n // 20, 3)
        padded = np.concatenate([np.repeat(p.com[None], width, 0), com, np.repeat(com[-1:], width, 0)])
        window = np.hanning(2 * width + 3)[1:-1]
        com = np.stack([np.convolve(padded[:, i], window / window.sum(), "valid") for i in range(3)], 1)
        velocity[:-1] = np.diff(com, axis=0) / p.dt[:, None]
    com[0], velocity[0] = p.com, p.com_velocity
    x[indices(layout.offset, 3)] = com
    x[indices(layout.offset + 3, 3)] = velocity
    # The weight is shared, as far as it is inside the cones: a palm on a wall starts with a light touch.
    up = p.rotation[..., 2, :] / np.maximum(p.active[:, :2].sum(1), 1)[:, None, None]
    normal = np.maximum(up[..., 2], 0.02)
    lateral = np.linalg.norm(up[..., :2], axis=-1)
    inside = np.minimum(1.0, 0.5 * p.friction * normal / np.maximum(lateral, 1e-9))
    local = np.concatenate([up[..., :2] * inside[..., None], normal[..., None]], -1)
    step, limb = np.nonzero(p.active)
    x[indices(layout.wrench[step, limb], 3)] = local[step, limb]
    if warm is not None:
        _copy_wrenches(x, program, warm)
    start = 1e-4 if warm is not None else 0.01
    x[indices(layout.wrench[step, limb] + WRENCH, 2)] = start
    x[layout.slack] = start
    return x


def _copy_wrenches(x: np.ndarray, program: Program, warm: CentroidalMotion) -> None:
    """Start from the wrenches that another motion has at the same times in the same contacts."""
    p, layout, old = program.problem, program.layout, warm.problem
    middle = (p.times[:-1] + p.times[1:]) / 2
    at = np.clip(np.searchsorted(old.times, middle, side="right") - 1, 0, old.steps - 1)
    same = p.active & old.active[at] & (np.abs(p.position - old.position[at]).max(-1) < 0.02)
    step, limb = np.nonzero(same)
    rotation, weight = p.rotation[step, limb], p.mass * G
    force = np.einsum("nji,nj->ni", rotation, warm.force[at[step], limb]) / weight
    cop, torque = warm.cop[at[step], limb], warm.yaw_torque[at[step], limb] / weight
    moment = np.stack([cop[:, 1] * force[:, 2], -cop[:, 0] * force[:, 2], torque], 1)
    moment[:, 2] += cop[:, 0] * force[:, 1] - cop[:, 1] * force[:, 0]
    x[indices(layout.wrench[step, limb], WRENCH)] = np.concatenate([force, moment], 1)


def _landings(problem: CentroidalProblem, schedule: ContactSchedule, room: np.ndarray) -> list[Landing]:
    """Where the feet of a schedule may land, given the room of each transition's contact."""
    landings = []
    for phase in schedule.phases:
        if phase.swing is not None and phase.swing.is_foot:
            step = int(np.searchsorted(problem.times, phase.start + 1e-9, side="right")) - 1
            lower, upper = room[phase.transition]
            landings.append(Landing(phase.swing, step, lower, upper))
    return landings


def _landed(program: Program, x: np.ndarray) -> CentroidalProblem:
    """The problem with its contacts where the variables have them."""
    p, layout = program.problem, program.layout
    if not layout.moving:
        return p
    position, step = p.position.copy(), np.arange(p.steps)
    for foot in FEET:
        moved = np.einsum("tij,tj->ti", p.rotation[:, foot, :, :2], x[layout.pair(step, foot)])
        on = p.active[:, foot]
        position[on, foot] += moved[on]
        held = np.maximum.accumulate(np.where(on, step, -1))  # in the air, the contact it left
        position[held >= 0, foot] = position[held[held >= 0], foot]
    shift = (position[-1, :2] - p.position[-1, :2]).mean(0)
    return replace(p, position=position, final_center=p.final_center + shift)


def _motion(program: Program, x: np.ndarray, status: str) -> CentroidalMotion:
    """The motion of the program's variables, its knots integrated exactly from the wrenches."""
    p, layout = _landed(program, x), program.layout
    n, weight = p.steps, p.mass * G
    local, moment = np.zeros((n, 4, 3)), np.zeros((n, 4, 3))
    step, limb = np.nonzero(p.active)
    local[step, limb] = weight * x[indices(layout.wrench[step, limb], 3)]
    moment[step, limb] = weight * x[indices(layout.wrench[step, limb] + 3, 3)]
    normal = local[..., 2]
    loaded = normal > 1e-7 * weight
    scale = np.where(loaded, normal, 1.0)
    cop = np.where(loaded[..., None], np.stack([-moment[..., 1], moment[..., 0]], -1) / scale[..., None], 0.0)
    torque = moment[..., 2] - cop[..., 0] * local[..., 1] + cop[..., 1] * local[..., 0]
    state = x[layout.offset[:, None] + np.arange(9)]
    return CentroidalMotion(
        problem=p,
        feasible=False,
        status=status,
        com=state[:, :3],
        linear_momentum=p.mass * state[:, 3:6],
        angular_momentum=p.mass * state[:, 6:9],
        force=np.einsum("tlij,tlj->tli", p.rotation, local),
        cop=cop,
        yaw_torque=torque,
        objective=np.inf,
        seconds=0.0,
        iterations=0,
    )
