"""Slow, obviously right NumPy forms of every stage, and of the founding method.

Nothing here is shipped: each module is the oracle a test holds the library against,
so it prefers the shape of the equation to speed and imports nothing of ``unsmear``.
"""
