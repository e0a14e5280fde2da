"""Every fault that the runtime must survive, injected at random moments, its reaction and time measured."""
