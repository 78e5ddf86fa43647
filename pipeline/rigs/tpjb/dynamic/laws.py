"""How the coefficients go with frequency: constant, straight line, parabola; and what could imitate that.

Weighted fits over the tones, judged by chi-square. The intercept at shaft speed is the synchronous
coefficient.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

# Share of right laws that are let pass.
LEVEL = 0.99
# Gain of chi-square by which one explanation is believed and another is not: odds of 150 to 1.
_DECISIVE = 10.0
# Standard errors by which a further coefficient stands out; share of a chance move that counts as error of the choice.
_STANDS_OUT, _BY_CHANCE = 2.0, 0.75


@dataclass(frozen=True, eq=False)
class Law:
    """A polynomial of `degree` in r = f/f_shaft - 1, shape of `coefficients` (degree + 1,), lowest first.

    `noise_dof` are the degrees of freedom of the intercept's standard error.
    """

    degree: int
    coefficients: np.ndarray
    covariance: np.ndarray
    chi2: float
    dof: int
    limit: float
    noise_dof: float

    @property
    def passes(self) -> bool:
        """Tell whether chi-square stays below its limit."""
        return self.dof > 0 and self.chi2 <= self.limit

    @property
    def widening(self) -> float:
        """By how much a rejected law's errors grow so that its scatter is theirs (Birge's ratio)."""
        return 1.0 if self.passes or self.dof < 1 else max(1.0, float(np.sqrt(self.chi2 / self.dof)))

    def at(self, r: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        """Return value and standard error at r, a rejected law's widened."""
        columns = np.vander(np.atleast_1d(np.asarray(r, dtype=float)), self.degree + 1, increasing=True)
        variance = np.einsum("ij,jk,ik->i", columns, self.covariance, columns)
        return columns @ self.coefficients, self.widening * np.sqrt(variance)


def chi2_limit(count: int, fitted: int, noise_dof: np.ndarray, level: float = LEVEL) -> float:
    """Return the `level` point of a sum of squares whose weights were estimated themselves.

    Each of the `count` squares has the mean n/(n - 2) and a longer tail than chi-square's when its
    error was estimated with n degrees of freedom; mean and variance of the sum set a gamma law.
    """
    from scipy.special import gammaincinv

    n = np.maximum(np.asarray(noise_dof, dtype=float), 5.0)
    share = (count - fitted) / count
    mean = share * float((n / (n - 2)).sum())
    variance = share * float((2 * n**2 * (n - 1) / ((n - 2) ** 2 * (n - 4))).sum())
    return float(gammaincinv(mean**2 / variance, level) * variance / mean) if count > fitted else 0.0


def fit_law(r: np.ndarray, y: np.ndarray, sd: np.ndarray, noise_dof: np.ndarray, degree: int) -> Law:
    """Fit a polynomial to y(r) of shape (k,) with standard errors `sd`, known with `noise_dof` each.

    Examples
    --------
    >>> r = np.array([-0.5, 0.0, 0.5, 1.0])
    >>> law = fit_law(r, 2.0 + r, np.full(4, 0.1), np.full(4, 20.0), 1)
    >>> np.round(law.coefficients, 9).tolist(), law.passes
    ([2.0, 1.0], True)
    """
    smooth = smoothed(r, sd, noise_dof)
    columns = np.vander(r, degree + 1, increasing=True) / smooth[:, None]
    gain = np.linalg.inv(columns.T @ columns) @ columns.T / smooth
    coefficients = gain @ y
    left = y / smooth - columns @ coefficients
    share = (gain[0] * sd) ** 2
    return Law(
        degree,
        coefficients,
        (gain * sd**2) @ gain.T,
        float(left @ left),
        r.size - degree - 1,
        chi2_limit(r.size, degree + 1, 4 * noise_dof),
        float(share.sum() ** 2 / (share**2 / noise_dof).sum()),
    )


def among(law: Law, count: int, noise_dof: np.ndarray, tests: int) -> Law:
    """Return the law with the limit that all of `tests` right laws pass together in 99 % of campaigns (Bonferroni).

    It serves for the richest law: that it is rejected is an alarm, which chance must not give.
    """
    return replace(law, limit=chi2_limit(count, law.degree + 1, 4 * noise_dof, 1 - (1 - LEVEL) / tests))


def smoothed(r: np.ndarray, sd: np.ndarray, noise_dof: np.ndarray) -> np.ndarray:
    """Return standard errors as a smooth curve over the tones.

    Noise differs little from tone to tone; weights that follow the luck of each few blocks would prefer
    the tones whose error came out small, and the error of the fit would be told too small.
    """
    if r.size < 4:
        return sd
    # The logarithm of a variance with n degrees of freedom is 1/n low on average.
    level = np.log(sd**2) + 1 / noise_dof
    curve = np.polynomial.Polynomial.fit(r, level, 1 if r.size < 6 else 2)(r)
    return np.asarray(np.exp(curve / 2))


