"""Pictures of ellipsoids, profiles and domains. Everything here takes arrays; matplotlib is loaded on first use."""

from maniport.viewing.diffusion import DiffusionMap, diffusion_map

__all__ = ["DiffusionMap", "diffusion_map"]
