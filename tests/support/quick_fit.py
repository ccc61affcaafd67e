"""Parameters of the quickest fit, for tests of what is done with a fit."""

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.tuner.fitting.fit_density import FEW_VPLS

QUICK_FIT = ArtistParameters(vpl_count=FEW_VPLS + 1)
"""The fewest VPLs whose density is chosen from one image each. With `FEW_VPLS` or less, it is fitted over
several rotations, which takes far longer."""
