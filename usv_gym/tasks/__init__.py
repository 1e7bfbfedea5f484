"""The decision problem: actions, observations, rewards, ends of an episode."""
