"""Harmonic and holomorphic one-forms of a surface."""
