"""Ways into and out of the live service beside its WebSocket: MQTT and OPC UA."""
