"""COLREGs on truth: encounters over time, rule scores with their reasons, temporal-logic requirements."""
