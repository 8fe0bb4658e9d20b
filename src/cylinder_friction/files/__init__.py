"""Files that appear whole, their hashes, and locks: what the product, the live service and monitoring all need."""
