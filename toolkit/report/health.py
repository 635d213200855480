"""What an installation can do: packages, robots and networks, the kernels' cache, renderers, a walk."""

from __future__ import annotations

import importlib.metadata
import os
import platform
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from time import perf_counter

from packaging.requirements import Requirement

from toolkit.compiled import kept_folder
from toolkit.errors import NetworkError, PackageError, RobotError, ToolkitError
from toolkit.pipeline import Observer, PipelineConfig, make_planner, run
from toolkit.pipeline.warmup import lacking, listed, warm_up
from toolkit.prediction.networks import load_networks
from toolkit.report.offscreen import REMEDY, why_not
from toolkit.robot.loader import default_robot, find_robots, load_robot, robots_folder
from toolkit.robot.model import RobotModel
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.planner import PlannerConfig
from toolkit.world.loader import load_world

PACKAGE = "humanoid-contact-toolkit"
RENDERERS = ("egl", "osmesa", "glfw")
STRIDES = 2.8  # heights of the CoM that the walk leads ahead: some ten seconds
EXPANSIONS = 200  # of the search; more would only polish the walk
_WALK = """
<mujoco>
  <custom><numeric name="transition_timing" data="0.4 0.6"/></custom>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" friction="0.7"/>
    <site name="start" pos="0 0 0"/>
    <site name="goal" type="cylinder" pos="{ahead:.3f} 0 0" size="0.2 0.01"/>
  </worldbody>
</mujoco>
"""


class State(Enum):
    """How a finding is to be taken."""

    GOOD = "ok"
    NOTE = "note"
    """Something that not everybody needs is missing."""
    BAD = "FAIL"


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at, how it is, and what to do about it in one line."""

    name: str
    state: State
    detail: str


def check_packages() -> Iterator[Finding]:
    """Whether the packages that the toolkit names are there in releases that it accepts."""
    yield Finding("python", State.GOOD, platform.python_version())
    try:
        wanted = importlib.metadata.requires(PACKAGE) or []
        yield Finding(PACKAGE, State.GOOD, importlib.metadata.version(PACKAGE))
    except importlib.metadata.PackageNotFoundError:
        yield Finding(PACKAGE, State.BAD, "is not installed; pip install it, or -e . in a checkout")
        return
    for requirement in map(Requirement, wanted):
        needed = requirement.marker is None or requirement.marker.evaluate({"extra": ""})
        name = f"{requirement.name}{requirement.specifier}"
        try:
            found = importlib.metadata.version(requirement.name)
        except importlib.metadata.PackageNotFoundError:
            state = State.BAD if needed else State.NOTE
            why = "is not installed" if needed else "is not installed; only some commands need it"
            yield Finding(requirement.name, state, f"{why}; pip install '{name}'")
            continue
        if requirement.specifier.contains(found, prereleases=True):
            yield Finding(requirement.name, State.GOOD, found)
        else:
            state = State.BAD if needed else State.NOTE
            yield Finding(requirement.name, state, f"{found} does not fit; pip install '{name}'")


def check_robots(folder: Path | None = None) -> Iterator[Finding]:
    """Whether the robots in a folder can be loaded, and have networks that fit them."""
    names = find_robots(folder)
    if not names:
        yield Finding("robots", State.BAD, f"none in {robots_folder(folder)}; name their folder with --robots")
        return
    try:
        yield Finding("robots", State.GOOD, f"in {robots_folder(folder)}; the default is {default_robot(folder)}")
    except RobotError as error:
        yield Finding("robots", State.NOTE, str(error))
    for name in names:
        try:
            robot = load_robot(name, folder)
        except PackageError as error:
            yield Finding(name, State.NOTE, str(error))
            continue
        except RobotError as error:
            yield Finding(name, State.BAD, str(error))
            continue
        yield Finding(
            name, State.GOOD, f"{robot.mass:.1f} kg, {len(robot.joint_names)} joints, {len(robot.limbs)} limbs"
        )
        yield _check_networks(robot)


def _check_networks(robot: RobotModel) -> Finding:
    """Whether the networks in a robot's folder, if any, fit it."""
    name = f"{robot.name}, networks"
    if not (robot.folder / "networks").is_dir():
        return Finding(name, State.NOTE, "none: the search leaves the dynamics out; see python -m toolkit.train --help")
    try:
        return Finding(name, State.GOOD, f"{len(load_networks(robot))} that fit the robot")
    except NetworkError as error:
        return Finding(name, State.BAD, str(error))


def check_cache() -> Finding:
    """Whether compiled kernels are kept from one run to the next."""
    folder = kept_folder()
    if folder is None:
        detail = "no folder can be written: every run compiles for a minute; set NUMBA_CACHE_DIR to one that can"
        return Finding("kernel cache", State.NOTE, detail)
    return Finding("kernel cache", State.GOOD, str(folder))


def check_kernels() -> Iterator[Finding]:
    """Whether the kernels that a run needs are compiled; nothing where they cannot be kept."""
    if kept_folder() is not None:
        number, left = len(listed()), len(lacking())
        detail = f"{number - left} of {number} are compiled"
        detail += "; the next run that needs the others compiles them" if left else ""
        yield Finding("kernels", State.NOTE if left else State.GOOD, detail)


def check_renderers() -> Iterator[Finding]:
    """Which of MuJoCo's renderers work; pictures and videos need the first or the second."""
    # MuJoCo sets this variable for the renderer that this process uses; the others would refuse it.
    environment = {name: value for name, value in os.environ.items() if name != "PYOPENGL_PLATFORM"}
    reasons = {name: why_not(name, environment) for name in RENDERERS}
    for name, reason in reasons.items():
        yield Finding(f"renderer {name}", State.NOTE if reason else State.GOOD, reason or "works")
    if reasons["egl"] and reasons["osmesa"]:
        yield Finding("pictures", State.NOTE, f"cannot be drawn off screen: {REMEDY}")


def check_walk(name: str | None, folder: Path | None, observer: Observer) -> Finding:
    """Whether a robot walks over a flat world of its own size for some ten seconds."""
    began = perf_counter()
    try:
        with warm_up(observer):
            robot = load_robot(name, folder)
            world = load_world(Path("walk.xml"), mjcf=_WALK.format(ahead=STRIDES * robot.com_height))
        planner = make_planner(robot, world, config=PlannerConfig(search=AnaStarConfig(max_expansions=EXPANSIONS)))
        result = run(robot, world, planner, PipelineConfig(), observer)
    except ToolkitError as error:
        return Finding("walk", State.BAD, str(error))
    took = f"took {perf_counter() - began:.0f} s"
    if not result.passed or result.trial is None or result.trial.execution is None:
        return Finding("walk", State.BAD, f"{robot.name}: {result.reason}; {took}")
    seconds = result.trial.execution.simulated_seconds
    return Finding("walk", State.GOOD, f"{robot.name} walked for {seconds:.1f} s, every check passed; {took}")
