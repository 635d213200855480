"""Solvers of linear programs with integers, told by when they had their first plan."""

from __future__ import annotations

import importlib
import importlib.metadata
import importlib.util
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from toolkit.errors import InputError
from validation.rivals.linear import Builder, LinearProgram

GAP = 0.05
INTEGRAL = 1e-5  # a solver's own tolerance for whole numbers, about


@dataclass(frozen=True)
class Solved:
    """How a solver fared.

    Attributes:
        solver: Its name.
        x: (n,) best values found; None where there are none.
        objective: Of x; inf without one.
        bound: No plan is cheaper; -inf where the solver knows nothing.
        first_seconds: s until the first plan; None without one.
        gap_seconds: s until `GAP` was proved; None where it was not.
        seconds: s in all.
        nodes: Nodes of the tree.
        status: What the solver says.
    """

    solver: str
    x: np.ndarray | None
    objective: float
    bound: float
    first_seconds: float | None
    gap_seconds: float | None
    seconds: float
    nodes: int
    status: str

    @property
    def gap(self) -> float:
        """(objective - bound) / objective; inf without a plan."""
        return (self.objective - self.bound) / max(abs(self.objective), 1e-9) if self.x is not None else np.inf

    def record(self) -> dict[str, Any]:
        """The figures, as JSON can hold them."""
        figures = {name: value for name, value in asdict(self).items() if name != "x"}
        return {**figures, "gap": self.gap, "found": self.x is not None}


def solve_highs(program: LinearProgram, time_limit: float, gap: float = GAP) -> Solved:
    """Solve with HiGHS on one thread; see `Solved`."""
    import highspy

    model = highspy.Highs()
    for option, value in (("output_flag", False), ("threads", 1), ("time_limit", time_limit), ("mip_rel_gap", gap)):
        model.setOptionValue(option, value)
    model.passModel(_highs_model(program))
    first: list[float] = []
    model.cbMipImprovingSolution.subscribe(lambda event: first.append(event.data_out.running_time))
    began = time.perf_counter()
    model.run()
    seconds = time.perf_counter() - began
    info, status = model.getInfo(), model.modelStatusToString(model.getModelStatus())
    whole = bool(program.integer.any())
    found = info.primal_solution_status == 2  # feasible
    objective = float(info.objective_function_value) if found else np.inf
    bound = float(info.mip_dual_bound) if whole else objective
    x = np.array(model.getSolution().col_value) if found else None
    when = (first[0] if first else seconds) if found else None
    return _solved("HiGHS", x, objective, bound, when, seconds, int(info.mip_node_count), status, gap)


def _highs_model(program: LinearProgram) -> Any:
    import highspy

    lp: Any = highspy.HighsLp()
    lp.num_row_, lp.num_col_ = len(program.row_low), len(program.cost)
    lp.col_cost_, lp.col_lower_, lp.col_upper_ = program.cost, program.low, program.high
    lp.row_lower_, lp.row_upper_ = program.row_low, program.row_high
    lp.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    lp.a_matrix_.num_row_, lp.a_matrix_.num_col_ = len(program.row_low), len(program.cost)
    lp.a_matrix_.start_ = program.matrix.indptr
    lp.a_matrix_.index_, lp.a_matrix_.value_ = program.matrix.indices, program.matrix.data
    if program.integer.any():
        kinds = highspy.HighsVarType
        lp.integrality_ = [kinds.kInteger if whole else kinds.kContinuous for whole in program.integer]
    return lp


def solve_scip(program: LinearProgram, time_limit: float, gap: float = GAP) -> Solved:
    """Solve with SCIP on one thread; see `Solved`."""
    import pyscipopt
    from pyscipopt.scip import PY_SCIP_EVENTTYPE as EVENT

    class FirstPlan(pyscipopt.Eventhdlr):
        """Remembers when the first plan came."""

        seconds: float | None = None

        def eventinit(self) -> None:
            """See PySCIPOpt."""
            self.model.catchEvent(EVENT.BESTSOLFOUND, self)

        def eventexit(self) -> None:
            """See PySCIPOpt."""
            self.model.dropEvent(EVENT.BESTSOLFOUND, self)

        def eventexec(self, event: Any) -> None:
            """See PySCIPOpt."""
            if self.seconds is None:
                self.seconds = time.perf_counter() - began

    model, watch = pyscipopt.Model(), FirstPlan()
    model.hideOutput()
    model.setParams({"limits/time": time_limit, "limits/gap": gap, "lp/threads": 1, "timing/clocktype": 2})
    kinds = np.where(program.integer, "B", "C")
    columns = zip(program.low, program.high, program.cost, kinds, strict=True)
    x = [model.addVar(lb=low, ub=high, obj=cost, vtype=str(kind)) for low, high, cost, kind in columns]
    matrix = program.matrix
    for row, (low, high) in enumerate(zip(program.row_low, program.row_high, strict=True)):
        part = slice(matrix.indptr[row], matrix.indptr[row + 1])
        terms = zip(matrix.indices[part], matrix.data[part], strict=True)
        total = pyscipopt.quicksum(float(value) * x[index] for index, value in terms)
        if low == high:
            model.addCons(total == low)
        else:
            if np.isfinite(low):
                model.addCons(total >= low)
            if np.isfinite(high):
                model.addCons(total <= high)
    model.includeEventhdlr(watch, "first plan", "when the first plan came")
    began = time.perf_counter()
    model.optimize()
    seconds = time.perf_counter() - began
    found = model.getNSols() > 0
    best = model.getBestSol() if found else None
    values = None if best is None else np.array([best[variable] for variable in x])
    objective, bound = (float(model.getObjVal()) if found else np.inf), float(model.getDualbound())
    when = watch.seconds if found else None
    return _solved("SCIP", values, objective, bound, when, seconds, int(model.getNNodes()), model.getStatus(), gap)


