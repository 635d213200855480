"""Which of a world's simulation options count: none; those that would change physics are refused."""

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
"""Options that say how to compute, or that concern actuators: every run has its own. All others are refused."""
REPLACED_FLAGS = frozenset(
    "warmstart midphase eulerdamp nativeccd multiccd island sensor autoreset energy fwdinv invdiscrete sleep".split()
)
"""The same of the flags."""


def set_options(option: mujoco.MjOption) -> None:
    """Default options but for the integrator, the cone and the gravity that every run uses."""
    copy_fields(mujoco.MjSpec().option, option)
    option.timestep = 0.002
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 100.0
    option.gravity = [0.0, 0.0, -9.81]
    if hasattr(mujoco.mjtEnableBit, "mjENBL_MULTICCD"):  # the default since MuJoCo 4
        option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_MULTICCD)


def check_options(path: Path, option: mujoco.MjOption) -> None:
    """Raise for options that planner and simulation would have to know, and do not.

    Args:
        path: the world, for the message.
        option: the world's options.

    Raises:
        WorldError: an option or a flag that changes physics is not at MuJoCo's default.
    """
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
    """Members of the bits of `disableflags` or `enableflags`."""
    kind = mujoco.mjtDisableBit if name == "disableflags" else mujoco.mjtEnableBit
    return [flag for label, flag in kind.__members__.items() if not label.startswith("mjN")]


def flag_name(flag: Any) -> str:
    """A flag as the MJCF has it."""
    return flag.name.partition("_")[2].lower()
