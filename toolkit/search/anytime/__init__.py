"""Anytime search of any graph: ANA* and its open list."""
