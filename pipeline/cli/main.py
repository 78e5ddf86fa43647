"""The command `rigfit`. Here stand the words of the command line; the work is done by the floors below.

Imports are made where they are used, so that `rigfit --help` answers at once.
"""

from __future__ import annotations

import errno
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import click

from pipeline import __version__
from pipeline.cli.saying import say

# The matrices here are small: two BLAS threads on busy cores are slower than one. Numpy reads it when imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

PATH = click.Path(path_type=Path)
_STOPPED = "stopped; nothing half-written is left, run the same command again."


def _version(context: click.Context, _option: click.Parameter, asked: bool) -> None:
    """Say version and code as the provenance of findings does, so that they can be compared."""
    if asked:
        from pipeline.campaign.code_digest import code_digest

        say(f"rigfit {__version__}, code {code_digest()}")
        context.exit()


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 96})
@click.option(
    "--version", is_flag=True, expose_value=False, is_eager=True, callback=_version, help="Say which rigfit this is."
)
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
@click.option("--datasets", default="", metavar="URL", help="Where the logs lie, if elsewhere: any URL of fsspec.")
def new(experiment: str, campaign: str, title: str, datasets: str) -> None:
    """Make a campaign.

    Writes its recipe, makes its folder for logs, and lists it in params.yaml.

    \b
    Examples:  rigfit new mre.shear sample-b
               rigfit new mre.shear sample-c --datasets s3://lab-logs/sample-c
    """
    from pipeline.campaign.project import Project
    from pipeline.campaign.remote.urls import is_url
    from pipeline.rigs.registry import experiment as find_experiment

    project = Project.around(Path.cwd())
    if datasets and not is_url(datasets) and not (place := Path(datasets).expanduser()).is_absolute():
        datasets = os.path.relpath(place, project.root)  # in params.yaml a path begins at the project's folder
    made = project.add(campaign, find_experiment(experiment), title, datasets)
    say(f"{made.recipe.relative_to(project.root)}   says how channels are called in the logs")
    if datasets:
        say(f"params.yaml   says where the logs lie: {datasets}; dvc repro fetches what is new there")
    else:
        say(f"{made.logs.relative_to(project.root)}/   takes the logs; then run: dvc repro")


@rigfit.command()
@click.argument("logs", nargs=-1, required=True)
@click.option("--experiment", "-e", help="Also check against what this experiment needs, as mre.shear.")
@click.option("--recipe", "-r", type=PATH, help="Recipe that maps the logs' channels.")
@click.option("--runs", type=PATH, help="Table of conditions per run, as of 'rigfit run'.")
def check(logs: tuple[str, ...], experiment: str | None, recipe: Path | None, runs: Path | None) -> None:
    """Tell what logs hold and what is wrong with them.

    Shows channels, units, rates, conditions, gaps and quality; identifies and writes nothing. A LOG is a file, or a URL of
    one or of a folder: s3://lab-logs/sample-b.

    \b
    Exit status, of several logs the worst:
                 0  nothing grave
                 1  something in a log is an error
                 2  a log cannot be read, or holds nothing that --experiment could identify
    """
    from pipeline.cli import checking

    sys.exit(checking.show(logs, experiment, recipe, runs))


@rigfit.command()
@click.argument("experiment")
@click.argument("logs", nargs=-1, required=True)
@click.option("--out", "-o", required=True, type=PATH, help="Folder for findings.json and report.html.")
@click.option("--recipe", "-r", type=PATH, help="Maps channels and units, gives conditions and settings.")
@click.option("--runs", type=PATH, help="Table of conditions per run, like runs.csv of a campaign.")
@click.option(
    "--with", "uses", multiple=True, type=PATH, help="findings.json that this experiment builds on; repeatable."
)
@click.option(
    "--live",
    is_flag=True,
    help="First play the logs and show how the experiment's online method finds the parameters (mre.shear_rich).",
)
@click.option(
    "--speed",
    type=click.FloatRange(min=0, min_open=True),
    help="With --live: play so many times as fast as it was logged; as fast as possible by default.",
)
def run(
    experiment: str,
    logs: tuple[str, ...],
    out: Path,
    recipe: Path | None,
    runs: Path | None,
    uses: tuple[Path, ...],
    live: bool,
    speed: float | None,
) -> None:
    """Identify and report logs ad hoc, without DVC.

    Nothing is registered; everything is written into the folder of --out. A LOG is a file, or a URL of one or of a folder:
    s3://lab-logs/sample-b.

    \b
    Watch an online method, in real time or faster (the result at the end is the same):
                 rigfit run mre.shear_rich LOG --out DIR --live --speed 1

    \b
    Exit status: 0  findings written, verdict ok or warning
                 1  findings written, verdict rejected
                 2  nothing could be identified: the input, the recipe or the call is wrong
               130  stopped by Ctrl-C (143 by a kill, 129 by a closed terminal): what was in DIR is unchanged
                70  a defect of rigfit; what was in DIR is unchanged
    """
    from pipeline.cli import stages

    if speed is not None and not live:
        raise click.UsageError("--speed is for --live; add --live.")
    sys.exit(stages.run(experiment, logs, out, recipe, runs, uses, replay=(speed or float("inf")) if live else None))


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
def fetch(campaign: str) -> None:
    """Fetch the logs of a campaign that lie elsewhere.

    'datasets' in params.yaml says where; what is new or changed there comes into datasets/CAMPAIGN/fetched/, and what is
    gone there goes. 'dvc repro' does it by itself.
    """
    from pipeline.cli import fetching

    fetching.fetch(campaign)


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
@click.argument("campaign")
@click.option(
    "--to",
    "form",
    required=True,
    type=click.Choice(["csv", "json", "matlab", "mcap", "ross"]),
    help="csv, json: all parameters. matlab: parameters, arrays, runs (.mat). mcap: measured and modelled signals, one file a "
    "run. ross: bearing tables (.toml, .xlsx) over speed and frequency.",
)
@click.option("--out", "-o", type=PATH, help="Folder to write into; reports/CAMPAIGN/export by default.")
def export(campaign: str, form: str, out: Path | None) -> None:
    """Hand findings on to other programs.

    CAMPAIGN is a campaign of this project, or a findings.json or its folder.

    \b
    In MATLAB:     load CAMPAIGN.mat; struct2table(findings.parameters)
    In Python:     pandas.DataFrame(json.load(open("CAMPAIGN.json"))["parameters"])
    In Foxglove or PlotJuggler open the .mcap of a run: /measured is the log in SI, /findings what was identified.

    \b
    In ROSS:  bearing = ross.BearingElement.load("TABLE.toml")
              bearing = ross.BearingElement.from_table(n=3, file="TABLE.xlsx")
    """
    from pipeline.cli import exporting

    exporting.export(campaign, form, out)


