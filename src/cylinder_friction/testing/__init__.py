"""Contract suites and golden trajectories, also for estimators of your own."""
