"""How far each runtime may be from the golden trajectories: the one table."""

from __future__ import annotations

TOLERANCES_N = {
    "python": 0.0,
    "python_run": 0.0,
    "c_double": 0.1,
    "c_float": 0.1,
    "fmi2": 0.1,
    "fmi3": 0.1,
}
"""Largest difference of friction and of either bound [N]. Flags are equal in every runtime.

The step adds in one order on every machine, so Python meets them bit for bit. So do the C that adds in double
precision, and the FMU around it, if the compiler does not fuse multiplications and additions. But a forest turns the
last bit of a feature into a whole step of a tree if it lies on a threshold, so they have room for such a step. The C of
``float`` samples computes as that of ``double`` does, and gets the samples rounded.
"""

RARELY_N = {("c_float", "pressure_free"): 20.0}
"""Largest difference in at most one sample of twenty, by runtime and model: where no force balance is corrected, the
forest carries more of friction, and a rounded sample sometimes takes another branch of a tree."""
