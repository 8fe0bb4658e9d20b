"""Ways into and out of the live service beside its WebSocket: MQTT, Sparkplug B, OPC UA, line protocol."""
