"""What every service on the network needs: tokens, refusal of an open door, a log of JSON lines."""
