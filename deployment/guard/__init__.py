"""The guard of the control core put to the test on the simulated reference machine."""
