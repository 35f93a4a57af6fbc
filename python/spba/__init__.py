"""Semantic photometric bundle adjustment: an object's full shape and every camera, from pictures and masks in memory."""

from ._spba import Prior, Sequence, Solution, SpbaError, solve

__all__ = ["Prior", "Sequence", "Solution", "SpbaError", "solve"]
