"""Rays against the scene: the tree over its triangles, made on the device, and its traversal in WESL."""
