"""Proofs that a map is one to one."""
