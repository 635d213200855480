"""The simulation options of a world: none is used, and those that would change the physics are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from toolkit.errors import WorldError
from toolkit.mjcf import copy_fields, fields_of

REPLACED = frozenset(
    """
    timestep integrator cone impratio jacobian solver iterations tolerance ls_iterations ls_tolerance noslip_iterations
    noslip_tolerance ccd_iterations ccd_tolerance sdf_initpoints sdf_iterations sleep_tolerance disableactuator
    """.split()
)
"""Options of the computation or of actuators, which every run replaces. All others are refused."""
REPLACED_FLAGS = frozenset(
    "warmstart midphase eulerdamp nativeccd multiccd island sensor autoreset energy fwdinv invdiscrete sleep".split()
)
"""Flags that every run replaces. All others are refused."""


def set_options(option: mujoco.MjOption) -> None:
    """Set the default options, with the time step, integrator, cone and gravity that every run uses."""
    copy_fields(mujoco.MjSpec().option, option)
    option.timestep = 0.002
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 100.0
    option.gravity = [0.0, 0.0, -9.81]
    if hasattr(mujoco.mjtEnableBit, "mjENBL_MULTICCD"):  # the default since MuJoCo 4
        option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_MULTICCD)


def check_options(path: Path, option: mujoco.MjOption) -> None:
    """Raise WorldError if an option or a flag that changes the physics of a world is not MuJoCo's default."""
    default = mujoco.MjSpec().option
    default.gravity = [0.0, 0.0, -9.81]
    for name, value in fields_of(option):
        usual = getattr(default, name)
        if name in ("disableflags", "enableflags"):
            for flag in flags_of(name):
                if (value ^ usual) & flag.value and flag_name(flag) not in REPLACED_FLAGS:
                    raise WorldError(
                        f"{path}: flag '{flag_name(flag)}' of <option> is not as usual, and would change the physics "
                        "that planner and simulation share; remove it"
                    )
        elif name not in REPLACED and not np.array_equal(value, usual):
            given, known = (" ".join(f"{number:g}" for number in np.ravel(v)) for v in (value, usual))
            raise WorldError(
                f"{path}: option {name} is {given}; planner and simulation know only {known}; remove it from <option>"
            )


def flags_of(name: str) -> list[Any]:
    """The flags of `disableflags` or of `enableflags`."""
    kind = mujoco.mjtDisableBit if name == "disableflags" else mujoco.mjtEnableBit
    return [flag for label, flag in kind.__members__.items() if not label.startswith("mjN")]


def flag_name(flag: Any) -> str:
    """Name of a flag in MJCF."""
    return flag.name.partition("_")[2].lower()
