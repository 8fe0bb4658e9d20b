"""What a friction estimate is worth inside a control loop: the servo rig, closed by a cascade, with and without it."""
