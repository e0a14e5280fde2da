"""What the interfaces beside CAN and Modbus share: the images as they read them, alarms, their end."""
