"""Tables for the terminal: a file for each command that prints some."""
