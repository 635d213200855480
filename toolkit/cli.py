"""What every command line shares: options, one line per error, exit codes."""

from __future__ import annotations

import argparse
import io
import logging
import math
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from toolkit.errors import InputError, ToolkitError
from toolkit.interruption import end_when_stopped
from toolkit.world.timing import LONGEST, Timing, Timings

if TYPE_CHECKING:
    from toolkit.execution.config import ExecutionConfig
    from toolkit.search.planner import PlannerConfig

WORLD = "MJCF scene with sites named start and goal, or the name of a world that comes with the toolkit"
EXIT_CODES = "exit codes: 0 success, 1 a plan or check failed (the reason is printed), 2 bad input"


LARGEST = 2**31 - 1
"""Largest count that a command accepts, and the largest seed: what every library behind it can hold."""


_PERSISTENCE = 5  # times the limit on expansions that a search without a solution has

_BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""How many threads a library of matrix products takes: one, since more of them change a result's last digits, and the
matrices are small."""


class _Parser(argparse.ArgumentParser):
    """A parser that says in one line what is wrong with a command line."""

    def error(self, message: str) -> NoReturn:
        """Leave with exit code 2."""
        self.exit(2, f"error: {' '.join(message.split())}; see {self.prog} --help\n")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse; `--option=--`, of which argparse makes an empty list, is a mistake."""
        words = sys.argv[1:] if args is None else list(args)
        for word in words:
            if word.startswith("--") and word.endswith("=--"):
                self.error(f"argument {word[:-3]}: -- is no value")
        return super().parse_known_args(words, namespace)

    def print_help(self, file: Any = None) -> None:
        """Print the help; unlike argparse's own, this notices where it cannot be printed."""
        (file or sys.stdout).write(self.format_help())


def parser(module: str, description: str, epilog: str = "") -> argparse.ArgumentParser:
    """Argument parser of `python -m toolkit.<module>` whose help teaches."""
    return _Parser(
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


def add_cluster_options(target: argparse.ArgumentParser) -> None:
    """Add `--cluster` and `--cluster-unencrypted`."""
    target.add_argument(
        "--cluster",
        metavar="ADDRESS",
        help="scheduler of a dask cluster to run on instead, tls://HOST:PORT with the certificates of dask's own "
        "settings; tcp://HOST:PORT only on this machine",
    )
    target.add_argument(
        "--cluster-unencrypted",
        action="store_true",
        help="use a scheduler on another machine without TLS: anyone in its network can run programs there and here",
    )


def add_planning_options(target: argparse.ArgumentParser) -> None:
    """Add what every command that plans understands."""
    target.add_argument("--seed", type=seed, default=0, help="seed of every random draw (default: %(default)s)")
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
        help="seconds of shifting the CoM and of moving the limb, e.g. 0.4,0.6 or the paper's 1,1; auto: the planner "
        "chooses for each transition; a second costs as much as 20 m of way, with auto as 60 m (default: the world's, "
        "or auto where it names none)",
    )
    target.add_argument(
        "--time-limit",
        type=positive(float),
        default=30.0,
        metavar="S",
        help="time limit of the search (default: %(default)s)",
    )
    target.add_argument(
        "--expansions",
        type=positive(int),
        default=1000,
        metavar="N",
        help="states that the search expands at most, whatever the time (five times as many while nothing is found, "
        "ten times where feet have to slide, until N find nothing better); reproducible (default: %(default)s)",
    )
    target.add_argument("--no-palms", action="store_true", help="plan with the feet alone")
    target.add_argument("--steps", type=int, choices=(38, 60), default=60, help="foot transition model (default: 60)")
    target.add_argument(
        "--heuristic",
        choices=("grid", "euclidean"),
        default="grid",
        help="heuristic of the search (default: %(default)s)",
    )


@dataclass(frozen=True)
class PlanningOptions:
    """What `add_planning_options` understands, but for the seed.

    Attributes:
        planner: Who judges transitions (see `toolkit.pipeline.planner.make_planner`).
        timing: Times that a transition may take; see `toolkit.world.timing.Timings`.
        time_limit: s of the search.
        expansions: States that the search expands at most; None for any number.
        no_palms: Whether to plan with the feet alone.
        steps: Size of the foot transition model.
        heuristic: Heuristic of the search.
    """

    planner: str = "auto"
    timing: Timings = ()
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
            search=AnaStarConfig(max_expansions=self.expansions, persistence=_PERSISTENCE),
        )


def add_disturbance_options(target: argparse.ArgumentParser) -> None:
    """Add what may differ between the simulation and the plan; nothing does by default."""
    group = target.add_argument_group("disturbances", "what differs between the simulation and the plan")
    group.add_argument("--push", type=_finite, default=0.0, metavar="N", help="horizontal push at the base, for 0.2 s")
    group.add_argument(
        "--mass-error", type=_finite, default=0.0, metavar="X", help="error of the mass as a fraction, e.g. 0.05"
    )
    group.add_argument(
        "--friction-error",
        type=_finite,
        default=0.0,
        metavar="X",
        help="error of the friction as a fraction, e.g. -0.1",
    )
    group.add_argument(
        "--terrain-error",
        type=_terrain_error,
        default=(0.0, 0.0),
        metavar="M,DEG",
        help="surfaces lie elsewhere by up to so many metres and degrees, e.g. 0.01,2",
    )
    group.add_argument(
        "--state-noise",
        type=_finite,
        default=0.0,
        metavar="X",
        help="noise of the state in m and rad, and ten times as much in m/s and rad/s",
    )
    group.add_argument(
        "--delay", type=_finite, default=0.0, metavar="S", help="delay of the state that the controller is told"
    )


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
    return {k: v for k, v in values if _is_plain(v) and k not in ("seed", "out")}


