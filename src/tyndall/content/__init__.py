"""How each kind of scene content draws itself into the G-buffer and into a light's depth."""
