"""Independent solutions: boundary-value, eigenvalue and spectral solvers on numpy and scipy.

Quantities are dimensionless unless stated otherwise: lengths in L, forces in EI/L², masses in ρSL. Nothing
here shares code or discretization with hairbake.
"""
