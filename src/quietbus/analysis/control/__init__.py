"""The isolator's channels and modes, and the attitude loop closed through it."""
