"""What transitions cost, and what the way to the goal costs at least."""
