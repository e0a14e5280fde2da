"""OPC UA: the signals as nodes, methods for a planner, alarms as events; roles from certificates."""
