"""ROS 2 over Cyclone DDS, without a ROS installation: topics of the signals, targets; this computer only."""
