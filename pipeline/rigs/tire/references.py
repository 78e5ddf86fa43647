"""The sources that the tire rig's experiments cite."""

from __future__ import annotations

from pipeline.rigs.experiment import Reference

BREGLIO_2019 = Reference(
    "breglio2019",
    "G. Breglio, A. Irace, L. Pugliese, M. Riccio, M. Russo, S. Strano and M. Terzo",
    "Development and Testing of a Low-Cost Wireless Monitoring System for an Intelligent Tire",
    "Machines",
    2019,
    volume="7",
    pages="49",
    note="the rig, eqs (1)-(4)",
)
GONG_1993 = Reference(
    "gong1993",
    "S. Gong",
    "A Study of In-Plane Dynamics of Tires",
    "PhD thesis, Delft University of Technology",
    1993,
    note="the flexible ring; the model here is derived anew",
)
FYFE_MUNCK_1997 = Reference(
    "fyfe1997",
    "K. R. Fyfe and E. D. S. Munck",
    "Analysis of computed order tracking",
    "Mechanical Systems and Signal Processing",
    1997,
    volume="11",
    pages="187-205",
    note="order tracking",
)
BRAUN_2011 = Reference(
    "braun2011",
    "S. Braun",
    "The synchronous (time domain) average revisited",
    "Mechanical Systems and Signal Processing",
    2011,
    volume="25",
    pages="1087-1102",
    note="synchronous averaging",
)
FIELLER_1954 = Reference(
    "fieller1954",
    "E. C. Fieller",
    "Some problems in interval estimation",
    "Journal of the Royal Statistical Society, Series B",
    1954,
    volume="16",
    pages="175-185",
    note="interval of a load read off the calibration",
)
KALMAN_1960 = Reference(
    "kalman1960",
    "R. E. Kalman",
    "A new approach to linear filtering and prediction problems",
    "Journal of Basic Engineering",
    1960,
    volume="82",
    pages="35-45",
    note="tracking of load, force and speed",
)
