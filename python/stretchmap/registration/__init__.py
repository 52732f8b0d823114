"""Maps of one solid torus onto another, landmarks to landmarks."""
