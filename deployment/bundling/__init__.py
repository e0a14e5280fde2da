"""Bundles: a controller's equations and the control core, compiled into a folder that the runtime loads."""
