"""Shadow mode seen afterwards: what the controller would have done, how close the reference machine is."""
