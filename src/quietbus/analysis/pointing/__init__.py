"""Pointing metrics of image motion: exposure windows, noise, statistics, image quality."""
