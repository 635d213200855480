"""Anytime contact search: ANA*, heuristic, planner, baselines."""
