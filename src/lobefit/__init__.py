"""Lobefit: fit reflectance models to BRDF measurements.

The subpackages are ``lobefit.kernels`` (models and OpenCL), ``lobefit.fitting``
(measurements and fits) and ``lobefit.service`` (what people touch). Importing
this package imports none of them, so that a light client stays light.
"""

__version__ = "0.1.0"
