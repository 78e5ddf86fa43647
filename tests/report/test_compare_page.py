"""The page of a comparison: what stands where, digits, what may differ, and the same bytes for the same findings."""

from __future__ import annotations

from pipeline.findings import Findings, Quality
from pipeline.findings.comparison import compare
from pipeline.report.compare import render_comparison
from pipeline.report.compare_numbers import Compared
from pipeline.rigs.experiment import Experiment


def moved(findings: Findings, by: float) -> Findings:
    """The findings with every number moved by so many standard errors."""
    parameters = [
        p.model_copy(update={"value": p.value + by * p.std_error, "ci95": None}) if p.value and p.std_error else p
        for p in findings.parameters
    ]
    return findings.model_copy(update={"parameters": parameters})


def page(before: Findings, after: Findings, experiment: Experiment) -> str:
    return render_comparison([Compared(compare(before, after), experiment)], ("then", "now"), (), "rigfit compare")


def test_the_page_is_the_same_bytes_for_the_same_findings(findings, experiment):
    after = moved(findings, 0.7)
    assert page(findings, after, experiment) == page(findings, after, experiment)


def test_numbers_that_moved_stand_beside_those_before(findings, experiment):
    html = page(findings, moved(findings, 2.5), experiment)
    assert "+2.5" in html
    assert "The numbers that matter" in html
    assert "Difference over standard error" in html
    assert "no test" in html
    assert "<script" not in html


def test_findings_without_any_difference_say_so(findings, experiment):
    html = page(findings, findings, experiment)
    assert "every number are the same" in html
    assert "same to the last digit" in html


def test_numbers_that_changed_without_a_known_cause_are_said_to(findings, experiment):
    assert "code is another one" in page(findings, moved(findings, 1.0), experiment)


def test_of_hashes_the_beginning_is_told(findings, experiment):
    before, after = (
        findings.model_copy(update={"provenance": {**findings.provenance, "recipe_sha256": digit * 64, **more}})
        for digit, more in (("a", {}), ("b", {"uses": {}}))
    )
    html = page(before, after, experiment)
    assert "a" * 12 + "…" in html
    assert "b" * 13 not in html
    assert ">uses<" not in html  # nothing before, nothing now


def test_what_was_found_on_the_data_is_escaped(findings, experiment):
    bad = Quality(level="warning", run="<i>r</i>", message="<script>alert(1)</script>")
    after = findings.model_copy(update={"quality": [*findings.quality, bad], "verdict": "rejected"})
    html = page(findings, after, experiment)
    assert "<script>alert" not in html
    assert "&lt;script&gt;" in html
    assert 'verdict rejected"' in html


def test_campaigns_that_are_alike_have_no_chapter_of_their_own(findings, experiment):
    other = findings.model_copy(update={"campaign": "other"})
    compared = [Compared(compare(a, b), experiment) for a, b in ((findings, findings), (other, moved(other, 1.0)))]
    html = render_comparison(compared, ("then", "now"), ["third: findings only at now."])
    assert html.count("<section id=") == 2
    assert '<h2 id="campaign-2-title">other</h2>' in html
    assert "third: findings only at now." in html


def test_states_whose_verdicts_are_the_same_say_so(findings, experiment):
    other = findings.model_copy(update={"campaign": "other"})
    html = render_comparison([Compared(compare(one, one), experiment) for one in (findings, other)], ("then", "now"))
    assert "Every campaign has the verdict that it had." in html
