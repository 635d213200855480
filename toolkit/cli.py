"""What every command line shares: options, one line per error, exit codes."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.errors import InputError, ToolkitError
from toolkit.world.timing import Timing

if TYPE_CHECKING:
    from toolkit.execution.config import ExecutionConfig
    from toolkit.search.planner import PlannerConfig

AUTO_TIMINGS = (Timing(1.0, 1.0), Timing(0.4, 0.6), Timing(0.05, 0.35))
EXIT_CODES = "exit codes: 0 success, 1 a plan or check failed (the reason is printed), 2 bad input"


def parser(module: str, description: str, epilog: str = "") -> argparse.ArgumentParser:
    """Argument parser of `python -m toolkit.<module>` whose help teaches."""
    return argparse.ArgumentParser(
        prog=f"python -m toolkit.{module}",
        description=description,
        epilog=f"{epilog}\n\n{EXIT_CODES}".strip(),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def add_robot_options(target: argparse.ArgumentParser) -> None:
    """Add `--robot` and `--robots`."""
    target.add_argument("--robot", help="folder name under robots/, or a path (default: the one in robots/default)")
    target.add_argument("--robots", type=Path, metavar="DIR", help="folder with the robots (default: robots/)")


def add_planning_options(target: argparse.ArgumentParser) -> None:
    """Add what every command that plans understands."""
    target.add_argument("--seed", type=int, default=0, help="seed of every random draw (default: %(default)s)")
    target.add_argument(
        "--planner",
        choices=("auto", "learned", "optimiser", "kinematic", "quasi-static"),
        default="auto",
        help="who judges the dynamics of a transition in the search: trained networks, the centroidal optimiser, "
        "nobody, or the static balance of every stance; auto: networks where the robot has them, else nobody",
    )
    target.add_argument(
        "--timing",
        metavar="SHIFT,SWING",
        type=timing,
        help="seconds of shifting the CoM and of moving the limb, e.g. 0.4,0.6 (default: the world's), or auto: the "
        "planner chooses for each transition",
    )
    target.add_argument(
        "--time-limit", type=positive(float), default=30.0, metavar="S", help="of the search (default: %(default)s)"
    )
    target.add_argument(
        "--expansions",
        type=positive(int),
        default=1000,
        metavar="N",
        help="states that the search expands at most, whatever the time (three times as many where feet have to "
        "slide); reproducible (default: %(default)s)",
    )
    target.add_argument("--no-palms", action="store_true", help="plan with the feet alone")
    target.add_argument("--steps", type=int, choices=(38, 60), default=60, help="foot transition model (default: 60)")
    target.add_argument(
        "--heuristic", choices=("grid", "euclidean"), default="grid", help="of the search (default: %(default)s)"
    )


@dataclass(frozen=True)
class PlanningOptions:
    """What `add_planning_options` understands, but for the seed.

    Attributes:
        planner: Who judges transitions (see `toolkit.pipeline.planner.make_planner`).
        timing: Times that a transition may take; empty for the world's own.
        time_limit: s of the search.
        expansions: States that the search expands at most; None for any number.
        no_palms: Whether to plan with the feet alone.
        steps: Size of the foot transition model.
        heuristic: Heuristic of the search.
    """

    planner: str = "auto"
    timing: tuple[Timing, ...] = ()
    time_limit: float = 30.0
    expansions: int | None = 1000
    no_palms: bool = False
    steps: int = 60
    heuristic: str = "grid"

    @classmethod
    def of(cls, args: argparse.Namespace) -> PlanningOptions:
        """The options of a parsed command line."""
        return cls(
            planner=args.planner,
            timing=args.timing or (),
            time_limit=args.time_limit,
            expansions=args.expansions,
            no_palms=args.no_palms,
            steps=args.steps,
            heuristic=args.heuristic,
        )

    def planner_config(self) -> PlannerConfig:
        """Settings of the planner."""
        from toolkit.search.anytime.ana_star import AnaStarConfig
        from toolkit.search.planner import PlannerConfig

        return PlannerConfig(
            steps=self.steps,
            palms=not self.no_palms,
            heuristic=self.heuristic,
            timings=self.timing,
            search=AnaStarConfig(max_expansions=self.expansions),
        )


def add_disturbance_options(target: argparse.ArgumentParser) -> None:
    """Add what may differ between the simulation and the plan; nothing does by default."""
    group = target.add_argument_group("disturbances", "what differs between the simulation and the plan")
    group.add_argument("--push", type=_finite, default=0.0, metavar="N", help="horizontal push at the base, for 0.2 s")
    group.add_argument("--mass-error", type=_finite, default=0.0, metavar="X", help="of the robot, e.g. 0.05")
    group.add_argument("--friction-error", type=_finite, default=0.0, metavar="X", help="of the world, e.g. -0.1")
    group.add_argument(
        "--terrain-error",
        type=_terrain_error,
        default=(0.0, 0.0),
        metavar="M,DEG",
        help="surfaces lie elsewhere by up to so many metres and degrees, e.g. 0.01,2",
    )
    group.add_argument(
        "--state-noise", type=_finite, default=0.0, metavar="X", help="m and rad; ten times as many m/s and rad/s"
    )
    group.add_argument("--delay", type=_finite, default=0.0, metavar="S", help="of what the controller is told")


def add_execution_options(target: argparse.ArgumentParser) -> None:
    """Add how a plan is carried out."""
    target.add_argument(
        "--no-replanning",
        dest="replanning",
        action="store_false",
        help="track the plan as it is: do not optimise the next contacts again from the measured state",
    )


def execution_config(args: argparse.Namespace) -> ExecutionConfig:
    """How a plan is carried out (see `add_disturbance_options` and `add_execution_options`).

    Raises:
        InputError: a value is out of range.
    """
    from toolkit.execution.config import ExecutionConfig
    from toolkit.execution.disturbance import Disturbance

    offset, tilt = args.terrain_error
    disturbance = Disturbance(
        push=args.push,
        mass_error=args.mass_error,
        friction_error=args.friction_error,
        terrain_offset=offset,
        terrain_tilt=math.radians(tilt),
        state_noise=args.state_noise,
        delay=args.delay,
    )
    return ExecutionConfig(disturbance=disturbance, replanning=args.replanning)


def plain_options(args: argparse.Namespace) -> dict[str, Any]:
    """The options that a report keeps: numbers, words and paths, but for the seed and the folder, kept elsewhere."""
    values = vars(args).items()
    return {k: v for k, v in values if isinstance(v, (bool, int, float, str, Path)) and k not in ("seed", "out")}


@contextmanager
def whole_file(path: Path, *, parents: bool = False) -> Iterator[Path]:
    """A file to write into, which appears as `path` only when the block has ended without an error.

    Args:
        path: The file.
        parents: Whether to make the folders that it lies in; they are removed again where nothing could be written.

    Raises:
        InputError: the file cannot be written.
    """
    draft = path.with_name(f".{path.name}.tmp")
    made = [folder for folder in path.parents if parents and not folder.exists()]
    try:
        for folder in reversed(made):
            folder.mkdir()
        yield draft
        os.replace(draft, path)
    except OSError as error:
        for remove in (draft.unlink, *(folder.rmdir for folder in made)):
            with suppress(OSError):
                remove()
        raise InputError(f"{path}: cannot be written ({error.strerror or error}); choose another --out") from error


def _terrain_error(text: str) -> tuple[float, float]:
    """An argparse type: metres, or metres and degrees."""
    parts = text.split(",")
    if len(parts) > 2:
        raise argparse.ArgumentTypeError(f"{text!r} is not M,DEG")
    offset, tilt = (_finite(part) for part in (*parts, "0")[:2])
    return offset, tilt


def _finite(text: str) -> float:
    """An argparse type: a finite number."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None
    if not abs(value) < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not finite")
    return value


