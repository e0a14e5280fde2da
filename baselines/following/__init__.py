"""Controllers that follow a timed path: one interface, `follower.Follower`."""
