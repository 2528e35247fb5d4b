"""Scenes as plain data, their files, and the bundled ones."""
