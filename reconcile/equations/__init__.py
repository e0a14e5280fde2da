"""A model with its ports, and the equations with candidate effects attached there."""
