"""Contact search: `anytime` graph search, `states`, `moves` between them, their `costs`; then strategies and planner."""
