"""How much a map distorts areas, volumes and angles."""
