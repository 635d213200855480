"""The verdict, the figures, the checks and the legend of a run as markdown."""

from __future__ import annotations

import math

from toolkit.pipeline.loop import PipelineResult
from toolkit.report.motion_scene import NEWTON_PER_METRE
from toolkit.report.run_report import RunReport

SIGNS = {"PASS": "✔", "FAIL": "✘", "NOT_CHECKED": "–"}

LEGEND = f"""## Legend

| what | looks like |
|---|---|
| limbs | left foot red, right foot green, left palm cyan, right palm magenta |
| planned contacts | filled rectangles with the number of their transition; thick while they hold |
| made contacts | orange outlines, from touchdown on |
| CoM | predicted by the search violet, optimised blue, executed orange |
| forces | arrows at the centre of pressure, 1 m = {NEWTON_PER_METRE:.0f} N: planned thin, measured thick |
| surfaces | for feet blue, for palms brown |
| search | states from old (blue) to new (yellow): make `world/search` visible |
"""


def summary(report: RunReport) -> str:
    """Markdown text of a run."""
    lines = [f"# {report.verdict}: {report.robot} in {report.world}", ""]
    if report.reason:
        lines += [f"**{report.reason}**", ""]
    planning, execution = report.stages["planning"], report.stages["execution"]
    facts = []
    if planning["contacts"] is not None:
        facts.append(f"{planning['contacts']} transitions, {planning['palm_contacts']} with a palm")
    if planning["first_feasible_seconds"] is not None:
        facts.append(f"first feasible sequence found after {planning['first_feasible_seconds']:.2f} s")
    if execution["simulated_seconds"] is not None:
        pace = f"{execution['real_time_factor']:.2f} x real time"
        facts.append(f"{execution['simulated_seconds']:.1f} s simulated at {pace}")
    facts.append(f"seed {report.seed}")
    lines += [" · ".join(facts), ""]
    if report.checks:
        lines += ["| check | value | limit | result |", "|---|---:|---:|---|"]
        for check in report.checks:
            unit = f" {check.unit}" if check.unit else ""
            value = "–" if check.value is None else f"{check.value:.4g}{unit}"
            lines.append(f"| {check.name} | {value} | {check.limit:.4g}{unit} | {SIGNS[check.result]} {check.result} |")
        lines.append("")
    return "\n".join([*lines, LEGEND])


def search_summary(result: PipelineResult) -> str:
    """Markdown text of a run's search: its figures, a row per solution, and one per sequence that was optimised."""
    search = result.search
    spent = f"{search.seconds:.2f} s, after {search.heuristic_seconds:.2f} s for the heuristic"
    everything = "; every reachable state was expanded" if search.exhausted else ""
    lines = [f"{search.expansions} states expanded in {spent}{everything}.", ""]
    if search.reason:
        lines += [f"**{search.reason}**", ""]
    if search.solutions:
        lines += ["| found after | cost | at most so much above the best | transitions |", "|---:|---:|---:|---:|"]
    for solution in search.solutions:
        above = f"{100 * (solution.bound - 1):.0f} %" if math.isfinite(solution.bound) else "unknown"
        count = len(solution.sequence.transitions)
        lines.append(f"| {solution.seconds:.3f} s | {solution.cost:.3f} | {above} | {count} |")
    if result.candidates:
        lines += ["", "| sequence | found by | transitions | with palms | predicted cost | true cost | |"]
        lines += ["|---:|---|---:|---:|---:|---:|---|"]
        lines += [f"| {' | '.join(row)} |" for row in sequence_rows(result)]
    return "\n".join(lines)


def sequence_rows(result: PipelineResult) -> list[tuple[str, ...]]:
    """Of each sequence that was optimised: number, source, transitions, palm contacts, both costs and the outcome."""
    return [
        (
            str(candidate.number),
            str(candidate.source),
            str(len(candidate.solution.sequence.transitions)),
            str(candidate.palm_contacts),
            f"{candidate.solution.predicted:.1f}" if math.isfinite(candidate.solution.predicted) else "–",
            f"{candidate.cost.total:.1f}" if candidate.feasible else "–",
            "; ".join(filter(None, ("chosen" * result.is_chosen(candidate), result.reason_against(candidate)))),
        )
        for candidate in result.candidates
    ]
