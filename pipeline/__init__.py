"""rigfit: from logs of mechanical test rigs to identified parameters with honest intervals.

The folders are floors; each uses only those below it::

    cli        commands and progress
    report     findings -> figures -> HTML         campaign   recipe + logs -> recordings, stages
    rigs       one folder a rig: models, synthetic rig, experiments
    findings   what identification yields, and what a report shows of it
    estimation least squares, uncertainty, model selection
    signals    harmonics, segmentation, filtering
    ingest     readers of log files, quality checks
    recording  Recording, Channel, units
"""

__version__ = "0.1.0"
