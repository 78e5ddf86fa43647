"""The command `rigfit`. Here stand the words of the command line; the work is done by the floors below.

Imports are made where they are used, so that `rigfit --help` answers at once.
"""

from __future__ import annotations

import errno
import os
import sys
from pathlib import Path

import click

from pipeline import __version__

# The matrices here are small: two BLAS threads on busy cores are slower than one. Numpy reads it when imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

PATH = click.Path(path_type=Path)


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 96})
@click.version_option(__version__, prog_name="rigfit")
def rigfit() -> None:
    """From logs of mechanical test rigs to identified parameters with honest intervals, and a report.

    \b
    Ad hoc:        rigfit check LOG...
                   rigfit run EXPERIMENT LOG... --out DIR
    In a project:  rigfit new EXPERIMENT CAMPAIGN
                   drop logs into datasets/CAMPAIGN/, then run: dvc repro
    """


@rigfit.command("list")
def list_() -> None:
    """List experiments, and the campaigns of this project."""
    from pipeline.cli import listing

    listing.show(Path.cwd())


@rigfit.command()
@click.argument("experiment")
@click.argument("campaign")
@click.option("--title", default="", help="Title of the report; the campaign's name by default.")
def new(experiment: str, campaign: str, title: str) -> None:
    """Make a campaign.

    Writes its recipe, makes its folder for logs, and lists it in params.yaml.
    Example: rigfit new mre.shear sample-b
    """
    from pipeline.campaign.project import Project
    from pipeline.rigs.registry import experiment as find_experiment

    project = Project.around(Path.cwd())
    made = project.add(campaign, find_experiment(experiment), title)
    click.echo(f"{made.recipe.relative_to(project.root)}   says how channels are called in the logs")
    click.echo(f"{made.logs.relative_to(project.root)}/   takes the logs; then run: dvc repro")


@rigfit.command()
@click.argument("logs", nargs=-1, required=True, type=PATH)
@click.option("--experiment", "-e", help="Also check against what this experiment needs, as mre.shear.")
@click.option("--recipe", "-r", type=PATH, help="Recipe that maps the logs' channels.")
def check(logs: tuple[Path, ...], experiment: str | None, recipe: Path | None) -> None:
    """Tell what logs hold and what is wrong with them.

    Shows channels, units, rates, conditions, gaps and quality; runs and writes nothing.
    The exit status is 2 where a log cannot be read, 1 where something in one is an error, else 0.
    """
    from pipeline.cli import checking

    sys.exit(checking.show(logs, experiment, recipe))


@rigfit.command()
@click.argument("experiment")
@click.argument("logs", nargs=-1, required=True, type=PATH)
@click.option("--out", "-o", required=True, type=PATH, help="Folder for findings.json and report.html.")
@click.option("--recipe", "-r", type=PATH, help="Maps channels and units, gives conditions and settings.")
@click.option("--runs", type=PATH, help="Table of conditions per run, like runs.csv of a campaign.")
@click.option(
    "--with", "uses", multiple=True, type=PATH, help="findings.json that this experiment builds on; repeatable."
)
def run(
    experiment: str, logs: tuple[Path, ...], out: Path, recipe: Path | None, runs: Path | None, uses: tuple[Path, ...]
) -> None:
    """Identify and report logs ad hoc, without DVC.

    Nothing is registered; everything is written into the folder of --out.

    \b
    Exit status: 0  findings written, verdict ok or warning
                 1  findings written, verdict rejected
                 2  nothing could be identified: the input, the recipe or the call is wrong
    """
    from pipeline.cli import stages

    sys.exit(stages.run(experiment, logs, out, recipe, runs, uses))


@rigfit.command()
@click.argument("campaign")
@click.option("--out", type=PATH, help="Write there; CAMPAIGN may then be an experiment, as mre.shear.")
@click.option("--seed", type=int, help="Another seed than the recipe's.")
def synthesize(campaign: str, out: Path | None, seed: int | None) -> None:
    """Write the logs of a campaign's synthetic rig.

    They go into datasets/CAMPAIGN/synthetic/, or into the folder of --out.
    """
    from pipeline.cli import stages

    stages.synthesize(campaign, out, seed)


@rigfit.command()
@click.argument("campaign")
@click.option("--force", is_flag=True, help="Read every log again, also those that were read already.")
def ingest(campaign: str, force: bool) -> None:
    """Read the new logs of a campaign.

    Recordings go into recordings/CAMPAIGN/; logs that were read already are not read again.
    """
    from pipeline.cli import stages

    stages.ingest(campaign, force)


@rigfit.command()
@click.argument("campaign")
@click.option(
    "--go-on", is_flag=True, help="Exit 0 for a rejected verdict as well, so that a chain goes on to the report."
)
def identify(campaign: str, go_on: bool) -> None:
    """Identify a campaign from its recordings.

    Findings go into reports/CAMPAIGN/findings.json.

    Exit status as of 'rigfit run'.
    """
    from pipeline.cli import stages

    status = stages.identify(campaign)
    sys.exit(0 if go_on and status == 1 else status)


@rigfit.command()
@click.argument("campaign")
def report(campaign: str) -> None:
    """Render the report of a campaign.

    It goes into reports/CAMPAIGN/report.html; the numbers come from findings.json beside it.
    """
    from pipeline.cli import stages

    stages.report(campaign)


@rigfit.command()
@click.option("--go-on", is_flag=True, help="Exit 0 also where a campaign is rejected.")
def index(go_on: bool) -> None:
    """Render the index over all campaigns.

    It goes into reports/index.html. The exit status is 1 where a campaign is rejected.
    """
    from pipeline.cli import stages

    status = stages.index()
    sys.exit(0 if go_on else status)


def main() -> None:
    """Run the command; say a user's mistake as one paragraph with status 2."""
    from pipeline.errors import InputError

    try:
        rigfit(standalone_mode=False)
    except click.exceptions.Abort:
        _leave("stopped; nothing half-written is left, run the same command again.", 130)
    except KeyboardInterrupt:
        _leave("stopped; nothing half-written is left, run the same command again.", 130)
    except click.ClickException as error:
        error.show()
        sys.exit(2)
    except InputError as error:
        _leave(str(error), 2)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as error:
        _leave(_said(error), 2)
    except MemoryError:
        _leave("not enough memory for this log; close other programs, or split the log.", 2)
    except Exception as error:
        if os.environ.get("RIGFIT_DEBUG"):
            raise
        trace = error.__traceback__
        while trace and trace.tb_next:
            trace = trace.tb_next
        place = f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}" if trace else "?"
        _leave(
            f"a defect of rigfit, not of your data: {type(error).__name__}: {error} ({place}). "
            "Earlier results are untouched. RIGFIT_DEBUG=1 shows the traceback; please report it.",
            70,
        )


def _said(error: OSError) -> str:
    name = f"{error.filename}: " if error.filename else ""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"{name}the disk is full; free some space and run the same command again. Earlier results are untouched."
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return f"{name}no permission ({error.strerror}); choose another folder or change its rights."
    return f"{name}{error.strerror or error}. Nothing half-written is left; mend this and run the same command again."


def _leave(text: str, status: int) -> None:
    click.echo(f"rigfit: {' '.join(text.split())}", err=True)
    sys.exit(status)
