"""What users import from the package itself."""

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


def test_the_package_says_that_it_is_typed():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert settings["tool"]["setuptools"]["package-data"]["toolkit"] == ["py.typed"]
    assert (ROOT / "toolkit" / "py.typed").is_file()
