"""How models' own numbers of gloss lead to the roughness α of Ward's model, and back.

α is what strokes count gloss by: steps that are even in it look even (Pellacini, Ferwerda & Greenberg 2000).
"""

from __future__ import annotations

import math


class Rough:
    """Of models with a roughness 0…1, whose square is α."""

    def alpha(self, gloss: float) -> float:
        """roughness²."""
        return gloss * gloss

    def gloss(self, alpha: float) -> float:
        """√α."""
        return math.sqrt(alpha)


class Sharp:
    """Of models with an exponent n: α² = 2 / (n + 2), as of the microfacets that Blinn's lobe stands for."""

    def alpha(self, gloss: float) -> float:
        """√(2 / (n + 2))."""
        return math.sqrt(2 / (gloss + 2))

    def gloss(self, alpha: float) -> float:
        """2 / α² − 2."""
        return 2 / (alpha * alpha) - 2
