"""Campaigns that DVC may make side by side."""

from pipeline.campaign.lanes import lanes


def test_campaigns_of_one_chain_stay_together_and_others_are_alone():
    campaigns = ["a", "b", "c", "d", "e"]
    assert lanes(campaigns, [("d", "c"), ("c", "a"), ("d", "a")]) == [["a", "c", "d"], ["b"], ["e"]]


def test_two_chains_that_meet_in_one_campaign_are_one_lane():
    assert lanes(["t", "x", "y", "z"], [("x", "y"), ("z", "t"), ("x", "z")]) == [["t", "x", "y", "z"]]


def test_use_of_a_campaign_that_is_not_listed_joins_nothing():
    assert lanes(["a", "b"], [("a", "elsewhere"), ("elsewhere", "b")]) == [["a"], ["b"]]
