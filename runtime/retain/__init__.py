"""Values that outlive a power cut, saved by a process of its own."""
