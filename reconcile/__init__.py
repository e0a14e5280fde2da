"""Find, name, add, show: where simulation and measurement disagree, and which physical effect is missing."""