def solve_gurobi(program: LinearProgram, time_limit: float, gap: float = GAP) -> Solved:
    """Solve with Gurobi on one thread; see `Solved`.

    Raises:
        gurobipy.GurobiError: The licence does not allow it.
    """
    gurobipy = importlib.import_module("gurobipy")
    names = gurobipy.GRB
    first: list[float] = []

    def watch(model: Any, where: int) -> None:
        if where == names.Callback.MIPSOL:
            first.append(model.cbGet(names.Callback.RUNTIME))

    with gurobipy.Env(params={"OutputFlag": 0}) as environment, gurobipy.Model(env=environment) as model:
        model.Params.Threads, model.Params.TimeLimit, model.Params.MIPGap = 1, time_limit, gap
        kinds = np.where(program.integer, names.BINARY, names.CONTINUOUS)
        x = model.addMVar(len(program.cost), lb=program.low, ub=program.high, obj=program.cost, vtype=kinds)
        upper, lower = np.isfinite(program.row_high), np.isfinite(program.row_low)
        model.addConstr(program.matrix[upper] @ x <= program.row_high[upper])
        model.addConstr(program.matrix[lower] @ x >= program.row_low[lower])
        began = time.perf_counter()
        model.optimize(watch)
        seconds = time.perf_counter() - began
        found = model.SolCount > 0
        values, objective = (np.array(x.X), float(model.ObjVal)) if found else (None, np.inf)
        bound = float(model.ObjBound) if model.IsMIP else objective
        when = (first[0] if first else seconds) if found else None
        return _solved("Gurobi", values, objective, bound, when, seconds, int(model.NodeCount), str(model.Status), gap)


def _solved(
    solver: str,
    x: np.ndarray | None,
    objective: float,
    bound: float,
    first: float | None,
    seconds: float,
    nodes: int,
    status: str,
    wanted: float,
) -> Solved:
    """The outcome; the time of the gap is the whole time, since the solver ends where it has proved the gap."""
    found = Solved(solver, x, objective, bound, first, None, seconds, nodes, status)
    proved = found.gap <= wanted + 1e-9
    return Solved(solver, x, objective, bound, first, seconds if proved else None, seconds, nodes, status)


Solver = Callable[..., Solved]
_SOLVERS: dict[str, tuple[str, Solver]] = {
    "HiGHS": ("highspy", solve_highs),
    "SCIP": ("pyscipopt", solve_scip),
    "Gurobi": ("gurobipy", solve_gurobi),
}


def solver_of(name: str) -> Solver:
    """A solver by its name.

    Raises:
        InputError: It is unknown or not installed.
    """
    if name not in _SOLVERS:
        raise InputError(f"solver {name}: choose from {', '.join(_SOLVERS)}")
    package, solver = _SOLVERS[name]
    if importlib.util.find_spec(package) is None:
        raise InputError(f"solver {name}: needs {package}; pip install -e '.[validation]' brings HiGHS and SCIP")
    return solver


def version(name: str) -> str:
    """Version of an installed solver's package."""
    return importlib.metadata.version(_SOLVERS[name][0])


def available(time_limit: float = 5.0) -> list[str]:
    """Names of the solvers that are installed; Gurobi where its licence allows a program of 3000 variables."""
    found = [name for name, (package, _) in _SOLVERS.items() if importlib.util.find_spec(package) is not None]
    if "Gurobi" in found and not _licensed(time_limit):
        found.remove("Gurobi")
    return found


def _licensed(time_limit: float) -> bool:
    """Whether Gurobi has a licence for more than small programs: those of pip allow 2000 variables."""
    gurobipy = importlib.import_module("gurobipy")
    builder = Builder()
    many = builder.variables((3000,), 0.0, 1.0, integer=True)
    builder.row((1.0, many), low=1.0)
    builder.cost(1.0, many)
    try:
        return solve_gurobi(builder.finished(), time_limit).x is not None
    except gurobipy.GurobiError:
        return False
