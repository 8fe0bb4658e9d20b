"""What one estimate costs at batch 1 on one core, in every runtime, in one run, beside the floor of the machine."""
