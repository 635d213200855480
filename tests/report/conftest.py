"""A small made-up run: a two-legged block that glides over two boxes; every array has the documented shape."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from toolkit.centroidal.plan import MotionPlan
from toolkit.centroidal.problem import CentroidalMotion, CentroidalProblem
from toolkit.contacts.failure import Failure
from toolkit.contacts.schedule import ContactSchedule
from toolkit.contacts.sequence import ContactSequence, ContactTransition
from toolkit.contacts.stance import Contact, Stance
from toolkit.execution.check import Check
from toolkit.execution.result import Controls, Execution, Samples
from toolkit.execution.scuff import Scuff
from toolkit.execution.standard import Move, Standard, Subject
from toolkit.geometry.limb import FEET, Limb
from toolkit.geometry.pose import Pose, rotation_from_quaternion
from toolkit.pipeline import Candidate, PipelineConfig, PipelineResult, Source, Trial
from toolkit.report.run_report import RunReport
from toolkit.robot.model import LegGeometry, LimbModel, RobotModel
from toolkit.search.costs.plan_cost import plan_cost
from toolkit.search.result import SearchResult, Solution
from toolkit.wholebody.limb_paths import LimbPaths
from toolkit.wholebody.plan import WholeBodyPlan
from toolkit.wholebody.trajectory import WholeBodyTrajectory
from toolkit.world.surface import Surface
from toolkit.world.timing import Timing
from toolkit.world.world import Goal, World

BODIES = """
<body name="block" pos="0 0 0.9"><freejoint name="root_joint"/>
  <geom name="trunk" type="box" size="0.1 0.15 0.3" pos="0 0 0.2" rgba="0.2 0.3 0.7 1"/>
  <geom name="head" type="sphere" size="0.1" pos="0 0 0.6"/>
  <body name="left_leg" pos="0 0.1 0"><joint name="left_hip" axis="0 1 0" range="-60 60"/>
    <geom name="left_shank" type="capsule" fromto="0 0 0 0 0 -0.8" size="0.05"/>
    <geom name="left_sole" type="box" size="0.11 0.065 0.01" pos="0 0 -0.89"/>
    <site name="left_foot" pos="0 0 -0.9"/></body>
  <body name="right_leg" pos="0 -0.1 0"><joint name="right_hip" axis="0 1 0" range="-60 60"/>
    <geom name="right_shank" type="cylinder" fromto="0 0 0 0 0 -0.8" size="0.05"/>
    <geom name="right_sole" type="box" size="0.11 0.065 0.01" pos="0 0 -0.89"/>
    <site name="right_foot" pos="0 0 -0.9"/></body>
