"""Recording: the episode archive, and what a run leaves behind."""
