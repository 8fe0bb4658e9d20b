"""From the sensor logs of a hydraulic cylinder to a served, real-time friction estimate."""
