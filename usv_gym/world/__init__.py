"""Truth: the record of a world and the kernels that move it."""
