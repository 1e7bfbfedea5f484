"""Where worlds come from: files, families, and commands to a running world."""
