"""Any estimator as one C99 source and one header: no allocation, no global state, no dependency but libm."""
