"""CMA-ES whose candidates do not hang on how BLAS rounds.

Two private methods of the cmaes package are used; pyproject.toml caps its version for them. Loading this loads cmaes.
"""

from __future__ import annotations

import cmaes

from metaid.models import Array


class SymmetricRootCma(cmaes.CMA):  # type: ignore[misc]
    """CMA-ES that draws mean + σ C^½ z where the package draws mean + σ B D z, with C = B D² Bᵀ.

    As long as there are fewer candidates in a generation than lumps, some eigenvalues of C are equal, and which
    eigenvectors B has for them hangs on how BLAS rounds. The symmetric root of C does not depend on them.
    """

    def _sample_solution(self) -> Array:
        axes, lengths = self._eigen_decomposition()
        z = self._rng.randn(self._n_dim)
        solution: Array = self._mean + self._sigma * (axes @ (lengths * (axes.T @ z)))
        return solution
