"""Output for people: recording, tables, plots, pictures, files."""
