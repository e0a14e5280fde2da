"""What a model leaves: errors ahead, missing forces, and where they gather."""
