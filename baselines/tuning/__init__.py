"""Gains by search on re-drawn machines, the same budget for every controller: `slewright tune NAME`."""
