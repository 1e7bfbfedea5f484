"""Numbers that judge an episode."""
