"""Model predictive control along a path: sway predicted, things kept off by their distances."""
