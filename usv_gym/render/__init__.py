"""The map: a scene in metres from a world or an archive, and the pictures drawn from it."""
