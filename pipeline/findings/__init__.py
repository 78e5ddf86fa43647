"""What identification yields, how it is kept, and what a report shows of it."""

from pipeline.findings.findings import Findings, ModelResult, Parameter, Published, Quality, Run, Verdict

__all__ = ["Findings", "ModelResult", "Parameter", "Published", "Quality", "Run", "Verdict"]
