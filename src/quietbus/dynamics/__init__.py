"""Equations of motion of the whole satellite and what follows from them."""
