"""What a person looks at: recording, tables, plots, pictures, files."""
