"""Independent solutions that hairbake is held against: boundary-value, eigenvalue and spectral solvers on numpy and scipy.

Everything here is dimensionless unless said otherwise: lengths in L, forces in EI/L², masses in ρSL. None of it shares
code or discretisation with hairbake.
"""
