"""The live picture for Foxglove: signals, machine model, scene and log over a WebSocket; nothing comes in."""
