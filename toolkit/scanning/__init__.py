"""From what a scanner, a survey or a CAD program gives to a world: planar patches with friction, and obstacles."""
