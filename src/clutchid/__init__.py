"""clutchid: from a recording of an electropneumatic clutch actuator to its load."""
