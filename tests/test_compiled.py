"""One door to the compiler: few arguments, and a cache that notices every edit below a compiled function."""

import ast
import json
import os
import shutil
import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import pytest

from toolkit.centroidal.stages import blocks, newton, rows
from toolkit.centroidal.stages.method import minimise
from toolkit.compiled import compiled, digest

ROOT = Path(__file__).resolve().parent.parent
MOST_ARGUMENTS = 12
MODULES = {path.relative_to(ROOT).as_posix(): path for path in sorted((ROOT / "toolkit").rglob("*.py"))}


def decorated(path):
    """Functions of a module that `compiled` or `law` decorates."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef):
            names = {ast.unparse(item.func if isinstance(item, ast.Call) else item) for item in node.decorator_list}
            if names & {"compiled", "law"}:
                yield node


def test_no_compiled_function_has_many_arguments():
    seen, found = 0, set()
    for name, path in MODULES.items():
        for node in decorated(path):
            seen += 1
            given = node.args
            if given.vararg or len(given.posonlyargs + given.args + given.kwonlyargs) > MOST_ARGUMENTS:
                found.add(f"{name}:{node.name}")
    assert seen > 50
    assert not found


def test_only_one_module_imports_numba():
    importing = set()
    for name, path in MODULES.items():
        for node in ast.walk(ast.parse(path.read_text())):
            modules = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            modules += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if any(module.split(".")[0] in ("numba", "llvmlite") for module in modules):
                importing.add(name)
    assert importing == {"toolkit/compiled.py"}


SOURCE = '''
import enum
import numpy as np

LIMIT, TABLE = 3.0, np.arange(3)

class Kind(enum.IntEnum):
    FIRST = 1
    SECOND = 2

def deepest(x):
    return x - 5

def helper(x, power=2):
    """What it does."""
    return deepest(x) ** power * LIMIT  # a remark

def idle(x):
    return x

def function(x):
    """What it does."""
    return helper(x) + TABLE[0] + Kind.FIRST + shared.DEPTH + shared.further(x)
'''
SHARED = "DEPTH, OTHER = 1, 2\ndef further(x):\n    return x + 1\n"


def made(source=SOURCE, shared=SHARED):
    """`function` of a source that reads a module of the package."""
    module = types.ModuleType("toolkit.made")
    exec(shared, module.__dict__)
    namespace = {"__name__": "toolkit.making", "shared": module}
    exec(source, namespace)
    return namespace["function"]


@pytest.mark.parametrize(
    "old, new",
    [
        ("x - 5", "x - 6"),
        ("** power", "* power"),
        ("power=2", "power=3"),
        ("3.0", "3.5"),
        ("arange(3)", "arange(1, 4)"),
        ("TABLE[0]", "TABLE[1]"),
        ("SECOND = 2", "SECOND = 4"),
        ("SECOND", "THIRD"),
        ("+ Kind.FIRST", "- Kind.FIRST"),
        ("DEPTH, OTHER = 1", "DEPTH, OTHER = 3"),
        ("x + 1", "x + 2"),
    ],
)
def test_digest_notices_whatever_a_function_reaches(old, new):
    edited = [text.replace(old, new) for text in (SOURCE, SHARED)]
    assert edited != [SOURCE, SHARED]
    assert digest(made(*edited)) != digest(made())


@pytest.mark.parametrize(
    "old, new",
    [
        ('"""What it does."""', '"""Something else."""'),
        ("  # a remark", ""),
        ("def deepest", "\n\n# A remark.\ndef deepest"),
        ("def idle(x):\n    return x", "def idle(x):\n    return -x"),
        ("OTHER = 1, 2", "OTHER = 1, 7"),
    ],
)
def test_digest_ignores_words_and_what_is_not_reached(old, new):
    edited = [text.replace(old, new) for text in (SOURCE, SHARED)]
    assert edited != [SOURCE, SHARED]
    assert digest(made(*edited)) == digest(made())


def test_digest_of_a_compiled_function_is_that_of_its_source():
    assert digest(compiled(made())) == digest(made())


def test_digest_follows_what_the_compiler_may_do():
    digests = {digest(compiled(made(), **options)) for options in ({}, {"reordered": True}, {"allocates": True})}
    assert len(digests) == 3


@compiled(allocates=True)
def _counted(n):
    return np.zeros(n)


@compiled
def _not_counted(values):
    return values


@compiled
def _handed(n):
    return _counted(n).sum()


@compiled(allocates=True)
def _freed(n):
    return _counted(n).sum()


@pytest.mark.parametrize(("function", "given"), [(_not_counted, np.ones(3)), (_handed, 3)])
def test_references_to_arrays_that_change_hands_are_counted(function, given):
    assert _freed(3) == 0.0
    with pytest.raises(TypeError, match="allocates=True"):
        function(given)


PLAN = """
import gc
import json
from numba.core.runtime import rtsys
from tests.search.worlds import corridor
from toolkit.pipeline import PipelineConfig, make_planner, run
from toolkit.refine.local_search import RefineConfig
from toolkit.robot.loader import load_robot
from toolkit.search.anytime.ana_star import AnaStarConfig
from toolkit.search.planner_config import PlannerConfig

world, robot, counts = corridor(3), load_robot("humanoid30"), []
search = PlannerConfig(search=AnaStarConfig(max_expansions=100))
config = PipelineConfig(until="dynamics", refine=RefineConfig(optimisations=8))
for _ in range(3):
    assert run(robot, world, make_planner(robot, world, "kinematic", search), config).passed
    gc.collect()
    stats = rtsys.get_allocation_stats()
    counts.append(stats.alloc - stats.free)