</body>"""
ACTUATORS = '<actuator><motor joint="left_hip"/><motor joint="right_hip"/></actuator>'
GROUND = """
<geom name="floor" type="plane" size="0 0 1" priority="1" friction="0.7" rgba="0.4 0.4 0.4 1"/>
<geom name="block/one" type="box" size="0.3 0.3 0.05" pos="1 0 0.05" euler="0 10 0"/>
<geom name="drum" type="cylinder" size="0.2 0.3" pos="0 1.5 0.3"/>
<geom name="egg" type="ellipsoid" size="0.2 0.1 0.3" pos="0 -1.5 0.3"/>
<light pos="0 0 4"/>"""
HALF_SIZE = np.array([0.11, 0.065])
TIMESTEP = 0.002
FAILURE = Failure("slip is 0.03 m, the limit is 0.02")

LEG = LegGeometry(np.zeros(3), np.zeros(3), 0.4, 0.4, 0.0, 0.8, {}, {})


def mjcf(*parts: str, actuators: str = "") -> str:
    """A scene of the given bodies and geoms."""
    return f"<mujoco><worldbody>{''.join(parts)}</worldbody>{actuators}</mujoco>"


@dataclass(frozen=True)
class MadeUpRun:
    """A run, and how to take parts of it away."""

    result: PipelineResult
    plan: WholeBodyPlan
    execution: Execution
    report: RunReport

    @property
    def solution(self) -> Solution:
        """The newest solution of the search."""
        return self.result.search.solutions[-1]

    def only(self, plan: MotionPlan, execution: Execution | None = None) -> PipelineResult:
        """The result of a run that came as far as `plan` or `execution`."""
        trial = Trial(self.result.candidates[-1], plan, execution, FAILURE)
        return replace(self.result, trial=trial, trials=(trial,))

    @property
    def motion_plan(self) -> MotionPlan:
        """The plan without what the whole-body stage added."""
        plan = self.plan
        return MotionPlan(plan.robot, plan.world, plan.sequence, plan.schedule, plan.motion)


def make_world() -> World:
    """A floor and a tilted box."""
    square = np.array([[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]])
    tilted = rotation_from_quaternion(np.array([np.cos(0.1), 0, np.sin(0.1), 0]))
    wall = np.column_stack([[0.0, 0, 1], [0.0, 1, 0], [-1.0, 0, 0]])
    surfaces = (
        Surface(0, "floor", Pose.identity(), (4 * square, square[::-1]), (4 * square,), 0.7, True, False),
        Surface(1, "block/one", Pose(tilted, np.array([1.0, 0, 0.1])), (square,), (square,), 0.7, True, False),
        Surface(2, "wall", Pose(wall, np.array([2.0, 0, 1.0])), (square,), (square,), 0.5, False, True),
    )
    model = mujoco.MjModel.from_xml_string(mjcf(GROUND))
    goal = Goal(np.array([0.6, 0.0, 0.0]), 0.3)
    return World("made-up", Path("made-up.xml"), model, surfaces, Pose.identity(), goal, Timing(0.3, 0.2))


def make_robot() -> RobotModel:
    """The gliding block."""
    text = mjcf(BODIES, actuators=ACTUATORS)
    model = mujoco.MjModel.from_xml_string(text)
    two = np.ones(2)
    return RobotModel(
        name="glider",
        folder=Path("robots/glider"),
        mjcf=text,
        assets={},
        mujoco_model=model,
        urdf="",
        base="block",
        joint_names=("left_hip", "right_hip"),
        lower=-two,
        upper=two,
        velocity_limit=10 * two,
        torque_limit=100 * two,
        armature=0 * two,
        kp=two,
        kd=two,
        home=np.array(model.qpos0),
        mass=60.0,
        com_height=0.9,
        limbs={limb: LimbModel(limb, limb.label, limb.label[:-4] + "leg", HALF_SIZE) for limb in list(Limb)[:2]},
        legs=dict.fromkeys(FEET, LEG),
        arms={},
        fingerprint="0",
    )


def make_sequence(steps: int = 4) -> ContactSequence:
    """Feet that advance by turns, with a palm added and broken on the way."""
    x = {Limb.LEFT_FOOT: 0.0, Limb.RIGHT_FOOT: 0.0}
    side = {Limb.LEFT_FOOT: 0.1, Limb.RIGHT_FOOT: -0.1}

    def foot(limb: Limb) -> Contact:
        return Contact(limb, Pose.from_yaw(np.array([x[limb], side[limb], 0.0]), 0.1 * x[limb]), 0.7, 0)

    start = Stance((foot(Limb.LEFT_FOOT), foot(Limb.RIGHT_FOOT)))
    timing = Timing(0.3, 0.2)
    transitions = []
    for index in range(steps):
        limb = Limb(index % 2)
        x[limb] += 0.2 if index else 0.1
        transitions.append(ContactTransition(limb, foot(limb), timing))
    wall = Pose(np.column_stack([[0.0, 0, 1], [0.0, 1, 0], [-1.0, 0, 0]]), np.array([0.9, 0.3, 1.2]))
    transitions.append(ContactTransition(Limb.LEFT_PALM, Contact(Limb.LEFT_PALM, wall, 0.5, 2), timing))
    transitions.append(ContactTransition(Limb.LEFT_PALM, None, timing))
    return ContactSequence(start, tuple(transitions))


def make_run(steps: int = 4) -> MadeUpRun:
    """A whole run over `steps` steps and two palm transitions."""
    world, robot, sequence = make_world(), make_robot(), make_sequence(steps)
    schedule = ContactSchedule.of(sequence, initial_rest=0.2, final_rest=0.3)
    rng = np.random.default_rng(0)
    weight = robot.mass * 9.81

    # centroidal motion: the CoM glides between the mean feet of the stances
    dt = np.array([phase.duration for phase in schedule.phases])
    n = len(dt)
    active, force = np.zeros((n, 4), bool), np.zeros((n, 4, 3))
    position, rotation = np.zeros((n, 4, 3)), np.tile(np.eye(3), (n, 4, 1, 1))
    com = np.zeros((n + 1, 3))
    for step, phase in enumerate(schedule.phases):
        for contact in phase.contacts:
            active[step, contact.limb] = True
            position[step, contact.limb], rotation[step, contact.limb] = contact.pose.position, contact.pose.rotation
            share = 0.05 if contact.limb > 1 else 1.0 / sum(item.limb < 2 for item in phase.contacts)
            force[step, contact.limb] = share * weight * contact.pose.normal
        com[step + 1] = np.mean([c.pose.position for c in phase.contacts if c.limb < 2], axis=0)
    com[:, 2] = 0.9
    half_size = np.tile(HALF_SIZE, (n, 4, 1))
    problem = CentroidalProblem(
        mass=robot.mass,
        dt=dt,
        active=active,
        position=position,
        rotation=rotation,
        friction=np.full((n, 4), 0.7),
        half_size=half_size,
        max_normal_force=np.full(4, np.inf),
        yaw=np.zeros(n + 1),
        com=com[0],
        com_velocity=np.zeros(3),
        angular_momentum=np.zeros(3),
        root_in_com=np.zeros((4, 3)),
        tip_in_contact=np.zeros((4, 3)),
        max_reach=np.full(4, 2.0),
        min_height=0.3,
        final_center=com[-1],
        final_half_size=np.full(3, 0.1),
        final_at_rest=True,
    )
    velocity = np.vstack([np.diff(com, axis=0) / dt[:, None], np.zeros(3)])
    motion = CentroidalMotion(
        problem, True, "solved", com, robot.mass * velocity, 0 * com, force, np.zeros((n, 4, 2)), np.zeros((n, 4)),
        1.5, 0.01, 7,
    )  # fmt: skip

    # whole-body trajectory at 100 Hz, execution at 500 Hz with a control tick every second step
    def sampled(times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        centre = np.column_stack([np.interp(times, problem.times, com[:, axis]) for axis in range(3)])
        qpos = np.zeros((len(times), robot.mujoco_model.nq))
        qpos[:, :3], qpos[:, 3] = centre, 1.0
        qpos[:, 7:] = 0.2 * np.sin(4 * times)[:, None] * [1, -1]
        limb_pose, contact = np.full((len(times), 4, 7), np.nan), np.zeros((len(times), 4), bool)
        wrench = np.zeros((len(times), 4, 6))
        for i, time in enumerate(times):
            phase = schedule.phase_at(time)
            step = schedule.phases.index(phase)
            for item in phase.contacts:
                limb_pose[i, item.limb] = [*item.pose.position, *item.pose.quaternion_wxyz]
                contact[i, item.limb] = True
                wrench[i, item.limb, :3] = force[step, item.limb]
        return centre, qpos, limb_pose, contact, wrench

    times = np.arange(0, schedule.duration, 0.01)
    _, qpos, limb_pose, contact, _ = sampled(times)
    nv = robot.mujoco_model.nv
    trajectory = WholeBodyTrajectory(
        times, qpos, np.zeros((len(times), nv)), np.zeros((len(times), 2)), limb_pose, np.zeros((len(times), 4, 6)),
        contact, 1e-4, 1e-3, True, 0.3,
    )  # fmt: skip

    scene = mujoco.MjModel.from_xml_string(mjcf(GROUND, BODIES, actuators=ACTUATORS))
    ticks = np.arange(0, schedule.duration, 2 * TIMESTEP)
    centre, qpos, limb_pose, _, wrench = sampled(ticks)
    noise = 0.001 * rng.standard_normal((len(ticks), 3))
    ends = [phase.end for phase in schedule.phases if phase.swing is not None]
    touchdowns = tuple(
        {"transition": i, "limb": t.limb.label, "time": end + 0.01, "planned_time": end, "position_error": 0.002}
        for i, (t, end) in enumerate(zip(sequence.transitions, ends, strict=True))
    )
    checks = (
        Check("fall", 0.0, "", 0.0),
        Check("slip", 0.02, "m", 0.03),
        Check("goal distance", 0.3, "m", float("inf")),
        Check("torque ratio", 1.0),
    )
    moves = tuple(
        Move(t.limb, end - t.timing.swing, end, None if t.contact is None else t.contact.pose.position)
        for t, end in zip(sequence.transitions, ends, strict=True)
    )
    execution = Execution(
        scene=scene,
        standard=Standard(Subject.of(robot), world.goal, TIMESTEP, 2, len(ticks), 0.02, 0.02, moves),
        controls=Controls(
            timestep=TIMESTEP,
            qpos0=np.array(scene.qpos0),
            qvel0=np.zeros(scene.nv),
            ctrl=rng.standard_normal((2 * len(ticks), scene.nu)),
            final_qpos=qpos[-1] + 1e-3,
        ),
        samples=Samples(
            tick_times=ticks,
            tick_seconds=np.full(len(ticks), 1e-3),
            qpos=qpos,
            qvel=np.zeros((len(ticks), scene.nv)),
            com=centre + noise,
            com_planned=centre,
            com_aim=centre,
            momentum=np.hstack([60 * noise, noise]),
            momentum_planned=np.zeros((len(ticks), 6)),
            may_touch=wrench[..., 2] > 0,
            wrench=wrench + np.where(wrench != 0, rng.standard_normal(wrench.shape), 0.0),
            wrench_planned=wrench,
            cop_margin=np.where(wrench[..., 2] > 0, 0.05, np.nan),
            limb_pose=limb_pose + 1e-4,
            torque=np.zeros((len(ticks), scene.nu)),
            torque_ratio=0.5 + 0.1 * np.sin(ticks),
        ),
        touchdowns=touchdowns,
        slip=tuple(np.linspace(0, 0.01, len(sequence.transitions) + 1)),
        scuffs=(Scuff(0, sequence.transitions[0].limb, 0.5, 0.004, 80.0, 0.2),),
        completed=True,
        fall=None,
        goal_reached=True,
        final_goal_distance=0.1,
        max_slip=0.01,
        max_scuff=0.003,
        max_touchdown_error=0.002,
        max_torque_ratio=0.6,
        max_velocity_ratio=0.3,
        com_rms_error=0.002,
        solver_failures=0,
        unplanned_contacts=(("trunk", "floor"),),
        simulated_seconds=float(schedule.duration),
        real_time_factor=1.2,
        checks=checks,
        failure=FAILURE,
    )
    count = len(sequence.transitions)
    predicted = np.array([stance.mean_feet.position + [0, 0, 0.9] for stance in sequence.stances])
    solutions = tuple(
        Solution(sequence, cost, bound, seconds, predicted, 0 * predicted, np.ones(count), cost)
        for cost, bound, seconds in ((9.0, np.inf, 0.1), (7.0, 1.4, 0.6))
    )
    expanded = np.column_stack([np.linspace(0, 1, 50), 0.1 * np.sin(np.arange(50)), np.zeros(50)])
    search = SearchResult(solutions, 1.0, 0.2, 50, False, expanded, "")
    plan = WholeBodyPlan(robot, world, sequence, schedule, motion, scene, LimbPaths(()), trajectory)
    poor = MotionPlan(robot, world, sequence, schedule, replace(motion, feasible=False))
    refused = Failure("no feasible centroidal motion: it stretches")
    config = PipelineConfig(seed=3)
    candidates = tuple(
        Candidate(number, Source.SEARCH, 0, item.seconds, item, made, plan_cost(made, config.cost), failure)
        for number, (item, made, failure) in enumerate(zip(solutions, (poor, plan), (refused, None), strict=True))
    )
    trial = Trial(candidates[-1], plan, execution, FAILURE)
    result = PipelineResult(robot, world, config, search, trial, candidates, (trial,), FAILURE.reason)
    return MadeUpRun(result, plan, execution, RunReport.of(result, 0.1))


@pytest.fixture(scope="session")
def run() -> MadeUpRun:
    """The run, made once."""
    return make_run()
