"""The sources that the experiments on the ultrafiltration device cite."""

from __future__ import annotations

from pipeline.rigs.experiment import Reference

RAP_2019 = Reference(
    "rap2019",
    "University of Padova (DTG) and IRRIV Vicenza",
    "article 37 on the design and preliminary test of the wearable ultrafiltration device RAP",
    "Machines",
    2019,
    volume="7",
    pages="37",
    note="the device and its tests; names of the authors and the exact title stand in the journal",
)
BLAND_ALTMAN_1986 = Reference(
    "bland1986",
    "J. M. Bland and D. G. Altman",
    "Statistical methods for assessing agreement between two methods of clinical measurement",
    "The Lancet",
    1986,
    volume="327",
    pages="307-310",
    note="limits of agreement",
)
BLAND_ALTMAN_1999 = Reference(
    "bland1999",
    "J. M. Bland and D. G. Altman",
    "Measuring agreement in method comparison studies",
    "Statistical Methods in Medical Research",
    1999,
    volume="8",
    pages="135-160",
    note="limits of agreement with a trend",
)
LINNET_1993 = Reference(
    "linnet1993",
    "K. Linnet",
    "Evaluation of regression procedures for methods comparison studies",
    "Clinical Chemistry",
    1993,
    volume="39",
    pages="424-432",
    note="Deming regression",
)
KNAPP_CARTER_1976 = Reference(
    "knapp1976",
    "C. H. Knapp and G. C. Carter",
    "The generalized correlation method for estimation of time delay",
    "IEEE Transactions on Acoustics, Speech, and Signal Processing",
    1976,
    volume="24",
    pages="320-327",
    note="delay between two records",
)
CARTER_KNAPP_NUTTALL_1973 = Reference(
    "carter1973",
    "G. C. Carter, C. H. Knapp and A. H. Nuttall",
    "Estimation of the magnitude-squared coherence function via overlapped fast Fourier transform processing",
    "IEEE Transactions on Audio and Electroacoustics",
    1973,
    volume="21",
    pages="337-344",
    note="coherence and its threshold",
)
PAGE_1954 = Reference(
    "page1954",
    "E. S. Page",
    "Continuous inspection schemes",
    "Biometrika",
    1954,
    volume="41",
    pages="100-115",
    note="cumulative sums",
)
SCHUIRMANN_1987 = Reference(
    "schuirmann1987",
    "D. J. Schuirmann",
    "A comparison of the two one-sided tests procedure and the power approach for assessing the equivalence of average bioavailability",
    "Journal of Pharmacokinetics and Biopharmaceutics",
    1987,
    volume="15",
    pages="657-680",
    note="equivalence by two one-sided tests",
)
KALMAN_1960 = Reference(
    "kalman1960",
    "R. E. Kalman",
    "A new approach to linear filtering and prediction problems",
    "Journal of Basic Engineering",
    1960,
    volume="82",
    pages="35-45",
    note="filter of the tank's volume",
)
