"""From the logger's time stamps to one constant sample rate."""
