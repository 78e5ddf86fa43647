"""The synthetic rig of an experiment -> logs, as a lab would have them."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

from pipeline.campaign.conditions import SYNTHETIC
from pipeline.campaign.recipe import Recipe
from pipeline.ingest.delimited.writer import write_csv
from pipeline.ingest.mcap_log import writer as mcap_writer


def synthesize(recipe: Recipe, folder: Path, seed: int) -> list[Path]:
    """Write the log of each run into `folder`, the formats of the recipe in turn; what stood there is replaced."""
    recordings = recipe.experiment.synthesize(recipe.synthetic.truth, seed)
    fresh = folder.with_name(f".{folder.name}.partial")
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    units = {spec.name: spec.unit for spec in recipe.experiment.conditions}
    formats = recipe.synthetic.formats
    names = []
    for number, recording in enumerate(recordings):
        recording = replace(recording, conditions={**recording.conditions, SYNTHETIC.name: True})
        kind = formats[number % len(formats)]
        path = fresh / f"{recording.run}.{kind}"
        if kind == "csv":
            names += [file.name for file in write_csv(recording, path, units)]
        else:
            mcap_writer.write(recording, path)
            names.append(path.name)
    shutil.rmtree(folder, ignore_errors=True)
    fresh.replace(folder)
    return [folder / name for name in names]