print(json.dumps([counts, stats.alloc]))
"""


def test_what_kernels_allocate_is_freed():
    environment = dict(os.environ, PYTHONPATH=str(ROOT), NUMBA_NRT_STATS="1")
    done = subprocess.run([sys.executable, "-c", PLAN], env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    counts, allocated = json.loads(done.stdout.splitlines()[-1])
    assert allocated > 1000
    assert counts[0] == counts[1] == counts[2]


@pytest.mark.parametrize("callee", [newton.factor, rows.add_squares, blocks.move])
def test_digest_of_the_solver_follows_its_callees(callee, monkeypatch):
    before, code = digest(minimise), callee.py_func.__code__
    monkeypatch.setattr(callee.py_func, "__code__", code.replace(co_consts=(*code.co_consts, 123.25)))
    assert digest(minimise) != before


RUN = """
import json
import numpy as np
from toolkit.contacts.surface_table import SurfaceTable, _fill
from toolkit.search.moves.legs import Legs, reach
from toolkit.search.moves.reasons import Reason
from toolkit.search.moves.screen import Sole, screen_swings
from toolkit.physics.leg import LIMITS
from toolkit.robot.model import HipJoints

zero, one = np.zeros(1, np.int64), np.ones(1, np.int64)
table = SurfaceTable(
    np.zeros((1, 3)), np.eye(3)[None], np.ones(1), np.ones(1, bool), np.ones(1, bool), np.zeros((1, 4)),
    np.array([0, 1]), np.zeros((1, 3)), np.ones(1), np.zeros(2), 0.1, np.ones(2, np.int64), np.array([0, 1]),
    zero.copy(), np.zeros(1, bool), np.zeros(2, np.int64), np.zeros(0, np.int64),
)
_fill(table, np.array([[0.0, 0.2, 0.1, 0.2]]), zero, np.array([[0, 1, 0, 1]]), 0.16, zero.copy())

ranges = np.tile([-9.0, 9.0], (2, len(LIMITS), 1))
links = np.tile([0.4, 0.4, *HipJoints().numbers], 2)
legs = Legs(np.zeros((2, 3)), np.zeros((2, 3)), links, ranges, np.array([-1.0, 1.0]))
reason, _ = reach(legs, 0, (0.0, 0.0, 0.7), 0.0, np.zeros(3), np.eye(3))

codes = np.empty(1, np.int64)
feet = Sole(np.array([-0.3, 0.1, 0.0]), np.eye(3), 0.0), Sole(np.array([0.0, -0.1, 0.0]), np.eye(3), 0.0)
screen_swings(np.array([[0.3, 0.1, 0.0]]), np.zeros(1), *feet, np.array([0.11, 0.07]), 2.0, 0.04, 0.1, codes)

kernels = (_fill, reach, screen_swings)
print(json.dumps({
    "results": [int(table.near_start[1]), Reason(reason).name, Reason(codes[0]).name],
    "compiled": [sum(kernel.stats.cache_misses.values()) for kernel in kernels],
}))
"""
SOLVER = """
import json
import numpy as np
from toolkit.centroidal.stages.method import minimise
from tests.conftest import sole
from toolkit.centroidal.build import initial_com
from toolkit.centroidal.sequence import optimise_transition
from toolkit.contacts.sequence import ContactTransition
from toolkit.contacts.stance import Stance
from toolkit.geometry.limb import FEET, Limb
from toolkit.robot.loader import load_robot
from toolkit.world.timing import Timing

robot = load_robot(None)
start = Stance(tuple(sole(robot, limb) for limb in FEET))
step = ContactTransition(Limb.LEFT_FOOT, sole(robot, Limb.LEFT_FOOT, 0.1), Timing(0.4, 0.6))
optimise_transition(robot, start, initial_com(robot, start), np.zeros(3), step)
print(json.dumps({"results": [], "compiled": sum(minimise.stats.cache_misses.values())}))
"""


@pytest.fixture
def copy(tmp_path):
    """A copy of the package to edit, and to run programs in."""
    for folder in ("toolkit", "tests", "robots"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))

    def run(program):
        environment = os.environ | {"PYTHONPATH": str(tmp_path)}
        done = subprocess.run(
            [sys.executable, "-c", program], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=600
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    def edit(path, old, new):
        text = (tmp_path / path).read_text()
        assert text.count(old) == 1, path
        (tmp_path / path).write_text(text.replace(old, new))

    return types.SimpleNamespace(run=run, edit=edit)


def test_an_edit_below_a_kernel_turns_the_next_run_around(copy):
    first, again = copy.run(RUN), copy.run(RUN)
    assert first == {"results": [1, "NONE", "NONE"], "compiled": [1, 1, 1]}
    assert again == {"results": [1, "NONE", "NONE"], "compiled": [0, 0, 0]}
    copy.edit("toolkit/contacts/surface_table.py", "return np.hypot(", "return 1.0 + np.hypot(")
    copy.edit("toolkit/physics/leg.py", "com[1] + y, com[2] + z", "com[1] + y, com[2] + z + 9.0")
    copy.edit(
        "toolkit/search/moves/screen.py", "    dx, dy = bx - ax, by - ay\n", "    return True\n    dx, dy = 0, 0\n"
    )
    edited = copy.run(RUN)
    assert edited["compiled"] == [1, 1, 1]
    assert edited["results"] == [0, "LEG_LENGTH", "CROSSES"]


@pytest.mark.slow
def test_an_edit_below_the_solver_turns_the_next_run_around(copy):
    assert [copy.run(SOLVER)["compiled"] for _ in range(2)] == [1, 0]
    factor = "def factor(size, hessian, following, sweep):\n"
    copy.edit("toolkit/centroidal/stages/newton.py", factor, f"{factor}    following = following + 0.0\n")
    assert copy.run(SOLVER)["compiled"] == 1