def for_intercept(taken: Law, laws: Sequence[Law], goes: bool) -> Law:
    """Return the law that the intercept is read from, of a higher degree than the taken one where that is due.

    Chi-square over all tones asks whether a law can be right; a slope of two standard errors passes it, and
    biases the intercept of a constant by as much. It is no claim that the coefficient goes with frequency.

    Parameters
    ----------
    goes
        Whether coefficients of this operating point are seen to go with frequency. One film makes them all: then a
        degree more is taken, whose larger error tells what it costs. Else where the next coefficient stands out.
    """
    richer = _next(taken, laws)
    if goes:
        return richer or taken
    while richer is not None and abs(richer.coefficients[-1]) > _STANDS_OUT * np.sqrt(richer.covariance[-1, -1]):
        taken, richer = richer, _next(richer, laws)
    return taken


def choice_error(taken: Law, laws: Sequence[Law]) -> float:
    """Return what the intercept may owe to the choice of the degree where none is seen to be due, as a standard error.

    A trend as small as the noise stays unseen, and biases the intercept of the simpler law by about as much as the
    next degree moves it, or may move it by chance. By simulation (a slope that biases a constant's intercept by 0 to
    6 standard errors) intervals hold the truth 95 to 97 times in 100 for stiffness and 88 to 97 times for damping,
    whose low tones are known worst; without this 42 times at worst.
    """
    richer = _next(taken, laws)
    if richer is None:
        return 0.0
    by_chance = np.sqrt(max(float(richer.covariance[0, 0] - taken.covariance[0, 0]), 0.0))
    return max(abs(float(richer.coefficients[0] - taken.coefficients[0])), _BY_CHANCE * float(by_chance))


def _next(law: Law, laws: Sequence[Law]) -> Law | None:
    return next((other for other in laws if other.degree == law.degree + 1), None)


def choose(laws: Sequence[Law]) -> Law | None:
    """Return the law of the lowest degree that chi-square lets pass; None where none is."""
    return next((law for law in sorted(laws, key=lambda law: law.degree) if law.passes), None)


@dataclass(frozen=True, eq=False)
class Imitation:
    """A trend that all stiffnesses share, told beside constant (or straight) K and C.

    `value` of the extra parameter with its standard error; chi-square with it and without.
    """

    value: float
    std_error: float
    chi2: float
    chi2_without: float
    dof: int
    limit: float

    @property
    def explains(self) -> bool:
        """Tell whether K and C alone fail and with this one parameter pass."""
        return self.chi2 <= self.limit < self.chi2_without and abs(self.value) > 3 * self.std_error

    def beats(self, other: Imitation) -> bool:
        """Tell whether this one explains the trend and the other one fits it decisively worse."""
        return self.explains and other.chi2 - self.chi2 > _DECISIVE * max(1.0, self.chi2 / self.dof)


def imitation(
    w: np.ndarray,
    H: np.ndarray,
    std_error: np.ndarray,
    noise_dof: np.ndarray,
    pattern: np.ndarray,
    degree: int = 0,
) -> Imitation:
    """Fit K and C and one parameter p with H = K + i w C + p `pattern` over all tones and entries.

    K and C are polynomials of `degree` in w.

    Parameters
    ----------
    w
        rad/s, shape (k,).
    H, std_error, noise_dof, pattern
        Shape (k, 2, 2). The pattern of a displacement that is late by p is i w H; that of a mass which
        was not taken off is A D^-1.
    """
    k = w.size
    n = degree + 1
    own = np.vander(w / w.max(), n, increasing=True)
    columns, target = [], []
    for i in range(2):
        for j in range(2):
            sd = std_error[:, i, j]
            for number, (part, base) in enumerate(((np.real, own), (np.imag, own * w[:, None]))):
                block = np.zeros((k, 8 * n + 1))
                first = (4 * i + 2 * j + number) * n
                block[:, first : first + n] = base / sd[:, None]
                block[:, -1] = part(pattern[:, i, j]) / sd
                columns.append(block)
                target.append(part(H[:, i, j]) / sd)
    A, y = np.vstack(columns), np.concatenate(target)
    norm = np.linalg.norm(A, axis=0)
    solution, covariance = _solved(A / norm, y)
    left = y - A / norm @ solution
    alone, _ = _solved(A[:, :-1] / norm[:-1], y)
    without = y - A[:, :-1] / norm[:-1] @ alone
    freedom = np.repeat(noise_dof.reshape(k, 4).T, 2, axis=0).ravel()
    return Imitation(
        float(solution[-1] / norm[-1]),
        float(np.sqrt(covariance[-1, -1]) / norm[-1]),
        float(left @ left),
        float(without @ without),
        y.size - A.shape[1],
        chi2_limit(y.size, A.shape[1], freedom),
    )


def _solved(A: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    covariance = np.linalg.pinv(A.T @ A)
    return covariance @ A.T @ y, covariance


def added_mass(w: np.ndarray, stiffness: np.ndarray, sd: np.ndarray) -> tuple[float, float, float]:
    """Return M (kg), its standard error and K (N/m) of the KCM reading Re H = K - w^2 M, shape (k,) each."""
    columns = np.stack([np.ones_like(w), -(w**2)], axis=1) / sd[:, None]
    norm = np.linalg.norm(columns, axis=0)
    solution, covariance = _solved(columns / norm, stiffness / sd)
    return float(solution[1] / norm[1]), float(np.sqrt(covariance[1, 1]) / norm[1]), float(solution[0] / norm[0])
