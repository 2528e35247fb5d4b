"""Measure, compare and keep: pictures, times, bytes and errors of the techniques."""
