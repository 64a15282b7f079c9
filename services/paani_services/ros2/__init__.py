"""The ROS 2 port: what the boat measures, sees and advises, as a node of a ROS graph over Zenoh."""