def _is_plain(value: Any) -> bool:
    """Whether a report keeps this value of an option: a number, a word, a path, or some numbers."""
    if isinstance(value, tuple) and value:
        return all(isinstance(part, float) for part in value)
    return isinstance(value, (bool, int, float, str, Path))


def kept_options(options: dict[str, Any]) -> dict[str, Any]:
    """Values for `add_disturbance_options` and `add_execution_options` from the options that a report keeps.

    Raises:
        InputError: a value is none that these options can have.
    """
    found: dict[str, Any] = {}
    for name in ("push", "mass_error", "friction_error", "state_noise", "delay"):
        if name in options:
            found[name] = _kept_number(name, options[name])
    if "terrain_error" in options:
        parts = options["terrain_error"]
        if not isinstance(parts, list) or len(parts) != 2:
            raise InputError(f"options.terrain_error is {parts!r} in the report, must be two numbers")
        found["terrain_error"] = tuple(_kept_number("terrain_error", part) for part in parts)
    if "replanning" in options:
        found["replanning"] = options["replanning"] is True
    return found


def _kept_number(name: str, value: Any) -> float:
    """A finite number of a report."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise InputError(f"options.{name} is {value!r} in the report, must be a number")
    return float(value)


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


def timing(text: str) -> Timings:
    """An argparse type: `shift,swing` in seconds, or `auto`."""
    if text == "auto":
        return text
    try:
        shift, swing = (float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not SHIFT,SWING in seconds, nor auto") from None
    if not (0 < shift <= LONGEST and 0 < swing <= LONGEST):
        raise argparse.ArgumentTypeError(f"{text}: both times must be above zero and at most {LONGEST:g} s")
    return (Timing(shift, swing),)


def path(text: str) -> Path:
    """An argparse type: a path that names something."""
    if not text:
        raise argparse.ArgumentTypeError("is empty; give a path")
    return Path(text)


def seed(text: str) -> int:
    """An argparse type: the seed of random draws."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if not 0 <= value <= LARGEST:
        raise argparse.ArgumentTypeError(f"{text}: give a whole number from 0 to {LARGEST}")
    return value


def at_least_zero(text: str) -> float:
    """An argparse type: a finite number that is not negative."""
    value = _finite(text)
    if value < 0.0:
        raise argparse.ArgumentTypeError(f"{text} is below zero")
    return value


def positive(kind: Callable[[str], float], largest: float | None = None) -> Callable[[str], float]:
    """An argparse type: a finite number of `kind` above zero and at most `largest`, which for counts is `LARGEST`."""
    most = LARGEST if largest is None and kind is int else largest

    def convert(text: str) -> float:
        value = kind(text)
        if not 0 < value < float("inf"):
            raise argparse.ArgumentTypeError(f"{text} is not above zero")
        if most is not None and value > most:
            raise argparse.ArgumentTypeError(f"{text} is above {most}, the most that is accepted")
        return value

    convert.__name__ = f"positive {kind.__name__}"
    return convert


def run(main: Callable[[list[str] | None], int], argv: list[str] | None = None) -> None:
    """Call `main` and leave with its exit code.

    Whatever a user can cause is one line on standard error: an error of the toolkit, a file that cannot be read, a
    standard output that takes nothing, a signal.
    """
    end_when_stopped()
    os.environ.update(dict.fromkeys(_BLAS_THREADS, "1"))
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # that it found no folder for its cache is no news
    code, line = _called(main, argv)
    if line:
        sys.stderr.write(line + "\n")
    sys.exit(code)


def _called(main: Callable[[list[str] | None], int], argv: list[str] | None) -> tuple[int, str]:
    """Exit code of `main`, and the line for standard error, "" for none."""
    code, line = 0, ""
    try:
        _check_surroundings()
        try:
            code = main(argv)
        except SystemExit as left:  # argparse has said why
            code = left.code if isinstance(left.code, int) else 0
        sys.stdout.flush()
    except ToolkitError as error:
        code, line = error.exit_code, f"error: {' '.join(str(error).split())}"
    except BrokenPipeError:
        code = 1
    except OSError as error:
        where = "standard output" if error.filename is None else os.fsdecode(error.filename)
        code, line = 2, f"error: {where}: {error.strerror or error}"
    if sys.stdout is not None:
        try:
            sys.stdout.flush()
        except OSError:  # what is left in its buffer has nowhere to go
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code, line


def _check_surroundings() -> None:
    """See that there are standard streams that take any text, and a working directory.

    Raises:
        InputError: standard output is closed, or the working directory is gone.
    """
    closed = sys.stdout is None
    for descriptor in range(3):  # else the next file that is opened becomes a standard stream
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")
    if closed:
        raise InputError("standard output is closed; send it to /dev/null where it is not wanted")
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        os.getcwd()
    except OSError:
        raise InputError("the working directory no longer exists; change into another one") from None
