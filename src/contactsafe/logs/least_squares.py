"""Regularised least squares for torques of several joints, with confidence that counts in correlated residuals."""

from typing import NamedTuple

import numpy as np

_ROUNDS = 6
_HUBER = 4.0
"""Standard deviations beyond which a residual counts less."""

_LEAST_NM = 1e-6
"""Least standard deviation of a residual: a log without noise is not infinitely sure."""

_CORRELATED = 0.95


class Problem(NamedTuple):
    """Torques, linear in unknowns of which something is known beforehand.

    Attributes:
        columns: torque per unknown, (N, n, P).
        torque: (N, n), N m.
        mean: of the unknowns beforehand, (P,).
        spread: of them, standard deviation, (P,).
        counts: which torques do, (N, n).
    """

    columns: np.ndarray
    torque: np.ndarray
    mean: np.ndarray
    spread: np.ndarray
    counts: np.ndarray

    def part(self, which: np.ndarray | slice) -> "Problem":
        """Return some of the rows."""
        return self._replace(columns=self.columns[which], torque=self.torque[which], counts=self.counts[which])


class Solution(NamedTuple):
    """What fits.

    Attributes:
        value: of the unknowns, (P,).
        covariance: of them, (P, P).
        residual: what is left, (N, n), N m.
    """

    value: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray


def solve(problem: Problem) -> Solution:
    """Weight each joint by its own noise, and what is known beforehand by its spread; x = argmin Σ w r² + ((x−m)/s)².

    Residuals of neighbouring rows that are alike are fewer measurements than rows: with a correlation of ρ the
    variance of their mean is (1 + ρ)/(1 − ρ) times larger. Outliers count less (Huber).
    """
    columns, torque = problem.columns, problem.torque
    off = torque - columns @ problem.mean
    counts, many = problem.counts, np.maximum(problem.counts.sum(axis=0), 1)
    sigma, trust, correlated = np.maximum(off.std(axis=0), _LEAST_NM), counts.astype(float), np.ones(off.shape[1])
    for k in range(_ROUNDS):
        weighted = columns * (trust / (correlated * sigma**2))[:, :, None]
        curvature = np.einsum("tia,tib->ab", weighted, columns) + np.diag(problem.spread**-2.0)
        change = _solve_scaled(curvature, np.einsum("tia,ti->a", weighted, off), problem.spread)
        if k == _ROUNDS - 1:
            break
        residual = off - columns @ change
        robust = np.maximum(1.4826 * np.nanmedian(np.where(counts, np.abs(residual), np.nan), axis=0), _LEAST_NM)
        trust = np.where(counts, np.minimum(1.0, _HUBER * robust / np.maximum(np.abs(residual), _LEAST_NM)), 0.0)
        sigma = np.maximum(np.sqrt(np.sum(trust * residual**2, axis=0) / many), _LEAST_NM)
        if k == _ROUNDS - 2:  # of the fit that has converged: what is not fitted yet is correlated anyhow
            correlated = _inflation(np.where(counts, residual, 0.0))
    covariance = _solve_scaled(curvature, np.eye(len(change)), problem.spread)
    return Solution(problem.mean + change, covariance, off - columns @ change)


def _solve_scaled(curvature: np.ndarray, right: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Solve with unknowns in units of their spread, whose curvatures are at least 1: none is singular."""
    scaled = spread[:, None] * curvature * spread
    solution = np.linalg.solve(scaled, (spread * right.T).T)
    return (spread * solution.T).T


def _inflation(residual: np.ndarray) -> np.ndarray:
    """Return by how much correlation in time makes the variance of a mean larger, (n,)."""
    size = np.maximum(np.mean(residual**2, axis=0), _LEAST_NM**2)
    rho = np.clip(np.mean(residual[1:] * residual[:-1], axis=0) / size, 0.0, _CORRELATED)
    return (1.0 + rho) / (1.0 - rho)
