"""Errors of the toolkit: one base class and a subclass for each kind.

A message names the file or the element at fault, its value and the remedy in one line. Command lines print that line
and exit with `exit_code`.
"""


class ToolkitError(Exception):
    """Base of every error that a user can cause or remedy."""

    exit_code = 2


class InputError(ToolkitError):
    """An argument or a file given by the user cannot be used."""


class WorldError(InputError):
    """A world file is broken, incomplete, or asks for something unsupported."""


class RobotError(InputError):
    """A robot folder is missing, broken, or inconsistent."""


class PackageError(RobotError):
    """A robot's model is in a package that is not installed."""


class DatasetError(InputError):
    """A training data set is truncated, or belongs to another robot or problem."""


class NetworkError(InputError):
    """A network file is missing, or its shapes or metadata do not fit."""


class PlanningError(ToolkitError):
    """Planning ended without a result."""

    exit_code = 1


class ExecutionError(ToolkitError):
    """The simulated execution could not be carried out."""

    exit_code = 1


class WorkerError(ToolkitError):
    """A process that did a part of the work ended before its time."""

    exit_code = 1
