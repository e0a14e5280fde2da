"""Collection: drives a machine through a plan of excitation, safely, and records its sensors."""