@rigfit.command()
@click.argument("before")
@click.argument("after", default="workspace")
@click.option("--out", "-o", type=PATH, help="Page to write; reports/comparison.html of the project by default.")
def compare(before: str, after: str, out: Path | None) -> None:
    """Hold findings against earlier or other ones of the same experiment.

    BEFORE and AFTER each are a campaign of this project, a findings.json or its folder, or a revision: what 'git log' or
    'dvc exp show' list, REV:CAMPAIGN for one campaign of it; 'workspace' are the files as they lie here.

    
    Examples:  rigfit compare HEAD~1                         all campaigns, then and now
               rigfit compare main:sample-b my-experiment:sample-b
               rigfit compare sample-a sample-b              two campaigns of one experiment
    """
    from pipeline.cli import comparing

    comparing.compare(before, after, out)


@rigfit.command()
@click.argument("campaign")
@click.option("--json", "as_json", is_flag=True, help="Print it as JSON, in SI.")
def advise(campaign: str, as_json: bool) -> None:
    """Propose what to measure next.

    From the model as it was fitted: which runs beside those of the campaign would shrink which interval, and by how much.
    CAMPAIGN is a campaign of this project, or a findings.json or its folder. For mre.shear, tpjb.rotating and tire.bench.
    """
    from pipeline.cli import advising

    advising.advise(campaign, as_json)


@rigfit.command()
@click.option("--go-on", is_flag=True, help="Exit 0 also where a campaign is rejected.")
def index(go_on: bool) -> None:
    """Render the index over all campaigns.

    It goes into reports/index.html. The exit status is 1 where a campaign is rejected.
    """
    from pipeline.cli import stages

    status = stages.index()
    sys.exit(0 if go_on else status)


class _Stopped(BaseException):
    """A signal (Ctrl-C, a kill, a closed terminal) asks the program to end."""


def main() -> None:
    """Run the command; say a user's mistake as one paragraph with status 2."""
    from pipeline.errors import InputError

    came: list[int] = []
    try:
        with _stoppable(came):
            rigfit(standalone_mode=False)
    except (click.exceptions.Abort, KeyboardInterrupt):
        _leave(_STOPPED, 128 + signal.SIGINT)
    except _Stopped:
        _leave(_STOPPED, 128 + came[0])
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
        if came:  # compiled code turns a signal into an error of its own
            _leave(_STOPPED, 128 + came[0])
        trace = error.__traceback__
        while trace and trace.tb_next:
            trace = trace.tb_next
        place = f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}" if trace else "?"
        _leave(
            f"a defect of rigfit, not of your data: {type(error).__name__}: {error} ({place}). "
            "Earlier results are untouched. RIGFIT_DEBUG=1 shows the traceback; please report it.",
            70,
        )


@contextmanager
def _stoppable(came: list[int]) -> Iterator[None]:
    """Let Ctrl-C, a kill and a closed terminal unwind the program, so that everything half-written is removed.

    What the program was told to ignore (nohup, a background job) it ignores. The signals that `came` are added there.
    """

    def stop(number: int, _frame: FrameType | None) -> None:
        came.append(number)
        raise _Stopped

    before = {}
    if threading.current_thread() is threading.main_thread():
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
                before[number] = signal.signal(number, stop)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _said(error: OSError) -> str:
    name = f"{error.filename}: " if error.filename else ""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"{name}the disk is full; free some space and run the same command again. Earlier results are untouched."
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return f"{name}no permission ({error.strerror}); choose another folder or change its rights."
    return f"{name}{error.strerror or error}. Nothing half-written is left; mend this and run the same command again."


def _leave(text: str, status: int) -> None:
    say(f"rigfit: {' '.join(text.split())}", err=True)
    sys.exit(status)
