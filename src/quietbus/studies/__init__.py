"""What a scenario is asked: a study each for linear analysis, jitter, platforms, pointing."""
