"""Friction of many cylinders while they work: sessions, a page, MQTT, OPC UA, metrics."""
