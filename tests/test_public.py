"""What users import from the package itself."""

import os
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

import toolkit

ROOT = Path(__file__).resolve().parent.parent


def test_every_public_name_is_where_it_is_said_to_be():
    assert sorted(toolkit.__all__) == sorted(toolkit._HOMES)
    for name, home in toolkit._HOMES.items():
        assert getattr(toolkit, name) is getattr(import_module(home), name)
        assert name in dir(toolkit)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'load_robots'"):
        toolkit.load_robots  # noqa: B018


def test_the_package_itself_imports_nothing_heavy():
    code = (
        "import sys, toolkit; print([m for m in ('numpy', 'mujoco', 'numba', 'casadi', 'rerun') if m in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


LATE = (
    *("casadi", "contourpy", "imageio", "matplotlib", "networkx", "pandas", "pinocchio", "placo", "rerun", "rich"),
    *("scipy.optimize", "scipy.sparse", "scipy.spatial", "scipy.special", "scipy.stats", "torch", "trimesh"),
)
"""What the pipeline and the reader of worlds leave to the functions that need it."""


def test_the_pipeline_and_the_worlds_import_nothing_that_a_function_can_import_when_it_is_called():
    late = f"[name for name in {LATE!r} if name in sys.modules]"
    code = f"import sys, toolkit.pipeline, toolkit.world.loader; print({late})"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_the_options_of_a_command_are_read_before_anything_heavy_is_imported():
    code = (
        "import sys, toolkit.validate as command; command.arguments(); "
        "print([m for m in ('numpy', 'mujoco', 'numba', 'multiprocessing') if m in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_the_package_says_that_it_is_typed():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert settings["tool"]["setuptools"]["package-data"]["toolkit"] == ["py.typed"]
    assert (ROOT / "toolkit" / "py.typed").is_file()


PROGRAM = """
import hashlib
from toolkit import PipelineConfig, load_robot, load_world, make_planner, run
robot, world = load_robot(None), load_world("worlds/flat.xml")
planner = make_planner(robot, world, "kinematic")
result = run(robot, world, planner, PipelineConfig(seed=1, time_limit=600.0))
print(result.passed, hashlib.sha256(result.trial.execution.samples.qpos.tobytes()).hexdigest())
"""


@pytest.mark.slow
def test_a_program_with_one_thread_for_matrix_products_gets_the_same_run_on_any_number_of_cores():
    found = set()
    for threads in ("1", "2", "7"):
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "OMP_NUM_THREADS": threads}
        words = [sys.executable, "-c", PROGRAM]
        done = subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
        found.add(done.stdout)
    assert len(found) == 1 and found.pop().startswith("True ")
