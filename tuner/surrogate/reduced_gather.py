"""The fit of a view as a small least-squares problem, with about one row for each node of the gather's table.

Let B be the tabulated gather at all receivers and channels, f the weights of its nodes, k the intensity, and
m = (a + b)/2 the mean of the reference's halves. The loss of a view is

    Σ w (kBf − a)(kBf − b) = |√w (kBf − m)|² − Σ w (a − b)²/4

The first term depends on B, w and m only through G = [B m]ᵀ w [B m]. Any R with RᵀR = G gives the same
residuals up to a rotation, R [kf, −1]. So a step of the fit costs a product with a matrix of some 105 rows
instead of 12,288, for any number of receivers and VPLs.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.linalg.lapack import dpstrf  # pyright: ignore[reportAttributeAccessIssue] made at import

from vpltune.tuner.metrics.relative_squared_error import Target
from vpltune.tuner.surrogate.tabulated_gather import TabulatedGather, node_weights
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters

ROWS_AT_ONCE = 1024
"""Rows that are summed in float32; the partial sums are added in float64. A choice."""
ROUNDING = 1e-7
"""Tolerance of the factorisation, relative to the largest diagonal element of G: the rounding of float32."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ReducedGather:
    """The small problem of one view. Its loss is |`reduced_image` − target|² + offset."""

    factor: Float[Array, "rows nodes"]
    """R without its last column."""
    target: Float[Array, " rows"]
    """The last column of R, which stands for m."""
    offset: Float[Array, ""]
    """−Σ w (a − b)²/4, which removes the noise of the reference from the squared residuals."""


def reduce_gather(table: TabulatedGather, target: Target) -> ReducedGather:
    """The small problem of one view. It is computed once for each placement of the VPLs."""
    return ReducedGather(*reduce_columns(table.irradiance, target))


def reduce_columns(
    irradiance: Float[Array, "receivers 3 nodes"], target: Target
) -> tuple[Float[Array, "rows nodes"], Float[Array, " rows"], Float[Array, ""]]:
    """Factor, target and offset (see `ReducedGather`) for images `irradiance` · x, linear in x.

    If `irradiance` is not finite, factor and target are NaN.
    """
    chunks, offset = _gram(irradiance, target)
    gram = np.asarray(chunks, np.float64).sum(axis=0)
    # Pivoted Cholesky factorisation of a semidefinite matrix (Higham 1990), twenty times faster than its
    # eigenvectors. It stops when the remainder is no larger than rounding.
    upper, pivots, rank, _ = dpstrf(gram, tol=ROUNDING * np.diagonal(gram).max())
    # Return NaN for a non-finite matrix: a zero factor would look like a black image.
    factor = np.full_like(gram, 0.0 if np.isfinite(gram).all() else np.nan)
    factor[:rank, pivots - 1] = np.triu(upper)[:rank]
    return jnp.asarray(factor[:, :-1], jnp.float32), jnp.asarray(factor[:, -1], jnp.float32), offset


def reduced_image(reduced: ReducedGather, parameters: FalloffParameters) -> Float[Array, " rows"]:
    """The weighted image for these parameters, rotated into the rows of the small problem."""
    weights = node_weights(parameters)
    return parameters.intensity * jnp.matmul(reduced.factor, weights, precision=jax.lax.Precision.HIGHEST)


@jax.jit
def _gram(
    irradiance: Float[Array, "receivers 3 nodes"], target: Target
) -> tuple[Float[Array, "chunks columns columns"], Float[Array, ""]]:
    mean = (target.half_a + target.half_b) / 2.0
    columns = jnp.concatenate([irradiance, mean[..., None]], axis=-1) * jnp.sqrt(target.weight)[..., None]
    columns = columns.reshape(-1, columns.shape[-1])
    columns = jnp.pad(columns, ((0, -len(columns) % ROWS_AT_ONCE), (0, 0)))
    chunks = columns.reshape(-1, ROWS_AT_ONCE, columns.shape[-1])
    gram = jnp.einsum("cri,crj->cij", chunks, chunks, precision=jax.lax.Precision.HIGHEST)
    return gram, -jnp.sum(target.weight * (target.half_a - target.half_b) ** 2) / 4.0
