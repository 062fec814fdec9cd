"""What is read from models and runs: isolators, channels, loops, modes, residuals, spectra."""
