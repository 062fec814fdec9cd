"""Harmonic tables of rotors from files: CSV, the S2E simulator's wheel files, and 42's.

A table says how large the line at order h of a rotor is: coefficient times rotor speed squared.
The layouts are documented in docs/import.md.
"""

from quietbus.scenario.wheel_files.read import read_wheel_table
from quietbus.scenario.wheel_files.table import KINDS, WheelTable

__all__ = ["KINDS", "WheelTable", "read_wheel_table"]
