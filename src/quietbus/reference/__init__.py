"""The satellite a second time: read from the scenario's data, moved by MuJoCo.

Nothing in here knows the parts of quietbus that it is to check: it takes nested dictionaries, as
``Scenario.to_dict`` gives them, and uses NumPy, SciPy and MuJoCo alone (an import contract says
so). The laws of controller, steering, servos, guidance and loads are written down once more, from
docs/scenario.md and docs/theory.md.
"""
