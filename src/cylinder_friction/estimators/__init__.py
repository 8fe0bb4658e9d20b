"""Everything that estimates friction from a recording, behind one protocol.

Every kind is imported here, so that ``FrictionEstimator.load`` knows it.
"""
