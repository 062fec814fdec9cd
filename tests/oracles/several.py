"""Scenarios of several bodies and of units of both kinds, as docs/scenario.md makes them."""

from typing import Any

import quietbus as qb


def with_payload(**lines: Any) -> qb.Scenario:
    """The built-in satellite with a bench on legs, which carries ``camera`` and further lines."""
    data = qb.load_scenario("zhang2012").to_dict()
    legs = {key: value for key, value in data["isolator"].items() if key != "plate"}
    data["name"] = "bench"
    data["payload"] = {
        "body": {"mass": 30.0, "inertia": [[2, 0, 0], [0, 2, 0], [0, 0, 3]]},
        "isolator": legs | {"offset": [0.1, 0, -1.2]},
    }
    data["lines_of_sight"] = {"camera": {"direction": [1, 0, 0]}} | lines
    return qb.Scenario.from_dict(data)


def two_platforms() -> qb.Scenario:
    """CMGs on one platform, ``east``, and wheels on another, ``west``."""
    data, wheels = (qb.load_scenario(name).to_dict() for name in ("zhang2012", "wheels-demo"))
    isolator, cluster = data.pop("isolator"), data.pop("cluster")
    moved = isolator | {"offset": [-0.9, 0, 0.6]}
    data["name"] = "two"
    data["platforms"] = [
        {"name": "east", "isolator": isolator, "cluster": cluster},
        {"name": "west", "isolator": moved, "cluster": wheels["cluster"]},
    ]
    return qb.Scenario.from_dict(data)
