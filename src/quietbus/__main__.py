"""``python -m quietbus``."""

from quietbus.cli import main

main()
