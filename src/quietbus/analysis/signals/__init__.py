"""Signals as sampled: spectra, residuals, measured waterfalls of spectra."""
