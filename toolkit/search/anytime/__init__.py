"""Anytime search of any graph: ANA*, its open list, searches in turn."""
