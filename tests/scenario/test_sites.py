"""One way to read what stands on the bus."""

import pytest

import quietbus as qb


@pytest.mark.parametrize("name", ["zhang2012", "wheels-demo"])
def test_isolator_and_cluster_are_one_site(name):
    scenario = qb.load_scenario(name)
    (site,) = scenario.sites
    assert site.name == "plate"
    assert site.isolator == scenario.isolator
    assert site.blocks == (scenario.cluster,)
    assert "sites" not in scenario.to_dict()
