"""Sources that the MRE experiments cite."""

from __future__ import annotations

from pipeline.rigs.experiment import Reference

BRANCATI_2019 = Reference(
    "brancati2019",
    "R. Brancati and G. Di Massa and S. Pagano",
    "Investigation on the Mechanical Properties of MRE Compounds",
    "Machines",
    2019,
    volume="7",
    pages="36",
)
GOLUB_PEREYRA_1973 = Reference(
    "golub1973",
    "G. H. Golub and V. Pereyra",
    "The differentiation of pseudo-inverses and nonlinear least squares problems whose variables separate",
    "SIAM Journal on Numerical Analysis",
    1973,
    volume="10",
    pages="413-432",
)
KAUFMAN_1975 = Reference(
    "kaufman1975",
    "L. Kaufman",
    "A variable projection method for solving separable nonlinear least squares problems",
    "BIT",
    1975,
    volume="15",
    pages="49-57",
)
ISMAIL_2009 = Reference(
    "ismail2009",
    "M. Ismail and F. Ikhouane and J. Rodellar",
    "The hysteresis Bouc-Wen model, a survey",
    "Archives of Computational Methods in Engineering",
    2009,
    volume="16",
    pages="161-188",
)
NEWEY_WEST_1987 = Reference(
    "newey1987",
    "W. K. Newey and K. D. West",
    "A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent covariance matrix",
    "Econometrica",
    1987,
    volume="55",
    pages="703-708",
)
SCHWARZ_1978 = Reference(
    "schwarz1978",
    "G. Schwarz",
    "Estimating the dimension of a model",
    "The Annals of Statistics",
    1978,
    volume="6",
    pages="461-464",
)
GENT_LINDLEY_1959 = Reference(
    "gent1959",
    "A. N. Gent and P. B. Lindley",
    "The compression of bonded rubber blocks",
    "Proceedings of the Institution of Mechanical Engineers",
    1959,
    volume="173",
    pages="111-122",
)
