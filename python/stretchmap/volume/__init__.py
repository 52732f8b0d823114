"""The volume-preserving map of a solid torus (Algorithm 5.1), and the certified one."""
