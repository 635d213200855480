"""Rivals of the planner: mixed-integer programs, SL1M's relaxation, A* and RRT, all written from their ideas."""
