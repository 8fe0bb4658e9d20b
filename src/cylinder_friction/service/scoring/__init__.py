"""The served model behind HTTP: an ASGI application with limits, tokens, metrics and reloading."""
