"""What all maps have in common: results, files, points carried through them."""
