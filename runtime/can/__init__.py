"""CAN of the runtime: codec and protection from the specs, buses, joysticks, a local bus without hardware."""