def timing(text: str) -> tuple[Timing, ...]:
    """An argparse type: `shift,swing` in seconds, or `auto` (an empty choice is the world's own)."""
    if text == "auto":
        return AUTO_TIMINGS
    try:
        shift, swing = (float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not SHIFT,SWING in seconds, nor auto") from None
    if not (0 < shift < float("inf") and 0 < swing < float("inf")):
        raise argparse.ArgumentTypeError(f"{text}: both times must be above zero")
    return (Timing(shift, swing),)


def positive(kind: Callable[[str], float]) -> Callable[[str], float]:
    """An argparse type: a number of `kind` that is finite and above zero."""

    def convert(text: str) -> float:
        value = kind(text)
        if not 0 < value < float("inf"):
            raise argparse.ArgumentTypeError(f"{text} is not above zero")
        return value

    convert.__name__ = f"positive {kind.__name__}"
    return convert


def run(main: Callable[[list[str] | None], int], argv: list[str] | None = None) -> None:
    """Call `main`, turn toolkit errors into one line on stderr, and leave with the exit code."""
    try:
        code = main(argv)
    except ToolkitError as error:
        message = " ".join(str(error).split())
        sys.stderr.write(f"error: {message}\n")
        code = error.exit_code
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        code = 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 1
    sys.exit(code)
