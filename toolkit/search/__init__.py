"""Contact search: `anytime` search of graphs, `states`, `moves` and their `costs`; then strategies and planner."""
