"""Data sets of motions: random worlds, planned and executed, of which the runs that passed are kept as clips."""
