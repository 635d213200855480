"""The page that sets our figures beside the paper's: its tables, its figures and its sentences."""
