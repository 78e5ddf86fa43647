"""Magneto-rheological elastomer pads in compression and shear; also other hysteretic devices on a shaker."""

from pipeline.rigs.mre.axial.declaration import AXIAL
from pipeline.rigs.mre.hold.declaration import HOLD
from pipeline.rigs.mre.rich.declaration import SHEAR_RICH
from pipeline.rigs.mre.shear.declaration import SHEAR
from pipeline.rigs.mre.step.declaration import STEP

EXPERIMENTS = (AXIAL, SHEAR, SHEAR_RICH, HOLD, STEP)
